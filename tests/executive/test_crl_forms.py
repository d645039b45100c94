"""Text, canonical text, readable text and JSON say the same plan."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from executive.crl import (
    CrlFormError,
    CrlSyntaxError,
    Plan,
    canonical_text,
    check,
    digest,
    from_json,
    parse,
    readable_text,
    to_json,
    validate,
)
from executive.crl.field_help import FIELD_HELP
from executive.crl.nodes import FORMS, Node, Task, language_words, walk_plan
from executive.crl.printer import canonical_node
from executive.crl.syntax import codec
from executive.crl.trees import ms_text, number_text
from executive.crl.values import Interval, seconds_to_ms
from tests import strategies

whole = settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))


@whole
@given(strategies.plans())
def test_generated_plans_are_valid(plan: Plan) -> None:
    errors = [f for f in validate(plan) if f.is_error]
    assert errors == []


@whole
@given(strategies.plans())
def test_printing_and_parsing_is_the_identity(plan: Plan) -> None:
    canonical = canonical_text(plan)
    for text in (canonical, readable_text(plan)):
        again = parse(text)
        assert again == plan
        # Equality of numbers does not tell 1 from t, the text does.
        assert canonical_text(again) == canonical


@whole
@given(strategies.plans())
def test_text_to_json_to_text_is_the_identity(plan: Plan) -> None:
    document = json.loads(json.dumps(to_json(plan)))
    assert from_json(document) == plan
    assert canonical_text(from_json(document)) == canonical_text(plan)
    assert to_json(from_json(document)) == to_json(plan)


@whole
@given(strategies.plans())
def test_the_readable_text_differs_in_white_space_only(plan: Plan) -> None:
    text = readable_text(plan)
    assert text.endswith(")\n")
    assert _squeezed(text) == _squeezed(canonical_text(plan))


def _squeezed(text: str) -> str:
    return "".join(text.split())


@whole
@given(strategies.nodes())
def test_a_bare_node_is_a_plan_with_default_header(node: Node) -> None:
    assert parse(canonical_node(node)) == Plan(node=node)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_are_printed_so_that_they_read_back(number: float) -> None:
    text = number_text(number)
    assert float(text) == number
    assert "E" not in text
    plan = parse(f"(task :id a :action x :reward {text})")
    assert plan.node.reward == number


def test_numbers_are_printed_in_their_shortest_form() -> None:
    pairs = {
        0.1: "0.1",
        3.0: "3",
        -0.0: "0",
        1e20: "100000000000000000000",
        1e21: "1e+21",
        1e-6: "0.000001",
        1.5e-7: "1.5e-7",
        -12.50: "-12.5",
    }
    assert {n: number_text(n) for n in pairs} == pairs


@given(st.integers(-(10**12), 10**12))
def test_milliseconds_survive_the_text(t_ms: int) -> None:
    assert seconds_to_ms(float(ms_text(t_ms))) == t_ms


def test_canonical_text_has_grammar_order_and_leaves_defaults_out() -> None:
    text = """
    (block :node-list ((task :action image :retries 0 :priority 50 :parameters (b = :word a="two words")
                             :id t1 :continue-on-failure :duration (0 :plus-infinity) ; a comment
                             :start-temporal-conditions ((2 268435456) (:relative (-300000000 0.0004)))))
           :id root)
    """
    assert canonical_text(parse(text)) == (
        "(plan :node (block :id root :node-list ((task :id t1 :start-temporal-conditions"
        " ((2 :plus-infinity) (:relative (:minus-infinity 0))) :duration (0 :plus-infinity)"
        ' :continue-on-failure t :action image :parameters (b = word a = "two words")))))'
    )


def test_digest_is_the_hash_of_the_canonical_text_and_does_not_change() -> None:
    plan = parse("(task :id a :action image)")
    assert digest(plan) == hashlib.sha256(b"(plan :node (task :id a :action image))").hexdigest()
    assert digest(plan) == "aacdb22a156416bfc680a26cf70be07e645446cce8955706632b7e730bb8caa7"


def test_equal_values_in_different_spelling_give_equal_plans() -> None:
    one = parse("(task :id a :action x :parameters (s = :tracked n = 1.50 b = true e = () f = nil))")
    two = parse('(task :id a :action x :parameters (s="tracked" n=15e-1 b=t e=nil f=()))')
    assert one == two
    assert digest(one) == digest(two)
    assert digest(one) != digest(
        parse('(task :id a :action x :parameters (s="tracked" n=15e-1 b="t" e=nil f=()))')
    )


def test_flags_may_stand_without_a_value() -> None:
    plan = parse("(task :id a :continue-on-failure :interruptible :action x)")
    assert isinstance(plan.node, Task)
    assert plan.node.continue_on_failure
    assert plan.node.interruptible


@pytest.mark.parametrize(
    ("text", "interval"),
    [
        ("(0 268435456)", Interval(0, None)),
        ("(-268435456 268435455.999)", Interval(None, 268435455999)),
        ("(:minus-infinity :plus-infinity)", Interval(None, None)),
        ("(0.0004 1.0006)", Interval(0, 1001)),
        ("(-3 1e3)", Interval(-3000, 1000000)),
    ],
)
def test_bounds_are_whole_milliseconds_or_infinite(text: str, interval: Interval) -> None:
    assert parse(f"(task :id a :action x :duration {text})").node.duration == interval


def test_depth_and_width_are_no_trouble() -> None:
    deep = "(task :id t :action x)"
    for level in range(199):
        deep = f"(block :id b{level} :node-list ({deep}))"
    plan = parse(deep)
    assert sum(1 for _ in walk_plan(plan)) == 200
    assert canonical_text(parse(readable_text(plan))) == canonical_text(plan)
    assert canonical_text(from_json(to_json(plan))) == canonical_text(plan)
    with pytest.raises(CrlSyntaxError, match="E001"):
        parse("(" * 200_000)


@pytest.mark.parametrize(
    ("document", "message"),
    [
        (5, "object with a member kind"),
        ({"kind": "plan"}, "E013"),
        ({"kind": "task", "id": "a b", "action": "x"}, '"id" needs a symbol'),
        ({"kind": "task", "id": "a", "action": "x", "speed": 3}, "E011"),
        ({"kind": "task", "id": "a", "action": "x", "duration": [0, 1]}, "lo and hi"),
        ({"kind": "task", "id": "a", "action": "x", "start-conditions": [{"op": "~", "key": "k"}]}, "bad op"),
        ({"kind": "block", "id": "a", "node-list": {}}, "needs an array"),
        ({"kind": "block", "id": "a", "node-list": [7]}, "object"),
        ({"kind": "task", "id": "a", "action": "x", "reward": float("inf")}, "cannot be written"),
        ({"kind": "task", "id": "a", "action": "x", "reward": None}, "needs a number"),
    ],
)
def test_a_bad_json_form_is_refused_by_name(document: object, message: str) -> None:
    with pytest.raises(CrlFormError, match=message):
        from_json(document)


@given(st.text(max_size=60))
def test_any_text_is_a_plan_or_a_syntax_error_with_a_place(text: str) -> None:
    report = check(text)
    places = [(f.line, f.column) for f in report.findings]
    assert all(line >= 1 and column >= 1 for line, column in places)
    assert report.plan is not None or report.errors


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_a_damaged_plan_never_crashes_the_reader(data: st.DataObject) -> None:
    plan = data.draw(strategies.plans(depth=2))
    text = canonical_text(plan)
    tokens = text.replace("(", " ( ").replace(")", " ) ").split()
    at = data.draw(st.integers(0, len(tokens) - 1))
    other = data.draw(st.integers(0, len(tokens) - 1))
    change = data.draw(st.sampled_from(["drop", "double", "swap", "word", "number"]))
    match change:
        case "drop":
            del tokens[at]
        case "double":
            tokens.insert(at, tokens[at])
        case "swap":
            tokens[at], tokens[other] = tokens[other], tokens[at]
        case "word":
            tokens[at] = "zzz"
        case _:
            tokens[at] = "-7.5"
    for finding in check(" ".join(tokens)).findings:
        assert finding.line >= 1
        assert finding.column >= 1


def test_the_language_needs_the_standard_library_only() -> None:
    code = (
        "import sys; before = set(sys.modules); import executive.crl;"
        "new = {m.split('.')[0] for m in set(sys.modules) - before};"
        "print(sorted(new - set(sys.stdlib_module_names) - {'executive'}))"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_every_syntax_that_a_form_uses_can_be_read_and_written() -> None:
    for form in FORMS.values():
        for declared in form.fields.values():
            assert declared in form.structure or codec(declared.syntax).read


def test_every_field_has_a_line_of_help_and_the_reference_says_the_same() -> None:
    words = language_words()
    fields = {word for form in FORMS.values() for word in form.fields}
    assert words["about_fields"] == FIELD_HELP
    assert fields == set(FIELD_HELP), "a line for each field, and for no other"
    page = (Path(__file__).parents[2] / "docs" / "reference" / "crl.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `:([a-z-]+)` \| [^|]+ \| (.+) \|$", page, re.MULTILINE)
    assert len(rows) == len(FORMS["block"].fields) - 1  # all but what each kind has of its own
    assert {word: FIELD_HELP[word] for word, _ in rows} == dict(rows)
