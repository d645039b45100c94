from __future__ import annotations

import time

import pytest

from executive.crl.reader import parse
from ground.errors import InvalidInputError
from ground.versions.difference import DIFFERENCES, Group, difference

BASE = """(plan :node (block :id root :node-list (
  (task :id go :action navigate :parameters (x = 1 y = 2) :duration (0 900)
    :start-conditions ((database (:soc >= 5)) (database (:tilt < 1))))
  (branch :id next :options ((option :id a :utility 2 :node (task :id one :action image))
                             (option :id b :utility 1 :node (task :id two :action wait)))))))"""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("(x = 1 y = 2)", "(y = 2.0   x = 1)"),
        (":duration (0 900)", ":end-temporal-conditions ((:relative (0 900)))"),
        (
            ":duration (0 900)",
            ":duration (0 950) :end-temporal-conditions ((:relative (0 900)) (-1e9 1e9))",
        ),
        (
            "(database (:soc >= 5)) (database (:tilt < 1))",
            "(and (database (:tilt < 1)) (not (database (:soc < 5))))",
        ),
        (
            "(database (:soc >= 5)) (database (:tilt < 1))",
            "(not (or (database (:soc < 5)) (not (database (:tilt < 1)))))",
        ),
        (":utility 2 ", ":utility ((0 2) (9 2)) "),
        (
            """(option :id a :utility 2 :node (task :id one :action image))
                             (option :id b :utility 1 :node (task :id two :action wait))""",
            "(option :id b :utility 1 :node (task :id two :action wait)) "
            "(option :id a :utility 2 :node (task :id one :action image))",
        ),
        (":action wait", ":action wait :probability 0 :priority 50"),
    ],
)
def test_other_words_for_the_same_are_no_difference(old: str, new: str) -> None:
    assert old in BASE
    assert difference(parse(BASE), parse(BASE.replace(old, new))).changes == ()


@pytest.mark.parametrize(
    ("old", "new", "group", "line"),
    [
        ("x = 1", "x = 3", Group.STEPS, "task go :parameters: (x = 1 y = 2) -> (x = 3 y = 2)"),
        ("(0 900)", "(0 800)", Group.WINDOWS, "((:relative (0 900))) -> ((:relative (0 800)))"),
        (":soc >= 5", ":soc > 5", Group.CONDITIONS, "(database (:soc > 5))"),
        (":utility 2", ":utility 3", Group.BRANCHES, "option a :utility: 2 -> 3"),
        (":action wait", ':action wait :name "n"', Group.WORDS, 'task two :name: (none) -> "n"'),
        ("(task :id one :action image)", "(task :id uno :action image)", Group.STEPS, "task uno renamed"),
        ("(plan ", "(plan :overrun-penalty 3 ", Group.HEADER, "plan :overrun-penalty: (none) -> 3"),
        (" (database (:tilt < 1))", " (known (:tilt))", Group.CONDITIONS, "known"),
    ],
)
def test_difference_is_told_with_its_group(old: str, new: str, group: Group, line: str) -> None:
    assert old in BASE
    found = difference(parse(BASE), parse(BASE.replace(old, new)))
    assert [c.group for c in found.changes] == [group]
    assert line in found.changes[0].line()
    assert found.same is (group is Group.WORDS)
    assert DIFFERENCES.read(DIFFERENCES.write(found)) == found


def test_order_of_options_counts_where_their_utilities_may_tie() -> None:
    text = BASE.replace(":utility 2", ":utility 1")
    parts = text.split("(option ")
    last = ")" + parts[2].split("))", 1)[1][0:]
    swapped = f"{parts[0]}(option {parts[2][: parts[2].index('))') + 2]} (option {parts[1].strip()}"
    swapped += last[1:]
    found = difference(parse(text), parse(swapped))
    assert [str(c.deed) for c in found.changes] == ["reordered"]


def test_added_removed_and_moved_steps_are_told() -> None:
    text = BASE.replace("(branch", "(task :id extra :action wait) (branch").replace(
        "(task :id two :action wait)", "(block :id bb :node-list ((task :id two :action wait)))"
    )
    lines = [c.line() for c in difference(parse(BASE), parse(text)).changes]
    assert "task extra added (in root)" in lines
    assert "block bb added (in b)" in lines
    assert "task two moved: b -> bb" in lines
    assert "task extra removed (in root)" in [c.line() for c in difference(parse(text), parse(BASE)).changes]


def test_an_id_that_stands_twice_is_refused_by_name() -> None:
    twice = parse("(plan :node (block :id r :node-list ((task :id a :action x) (task :id a :action y))))")
    with pytest.raises(InvalidInputError, match="the id a stands twice"):
        difference(twice, twice)


def test_fifty_steps_are_compared_within_a_fifth_of_a_second() -> None:
    steps = " ".join(f"(task :id t{i} :action image :parameters (x = {i}))" for i in range(50))
    text = f"(plan :node (block :id root :node-list ({steps})))"
    begun = time.process_time()
    found = difference(parse(text), parse(text.replace("x = 7)", "x = 8)")))
    assert time.process_time() - begun < 0.2
    assert len(found.changes) == 1


def test_what_was_added_is_listed_in_the_order_of_the_plan() -> None:
    more = "".join(f"(task :id extra-{k} :action wait) " for k in range(12))
    found = difference(parse(BASE), parse(BASE.replace("(branch :id next", more + "(branch :id next")))
    assert [c.id for c in found.changes if c.id.startswith("extra")] == [f"extra-{k}" for k in range(12)]


@pytest.mark.parametrize(
    ("before", "after", "group"),
    [
        ("observation = T1-mi", "observation = T1-img", Group.STEPS),
        ("request = r1", "request = r2", Group.STEPS),
        ('step = "1" note = x', 'step = "2" note = x', Group.WORDS),
        ('step = "1" note = x', 'step = "1" note = y', Group.STEPS),
    ],
)
def test_metadata_that_goes_to_the_rover_with_a_task_is_no_word(
    before: str, after: str, group: Group
) -> None:
    text = BASE.replace(":action wait", ":action wait :metadata (%s)")
    found = difference(parse(text % before), parse(text % after))
    assert [(c.field, c.group) for c in found.changes] == [("metadata", group)]
    assert found.same is (group is Group.WORDS)


def test_metadata_that_states_a_resource_is_no_word() -> None:
    text = BASE.replace(
        "(plan ", "(plan :metadata (battery = %s by = %s) :resources ((energy :consumable :key :battery)) "
    )
    assert [c.group for c in difference(parse(text % (5, "a")), parse(text % (5, "b"))).changes] == [
        Group.WORDS
    ]
    found = difference(parse(text % (5, "a")), parse(text % (6, "a")))
    assert [c.group for c in found.changes] == [Group.RESOURCES]
    assert not found.same


def test_renamed_steps_that_stand_in_another_order_are_told_as_reordered_too() -> None:
    text = "(plan :node (block :id %s :node-list (%s)))"
    a, b = "(task :id %s :action image)", "(task :id b :action wait)"
    before = parse(text % ("root", (a % "a") + b))
    for root in ("root", "base"):
        found = difference(before, parse(text % (root, b + (a % "a2"))))
        told = [str(c.deed) for c in found.changes]
        assert told == ["renamed"] * (1 + (root != "root")) + ["reordered"]
        assert found.changes[-1].line() == f"block {root} reordered: a b -> b a2"
    assert [str(c.deed) for c in difference(before, parse(text % ("root", (a % "a2") + b))).changes] == [
        "renamed"
    ]
