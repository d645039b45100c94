from __future__ import annotations

from random import Random

import pytest
from hypothesis import given, settings

from executive.crl.printer import canonical_text
from executive.crl.reader import parse
from executive.crl.validate import check
from ground.errors import InvalidInputError
from ground.versions.difference import difference, without_words
from ground.versions.merge import ConflictKind, Take, merge
from tests.ground.versions.edits import EDITS, random_edits, random_plan
from tests.strategies import plans

PAIRS = 1000
BASE = """(plan :node (block :id root :node-list (
  (task :id go :action navigate :parameters (target = R1 speed = 2) :duration (0 900))
  (task :id look :action image)
  (branch :id next :options ((option :id a :utility 2 :node (task :id one :action image))
                             (option :id b :utility 1 :node (task :id two :action wait)))))))"""


def changed(old: str, new: str, text: str = BASE) -> str:
    assert old in text
    return text.replace(old, new)


def joined(ours: str, theirs: str, take: Take | None = None):
    return merge(parse(BASE), parse(ours), parse(theirs), take)


def test_no_edit_is_lost_without_a_named_conflict() -> None:
    clean = named = 0
    for seed in range(PAIRS):
        rng = Random(seed)
        base = random_plan(rng)
        (ours, kept_a), (theirs, kept_b) = random_edits(base, rng, "a"), random_edits(base, rng, "b")
        assert check(canonical_text(ours)).valid
        assert check(canonical_text(theirs)).valid
        found = merge(base, ours, theirs)
        if found.plan is None:
            assert found.conflicts, seed
            named += 1
            continue
        clean += 1
        assert not found.conflicts, seed
        assert check(canonical_text(found.plan)).valid
        for edit in (*kept_a, *kept_b):
            assert edit.holds(found.plan), f"seed {seed}: {edit.what}"
    assert clean > 400  # the test would also pass if everything were called a conflict
    assert named > 50


def test_merge_says_nothing_that_neither_side_said() -> None:
    for seed in range(300):
        rng = Random(seed)
        base = random_plan(rng)
        ours, theirs = random_edits(base, rng, "a")[0], random_edits(base, rng, "b")[0]
        found = merge(base, ours, theirs)
        if found.plan is None:
            continue
        said = {(c.kind, c.id, c.field) for side in (ours, theirs) for c in difference(base, side).changes}
        for change in difference(base, found.plan).changes:
            assert (change.kind, change.id, change.field) in said, f"seed {seed}: {change}"


@pytest.mark.parametrize("edit", EDITS, ids=lambda e: e.__name__)
def test_edit_of_one_side_alone_is_taken_whole(edit) -> None:
    for seed in range(30):
        rng = Random(seed)
        base = random_plan(rng)
        after = edit(base, rng, "a").plan
        for found in (merge(base, after, base), merge(base, base, after), merge(base, after, after)):
            assert found.conflicts == ()
            assert found.plan is not None
            assert without_words(difference(found.plan, after)).changes == ()


@settings(max_examples=40, deadline=None)
@given(plans())
def test_every_plan_merged_with_itself_is_itself_to_the_byte(plan) -> None:
    found = merge(plan, plan, plan)
    assert found.plan is not None
    assert canonical_text(found.plan) == canonical_text(plan)


def test_members_of_one_field_changed_by_both_are_joined() -> None:
    found = joined(changed("speed = 2", "speed = 3"), changed("target = R1", "target = R2"))
    assert found.plan is not None
    assert "(target = R2 speed = 3)" in canonical_text(found.plan)


@pytest.mark.parametrize(
    ("ours", "theirs", "kind", "who"),
    [
        (changed("speed = 2", "speed = 3"), changed("speed = 2", "speed = 4"), "both-changed", "go"),
        (changed("(0 900)", "(0 800)"), changed("(0 900)", "(0 700)"), "both-changed", "go"),
        (
            changed("(task :id look :action image)", ""),
            changed(":id look :action image", ":id look :action handoff"),
            "removed-and-changed",
            "look",
        ),
        (
            changed("(task :id look :action image)", ""),
            changed("speed = 2)", "speed = 2) :end-temporal-conditions ((look start (0 9)))"),
            "invalid",
            "go",
        ),
        (
            changed("(task :id look", "(task :id n1 :action wait) (task :id look"),
            changed("(task :id look", "(task :id n2 :action wait) (task :id look"),
            "same-place",
            "root",
        ),
        (
            changed(
                ":utility 2 :node (task :id one :action image)", ":utility 2 :node (task :id x :action a)"
            ),
            changed(
                ":utility 2 :node (task :id one :action image)", ":utility 2 :node (task :id y :action a)"
            ),
            "same-place",
            "a",
        ),
    ],
)
def test_conflict_has_a_kind_and_a_place(ours: str, theirs: str, kind: str, who: str) -> None:
    found = joined(ours, theirs)
    assert found.plan is None
    assert (kind, who) in [(str(c.kind), c.id) for c in found.conflicts]
    assert all(c.line() for c in found.conflicts)


def test_a_side_can_be_taken_where_both_changed_a_field() -> None:
    ours, theirs = changed("speed = 2", "speed = 3"), changed("speed = 2", "speed = 4")
    for take, speed in ((Take.OURS, 3), (Take.THEIRS, 4)):
        found = joined(ours, theirs, take)
        assert found.plan is not None
        assert f"speed = {speed}" in canonical_text(found.plan)
        assert [c.kind for c in found.conflicts] == [ConflictKind.BOTH_CHANGED]


@pytest.mark.parametrize("turned", [False, True])
def test_a_condition_that_one_side_removed_and_the_other_changed_is_a_conflict(turned: bool) -> None:
    asks = "(plan :node (task :id look :action image :start-conditions (%s)))"
    base = asks % "(database (:battery >= 100)) (database (:temp >= 3))"
    ours = asks % "(database (:battery >= 200)) (database (:temp >= 3))"
    theirs = asks % "(database (:temp >= 3))"
    sides = (theirs, ours) if turned else (ours, theirs)
    found = merge(parse(base), *map(parse, sides))
    assert found.plan is None
    assert [(str(c.kind), c.id, c.field) for c in found.conflicts] == [
        ("both-changed", "look", "start-conditions")
    ]


@pytest.mark.parametrize("turned", [False, True])
def test_predictions_keep_their_meaning_where_one_side_states_the_spread_otherwise(turned: bool) -> None:
    text = """(plan :expectation-spread :%s :node (block :id root :node-list (
      (task :id a :action image :expectations ((time 10 %s))) %s
      (task :id b :action image :expectations ((time 10 %s))))))"""
    base = text % ("variance", 25, "", 16)
    theirs = text % ("stddev", 6, "(task :id n :action wait :expectations ((time 1 4)))", 4)
    ours = text % ("variance", 25, "", 81)
    sides = (theirs, ours) if turned else (ours, theirs)
    found = merge(parse(base), *map(parse, sides))
    assert found.conflicts == ()
    assert found.plan is not None
    wanted = text % ("stddev", 6, "(task :id n :action wait :expectations ((time 1 4)))", 9)
    assert canonical_text(found.plan) == canonical_text(parse(wanted))


def test_a_side_is_taken_in_single_conflicts_and_every_choice_is_of_one() -> None:
    ours = changed("(0 900)", "(0 800)", changed("speed = 2", "speed = 3"))
    theirs = changed("(0 900)", "(0 700)", changed("speed = 2", "speed = 4"))
    open_ = joined(ours, theirs).conflicts
    assert [c.choosable for c in open_] == [True, True]
    three = parse(BASE), parse(ours), parse(theirs)
    for one, other in ((Take.OURS, Take.THEIRS), (Take.THEIRS, Take.OURS)):
        found = merge(*three, choices={open_[0].key: one, open_[1].key: other})
        assert found.plan is not None
        said = {c.line() for c in difference(parse(BASE), found.plan).changes}
        sides = {Take.OURS: ours, Take.THEIRS: theirs}
        expected = set()
        for conflict, take in zip(open_, (one, other), strict=True):
            expected |= {
                c.line()
                for c in difference(parse(BASE), parse(sides[take])).changes
                if c.field == conflict.field
            }
        assert said == expected
    assert merge(*three, choices={open_[0].key: Take.OURS}).plan is None
    with pytest.raises(InvalidInputError, match="there is no conflict both-changed at look :retries"):
        merge(*three, choices={("both-changed", "look", "retries"): Take.OURS})
