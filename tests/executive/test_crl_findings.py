"""Every code of the validator: a plan on which it is reported, and a near one on which it is not."""

from __future__ import annotations

import re
from dataclasses import dataclass

import pytest

from executive.crl import CrlValidationError, Finding, Severity, check, load, parse, validate
from executive.crl.dictionary import (
    ActionSpec,
    CommandDictionary,
    TelemetryDictionary,
    ValueSpec,
    ValueType,
)
from executive.crl.nodes import FORMS, Block, Option, Plan, Task
from executive.crl.values import Comparison, Expectation, Operator, UtilityTable

COMMANDS = CommandDictionary(
    "toy",
    "1",
    {
        "image": ActionSpec("image", (ValueSpec("camera", ValueType.STRING, choices=("navcam", "hazcam")),)),
        "wait": ActionSpec(
            "wait", (ValueSpec("duration_s", ValueType.NUMBER, "s", required=True, minimum=0, maximum=600),)
        ),
        "go": ActionSpec(
            "go",
            (
                ValueSpec("target", ValueType.STRING),
                ValueSpec("x", ValueType.NUMBER),
                ValueSpec("y", ValueType.NUMBER),
                ValueSpec("track", ValueType.BOOLEAN),
            ),
            one_of=(("target",), ("x", "y")),
        ),
    },
)
TELEMETRY = TelemetryDictionary(
    "toy",
    "1",
    {
        "trackerstate": ValueSpec("trackerstate", ValueType.STRING, choices=("tracked", "lost")),
        "soc": ValueSpec("soc", ValueType.NUMBER, minimum=0, maximum=100),
        "sun": ValueSpec("sun", ValueType.BOOLEAN),
    },
    {"trackerstate": 1},
)


def root(*nodes: str, kind: str = "block", fields: str = "") -> str:
    return f"({kind} :id root {fields} :node-list ({' '.join(nodes)}))"


def task(identifier: str, fields: str = "") -> str:
    return f"(task :id {identifier} :action image {fields})"


def plan(node: str, fields: str = "") -> str:
    return f"(plan :id p {fields} :node {node})"


ARM = ":resources ((arm :unit) (mast :unit) (power :capacity 10) (energy :consumable :key :soc :floor 20))"
TRACKED = '(database (:trackerstate "Rock1" = :tracked))'


def floating(
    node: str, fields: str = "", trigger: str = ":trigger-conditions ((database (:soc < 5)))"
) -> str:
    return f":floating ((floating-contingency :id f {trigger} {fields} :node {node}))"


def branch(*options: str, fields: str = "") -> str:
    return f"(branch :id br {fields} :options ({' '.join(options)}))"


def option(identifier: str, node: str, fields: str = "") -> str:
    return f"(option :id {identifier} {fields} :node {node})"


def after(node: str, point: str = "end", interval: str = "(0 10)") -> str:
    return f":start-temporal-conditions (({node} {point} {interval}))"


@dataclass(frozen=True)
class Case:
    """`bad` must give the code, with a message that matches; `good` must not."""

    code: str
    bad: str
    good: str
    message: str
    node: str = ""


A, B, C = task("a"), task("b"), task("c")

CASES = [
    Case("E001", "(task :id a :action image", A, r'missing "\)" for "\(" at line 1'),
    Case("E001", A + ")", A, r'"\)" without "\("'),
    Case("E002", '(task :id a :action image :name "x)', task("a", ':name "x)"'), "string .* does not end"),
    Case("E003", "(task :id a :action 'image)", A, "illegal token"),
    Case("E003", "(task : a)", A, 'illegal token ":"'),
    Case("E003", A + B, A + " ; " + B, "after the end of the plan"),
    Case("E004", "; nothing\n", A, "not a plan"),
    Case("E004", "image", A, "not a plan"),
    Case("E010", root("(tsk :id a :action image)"), root(A), 'unknown kind "tsk"', "a"),
    Case("E010", root(option("o", A)), root(branch(option("o", A))), '"option" is not a node'),
    Case(
        "E010",
        plan(A, ":library ((floating-contingency :id f :node (task :id b :action x)))"),
        A,
        "alternate",
    ),
    Case(
        "E011",
        root(A, fields=":action image"),
        root(A),
        r'block root: field ":action" is not allowed here',
        "root",
    ),
    Case("E011", task("a", ":retrys 2"), task("a", ":retries 2"), '":retrys" is not allowed'),
    Case(
        "E012",
        task("a", ":retries 1 :retries 2"),
        task("a", ":retries 1"),
        'task a: field ":retries" is given twice',
    ),
    Case("E013", "(task :action image)", A, 'field ":id" is missing'),
    Case("E013", "(task :id a)", A, 'task a: field ":action" is missing', "a"),
    Case("E013", "(block :id a)", root(A), 'field ":node-list" is missing'),
    Case("E013", root("(branch :id b)"), root(A), 'field ":options" is missing'),
    Case("E013", "(plan :id p)", plan(A), 'plan p: field ":node" is missing'),
    Case(
        "E014",
        task("a", ":retries two"),
        task("a", ":retries 2"),
        'task a: ":retries" needs a non-negative integer, found "two"',
    ),
    Case("E014", "(task :id 5 :action image)", "(task :id a5 :action image)", '":id" needs a symbol'),
    Case("E014", task("a", ":priority .5"), task("a", ":priority 0.5"), '":priority" needs a number'),
    Case("E014", task("a", ":duration 5"), task("a", ":duration (0 5)"), "an interval"),
    Case(
        "E014",
        task("a", ":start-temporal-conditions (0 5)"),
        task("a", ":start-temporal-conditions ((0 5))"),
        "list of temporal",
    ),
    Case("E014", task("a", ":parameters (x 5)"), task("a", ":parameters (x=5)"), "name = value"),
    Case("E014", task("a", ":parameters (x=1 x=2)"), task("a", ":parameters (x=1 y=2)"), "gives x twice"),
    Case(
        "E014",
        task("a", ":on-resume :again"),
        task("a", ":on-resume :restart"),
        ":reattach or :restart or :fail",
    ),
    Case("E014", plan(A, ':epoch "noon"'), plan(A, ':epoch "2031-05-04T06:30:00Z"'), "ISO 8601"),
    Case("E014", plan(A, ":resources ((arm))"), plan(A, ":resources ((arm :unit))"), "a resource"),
    Case(
        "E014",
        plan(A, ":resources ((arm :unit) (arm :unit))"),
        plan(A, ":resources ((arm :unit))"),
        "declared twice",
    ),
    Case("E015", root(A, "\n" + task("a")), root(A, B), 'id "a" at line 2 was already used at line 1', "a"),
    Case("E015", root(branch(option("a", A))), root(branch(option("o", A))), 'id "a"'),
    Case("E016", "(block :id root :node-list ())", root(A), '":node-list" is empty'),
    Case("E017", "(branch :id b :options nil)", root(branch(option("o", A))), "at least one option"),
    Case(
        "E018",
        root(branch("(option :id o)")),
        root(branch(option("o", A))),
        "option o: option without a node",
        "o",
    ),
    Case(
        "E020",
        root(A, task("b", after("aa"))),
        root(A, task("b", after("a"))),
        'task b: unknown node "aa" in :start-temporal-conditions',
        "b",
    ),
    Case(
        "E020",
        root(A, branch(option("o", B)), task("c", after("o"))),
        root(A),
        '"o" .* is an option, not a node',
    ),
    Case(
        "E021",
        root(task("a", after("a", "start"))),
        root(task("a", ":end-temporal-conditions ((a start (0 9)))")),
        "refers to its own start",
    ),
    Case("E021", task("a", ":end-temporal-conditions ((a end (0 9)))"), A, "refers to its own end"),
    Case(
        "E022",
        root(task("a", after("root"))),
        root(task("a", after("root", "start"))),
        "waits .* for the end of root",
    ),
    Case("E022", root(task("a", after("root"))), root(task("a", after("root", "end", "(-10 0)"))), "part of"),
    Case(
        "E023",
        plan(root(A), floating(B, ":scope rot")),
        plan(root(A), floating(B, ":scope root")),
        'unknown node "rot" in :scope',
    ),
    Case(
        "E023",
        plan(root(A), floating(B, ":scope b")),
        plan(root(A), floating(B, ":scope a")),
        "not in the main tree",
    ),
    Case(
        "E024",
        task("a", ":end-conditions ((database (:outcome b = :failed)))"),
        task("a", ":end-conditions ((database (:attempts a < 3)))"),
        'unknown node "b" in :outcome',
    ),
    Case(
        "E024",
        task("a", ":end-conditions ((known (:result b image)))"),
        task("a", ":end-conditions ((known (:result a image)))"),
        "in :result",
    ),
    Case(
        "E025",
        root(branch(option("o", A), option("q", task("c", after("a"))))),
        root(A, branch(option("q", task("c", after("a"))))),
        "c and a never run in the same execution",
    ),
    Case(
        "E026",
        root(task("a", after("b")), task("b", after("a")), kind="concurrent-block"),
        root(A, task("b", after("a")), kind="concurrent-block"),
        "waits for itself: .*end of a",
    ),
    Case(
        "E026",
        root(task("a", after("b", "start")), B),
        root(A, task("b", after("a", "start"))),
        "waits for itself",
    ),
    Case(
        "E026",
        root(task("a", after("b", "start")), B),
        root(task("a", after("b", "start", "(-5 10)")), B),
        "waits",
    ),
    Case(
        "E027",
        plan(root(A), floating(task("b", after("root")))),
        plan(root(A), floating(task("b", after("root", "start", "(0 99)")))),
        "waits .* for the end of root",
    ),
    Case(
        "E027",
        plan(root(A), floating(task("b", after("a")))),
        plan(root(A, C, kind="concurrent-block"), floating(task("b", after("c")), ":scope a")),
        "keeps from starting",
    ),
    Case(
        "E027",
        plan(root(task("a", after("b", "end", "(-5 5)"))), floating(B)),
        plan(root(A), floating(B)),
        "a node of floating-contingency f",
    ),
    Case(
        "E030", task("a", ":duration (5 4)"), task("a", ":duration (4 5)"), "ends before it begins: \\(5 4\\)"
    ),
    Case("E030", task("a", ":start-temporal-conditions ((:plus-infinity 4))"), A, "empty interval"),
    Case(
        "E031",
        root(task("a", ":duration (30 40)"), fields=":duration (0 20)"),
        root(task("a", ":duration (10 40)"), fields=":duration (0 20)"),
        "inconsistent by 10 s: .*:duration \\(30 40\\) of task a.*:duration \\(0 20\\) of block root",
    ),
    Case(
        "E031",
        root(branch(option("o", task("a", ":duration (30 40)"))), fields=":duration (0 20)"),
        root(branch(option("o", task("a", ":duration (20 40)"))), fields=":duration (0 20)"),
        "with option o is inconsistent by 10 s",
    ),
    Case(
        "E031",
        plan(root(A), floating(task("b", ":start-temporal-conditions ((5 6) (7 8))"))),
        plan(root(A), floating(task("b", ":start-temporal-conditions ((5 6) (6 8))"))),
        "network of floating-contingency f is inconsistent by 1 s",
    ),
    Case(
        "E032",
        task("a", ":start-temporal-conditions ((-9 -1))"),
        task("a", ":start-temporal-conditions ((-9 0))"),
        "ends before the plan starts",
    ),
    Case(
        "E040",
        task("a", ":start-conditions ((database :soc = 5))"),
        task("a", ":start-conditions ((database (:soc = 5)))"),
        "needs the form",
    ),
    Case(
        "E040",
        task("a", f":start-conditions {TRACKED}"),
        task("a", f":start-conditions ({TRACKED})"),
        "a list of conditions",
    ),
    Case(
        "E040",
        task("a", ":start-conditions ((database (:outcome = 5)))"),
        task("a", ":start-conditions ((known (:time)))"),
        "needs the form",
    ),
    Case(
        "E041",
        task("a", ":start-conditions ((database (:soc < :high)))"),
        task("a", ":start-conditions ((database (:soc = :high)))"),
        "needs a number after <",
    ),
    Case(
        "E060",
        plan(task("a", ":uses (arn)"), ARM),
        plan(task("a", ":uses (arm)"), ARM),
        'undeclared resource "arn" in :uses',
    ),
    Case(
        "E060",
        plan(A, ARM + " :budgets ((tme 5))"),
        plan(A, ARM + " :budgets ((time 5) (energy 9))"),
        '":budgets" names "tme"',
    ),
    Case(
        "E061",
        plan(task("a", ":uses ((power 11))"), ARM),
        plan(task("a", ":uses ((power 10))"), ARM),
        'asks for 11 of "power"; there is 10',
    ),
    Case(
        "E061",
        plan(task("a", ":uses (arm arm)"), ARM),
        plan(task("a", ":uses (arm mast)"), ARM),
        'asks for 2 of "arm"',
    ),
    Case(
        "E062",
        plan(root(task("a", ":uses (arm)"), fields=":uses (arm)"), ARM),
        plan(root(task("a", ":uses (mast)"), fields=":uses (arm)"), ARM),
        "which block root holds",
    ),
    Case(
        "E062",
        plan(root(A, fields=":uses (arm)"), ARM + floating(task("b", ":uses (arm)"))),
        plan(root(task("a", ":uses (arm)")), ARM + floating(task("b", ":uses (arm)"))),
        "root holds",
    ),
    Case(
        "E063",
        plan(task("a", ":uses (energy)"), ARM),
        plan(task("a", ":requires ((energy 5))"), ARM),
        "which is a consumable",
    ),
    Case(
        "E063",
        plan(task("a", ":requires ((arm 1))"), ARM),
        plan(task("a", ":uses (arm)"), ARM),
        "which is not a consumable",
    ),
    Case(
        "E070",
        root(branch(option("o", A, ":utility ()"))),
        root(branch(option("o", A, ":utility ((0 1))"))),
        "at least one point",
    ),
    Case(
        "E070",
        root(branch(option("o", A, ":utility ((5 1) (5 2))"))),
        root(branch(option("o", A, ":utility ((5 1) (6 2))"))),
        "do not increase: 5 and 5",
    ),
    Case(
        "E080",
        task("a", ":probability 1.5"),
        task("a", ":probability 1"),
        '":probability" must lie in 0 .. 1',
    ),
    Case(
        "E082",
        task("a", ":expectations ((time 60))"),
        task("a", ":expectations ((time 60 5))"),
        "entries of the form",
    ),
    Case("E084", task("a", ":retries -1"), task("a", ":retries 0"), "needs a non-negative integer"),
    Case("E084", task("a", ":retries 1.5"), task("a", ":retries 1"), "needs a non-negative integer"),
    Case(
        "E100",
        plan(root(A), floating(B, trigger="")),
        plan(root(A), floating(B)),
        "needs .:trigger-conditions",
    ),
    Case(
        "E101",
        plan(root(A), floating(B, ":max-insertions 0")),
        plan(root(A), floating(B, ":max-insertions 1")),
        "at least 1",
    ),
    Case(
        "E102",
        plan(root(A), floating("(floating-contingency :id g :node " + B + ")")),
        plan(root(A), floating(B)),
        "inside a contingency",
    ),
    Case(
        "W033",
        root(
            task("a", ":duration (10 20)"),
            task("b", ":end-temporal-conditions ((a end (-9 -5)))"),
            kind="concurrent-block",
        ),
        root(
            task("a", ":duration (10 20)"),
            task("b", ":end-temporal-conditions ((a end (5 9)))"),
            kind="concurrent-block",
        ),
        "cannot be executed for all durations that the rover may take for a",
    ),
    Case(
        "W033",
        root(task("a", ":duration (10 20)"), task("b", ":start-temporal-conditions ((15 18))")),
        root(task("a", ":duration (10 20)"), task("b", ":start-temporal-conditions ((15 20))")),
        "cannot be executed",
    ),
    Case(
        "W034",
        root(
            branch(option("o", task("a", ":duration (6 9)"))),
            branch(option("q", task("b", ":duration (6 9)"))).replace("br ", "b2 "),
            fields=":duration (0 10)",
        ),
        root(
            branch(option("o", task("a", ":duration (4 9)"))),
            branch(option("q", task("b", ":duration (6 9)"))).replace("br ", "b2 "),
            fields=":duration (0 10)",
        ),
        "with options o, q is inconsistent by 2 s",
    ),
    Case(
        "W064",
        plan(root(task("a", ":expectations ((energy -50 10))")), ARM + " :metadata (soc = 80)"),
        plan(root(task("a", ":expectations ((energy -50 5))")), ARM + " :metadata (soc = 80)"),
        "may fall to 10, below its floor 20",
    ),
    Case(
        "W064",
        plan(task("a", ":requires ((energy 5)) :expectations ((energy -9 0))"), ARM),
        plan(task("a", ":requires ((energy 9)) :expectations ((energy -9 0))"), ARM),
        "requires 5 of .energy. and may consume 9",
    ),
    Case(
        "W071",
        root(
            branch(
                option("o", A, ":eligible-conditions ((database (:soc < 5)) (database (:soc > 9)))"),
                option("q", B),
            )
        ),
        root(
            branch(option("o", A, ":utility 1 :eligible-conditions ((database (:soc > 5)))"), option("q", B))
        ),
        "can never be chosen: .* cannot hold",
    ),
    Case(
        "W071",
        root(branch(option("o", A, ":utility 2"), option("q", B, ":utility 1"))),
        root(branch(option("o", A, ":utility ((0 2) (10 0))"), option("q", B, ":utility 1"))),
        "option q: can never be chosen: o is eligible",
    ),
    Case(
        "W072",
        root(branch(option("o", A, f":eligible-conditions ({TRACKED})"))),
        root(branch(option("o", A, f":eligible-conditions ({TRACKED})"), fields=":if-none :skip")),
        "no option is eligible if trackerstate Rock1 is another word",
    ),
    Case(
        "W073",
        task("a", ":start-conditions ((database (:soc < 5)) (database (:soc > 9)))"),
        task("a", ":start-conditions ((database (:soc < 9)) (database (:soc > 5)))"),
        "can never start",
    ),
    Case(
        "W073",
        root(task("a", ":start-conditions ((database (:outcome b = succeeded)))"), B),
        root(B, task("a", ":start-conditions ((database (:outcome b = succeeded)))")),
        "can never start",
    ),
    Case(
        "W073",
        root(task("a", ":end-temporal-conditions ((b start (0 9)))"), B),
        root(A, task("b", ":end-temporal-conditions ((a start (0 99)))")),
        "what waits for it can never start",
    ),
    Case("W081", task("a", ":probability 0"), task("a", ":probability 0.1"), '":probability" is 0'),
    Case(
        "W083",
        task("a", ":expectations ((time 5 -1))"),
        task("a", ":expectations ((time 5 1))"),
        "spread -1 of time is negative",
    ),
    Case(
        "W085",
        task("a", f":wait-for-conditions ({TRACKED})"),
        task("a", f":wait-for-conditions ({TRACKED}) :start-temporal-conditions ((:relative (0 9)))"),
        "may wait to start for ever",
    ),
    Case(
        "W085",
        root(branch(option("o", A), fields=":if-none :wait")),
        root(branch(option("o", A), fields=":if-none :wait :duration (0 60)")),
        "may wait for an option for ever",
    ),
    Case(
        "W086",
        plan(
            root(
                "(block :id x :uses (arm) :node-list (" + task("a", ":uses (mast)") + "))",
                "(block :id y :uses (mast) :node-list (" + task("b", ":uses (arm)") + "))",
                kind="concurrent-block",
            ),
            ARM,
        ),
        plan(
            root(
                "(block :id x :uses (arm) :node-list (" + task("a", ":uses (mast)") + "))",
                "(block :id y :uses (mast) :node-list (" + task("b", ":uses (arm)") + "))",
            ),
            ARM,
        ),
        'x holds "arm" while a in it waits for "mast"; y holds "mast" while b',
    ),
]

DICTIONARY_CASES = [
    Case(
        "E042",
        task("a", ":start-conditions ((known (:socc)))"),
        task("a", ":start-conditions ((known (:soc)))"),
        'unknown key ":socc"',
    ),
    Case(
        "E042",
        task("a", ":start-conditions ((known (:trackerstate)))"),
        task("a", ":start-conditions ((known (:trackerstate x)))"),
        "takes 1 arguments, found 0",
    ),
    Case(
        "E042",
        plan(A, ":resources ((e :consumable :key :joule))"),
        plan(A, ":resources ((e :consumable :key :soc))"),
        'unknown key ":joule"',
    ),
    Case(
        "E043",
        task("a", ":start-conditions ((database (:trackerstate x = gone)))"),
        task("a", ":start-conditions ((database (:trackerstate x = lost)))"),
        "needs one of tracked, lost",
    ),
    Case(
        "E043",
        task("a", ":start-conditions ((database (:soc = 200)))"),
        task("a", ":start-conditions ((database (:soc < 200)))"),
        "at most 100",
    ),
    Case(
        "E043",
        task("a", ":start-conditions ((database (:sun = 1)))"),
        task("a", ":start-conditions ((database (:sun = t)))"),
        "needs t or nil",
    ),
    Case("E050", "(task :id a :action imagge)", A, 'task a: unknown action "imagge"'),
    Case(
        "E051",
        task("a", ":parameters (kamera=navcam)"),
        task("a", ":parameters (camera=navcam)"),
        'no parameter "kamera"',
    ),
    Case(
        "E051",
        "(task :id a :action wait)",
        "(task :id a :action wait :parameters (duration_s=5))",
        'needs the parameter "duration_s"',
    ),
    Case(
        "E051",
        "(task :id a :action go :parameters (x=5))",
        "(task :id a :action go :parameters (x=5 y=6))",
        "needs target or x with y",
    ),
    Case(
        "E052",
        "(task :id a :action wait :parameters (duration_s=601))",
        "(task :id a :action wait :parameters (duration_s=600))",
        "at most 600 s, found 601",
    ),
    Case(
        "E052",
        task("a", ":parameters (camera=eye)"),
        task("a", ":parameters (camera=hazcam)"),
        "needs one of navcam, hazcam",
    ),
    Case(
        "E052",
        "(task :id a :action go :parameters (target=T track=1))",
        "(task :id a :action go :parameters (target=T track=t))",
        "needs t or nil",
    ),
]


def codes(text: str, **options: object) -> set[str]:
    return {f.code for f in check(text, **options).findings}  # type: ignore[arg-type]


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c.code}-{c.message[:24]}")
def test_code_is_reported_where_it_should_and_only_there(case: Case) -> None:
    found = [f for f in check(case.bad).findings if f.code == case.code]
    assert found, check(case.bad).findings
    assert any(re.search(case.message, f.message) for f in found), found
    for finding in found:
        assert finding.line >= 1
        assert finding.column >= 1
        assert finding.severity is (Severity.WARNING if case.code.startswith("W") else Severity.ERROR)
    if case.node:
        assert case.node in {f.node for f in found}
    assert case.code not in codes(case.good), check(case.good).findings


@pytest.mark.parametrize("case", DICTIONARY_CASES, ids=lambda c: f"{c.code}-{c.message[:24]}")
def test_dictionary_codes_need_a_dictionary(case: Case) -> None:
    given = {"commands": COMMANDS, "telemetry": TELEMETRY}
    found = [f for f in check(case.bad, **given).findings if f.code == case.code]  # type: ignore[arg-type]
    assert any(re.search(case.message, f.message) for f in found), found
    assert case.code not in codes(case.good, **given)
    assert case.code not in codes(case.bad)


def test_every_code_of_the_specification_has_a_case() -> None:
    specified = [
        "E001",
        "E002",
        "E003",
        "E004",
        "E010",
        "E011",
        "E012",
        "E013",
        "E014",
        "E015",
        "E016",
        "E017",
        "E018",
        "E020",
        "E021",
        "E022",
        "E023",
        "E024",
        "E025",
        "E026",
        "E027",
        "E030",
        "E031",
        "E032",
        "E040",
        "E041",
        "E042",
        "E043",
        "E050",
        "E051",
        "E052",
        "E060",
        "E061",
        "E062",
        "E063",
        "E070",
        "E080",
        "E082",
        "E084",
        "E100",
        "E101",
        "E102",
        "W033",
        "W034",
        "W064",
        "W071",
        "W072",
        "W073",
        "W081",
        "W083",
        "W085",
        "W086",
    ]
    assert {c.code for c in CASES + DICTIONARY_CASES} >= set(specified)


def test_all_findings_are_reported_in_the_order_of_the_text() -> None:
    text = """(block :id root :start-temporal-conditions ((5 4)) :node-list
      ((task :id a :action image :retries two :probability 7)
       (task :id a :action image :uses (arm) :start-temporal-conditions ((zz end (0 1))))
       (blok :id c :node-list ((task :id d)))))"""
    report = check(text)
    assert [f.code for f in report.findings] == [
        "E030",
        "E014",
        "E080",
        "E015",
        "E060",
        "E020",
        "E010",
        "E013",
    ]
    assert [(f.line, f.column) for f in report.findings][:3] == [(1, 45), (2, 43), (2, 60)]


def test_a_form_that_cannot_be_read_gives_no_echo() -> None:
    # `b` exists in the text, so a reference to it is not reported as unknown.
    text = root("(tsk :id b :action image)", task("c", after("b")))
    assert codes(text) == {"E010"}


def test_contradiction_names_one_cycle_and_its_deficit() -> None:
    text = """(block :id root :end-temporal-conditions ((0 20)) :node-list
 ((task :id a :action image :duration (15 30))
  (task :id b :action image :duration (10 20))
  (task :id c :action image)))"""
    (finding,) = check(text).findings
    assert finding.code == "E031"
    assert (finding.node, finding.line) == ("a", 2)
    assert finding.message.startswith("task a: the temporal network is inconsistent by 5 s: ")
    links = finding.message.split("5 s: ")[1].split("; ")
    assert links[1] == "end(a) >= start(a) + 15 (:duration (15 30) of task a, line 2)"
    assert links[2] == "start(b) >= end(a) (b follows in its block)"
    assert links[-1] == "end(root) <= 0 + 20 (:end-temporal-conditions (0 20) of block root, line 1)"
    assert len(links) == 6


def test_depth_and_number_of_nodes_are_limited() -> None:
    deep = A
    for level in range(200):
        deep = f"(block :id b{level} :node-list ({deep}))"
    assert codes(deep) == {"E090"}
    assert codes(deep[len("(block :id b199 :node-list (") : -2]) == set()
    condition = TRACKED
    for _ in range(250):
        condition = f"(not {condition})"
    assert "E090" in codes(task("a", f":start-conditions ({condition})"))


@pytest.mark.slow
def test_more_than_100000_nodes_are_refused() -> None:
    many = " ".join(f"(task :id t{i} :action x)" for i in range(100_000))
    report = check(f"(block :id root :node-list ({many}))")
    assert [f.code for f in report.findings] == ["E090"]


def test_resource_envelope_follows_each_path_and_adds_variances() -> None:
    def day(spread: str, level: int) -> str:
        options = branch(
            option(
                "far",
                task("x", f":expectations ((energy -40 {spread}))"),
                ":utility 2 :requires ((energy 1))",
            ),
            option("near", task("y", ":expectations ((energy -5 0))")),
        )
        charge = task("c", ":expectations ((energy 30 0))")
        first = task("a", f":expectations ((energy -10 {spread}))")
        return plan(root(first, options, charge), ARM + f" :metadata (soc = {level})")

    # 80 - 50 - 2 * sqrt(3^2 + 4^2) = 20 is not below the floor of 20; 79 is.
    assert "W064" not in codes(day("3", 79).replace("-40 3", "-40 4").replace("soc = 79", "soc = 80"))
    report = check(day("3", 79).replace("-40 3", "-40 4"))
    (finding,) = [f for f in report.findings if f.code == "W064"]
    assert finding.node == "x"
    assert "by way of far" in finding.message
    assert "may fall to 19," in finding.message
    variance = day("9", 79).replace("-40 9", "-40 16").replace(":id p", ":id p :expectation-spread :variance")
    assert "may fall to 19," in str(check(variance).findings)
    assert "W064" in {f.code for f in check(day("0", 90), levels={"soc": 65}).findings}


def test_dominance_needs_implied_eligibility() -> None:
    wide = ":eligible-conditions ((database (:soc > 5)))"
    narrow = ":eligible-conditions ((database (:soc > 50)))"
    assert "W071" in codes(
        root(branch(option("o", A, wide + ":utility 2"), option("q", B, narrow + ":utility 1")))
    )
    assert "W071" not in codes(root(branch(option("o", A, narrow + ":utility 2"), option("q", B, wide))))
    both = branch(
        option("o", A, ":utility 2"), option("q", B, ":utility 1"), fields=":on-option-failure :next"
    )
    assert "W071" not in codes(root(both))


def test_options_that_cover_every_case_are_exhaustive() -> None:
    low, high, none = (
        ":eligible-conditions ((database (:soc < 50)))",
        ":eligible-conditions ((database (:soc >= 50)))",
        ":eligible-conditions ((not (known (:soc))))",
    )
    assert "W072" not in codes(root(branch(option("o", A, low), option("q", B, high), option("r", C, none))))
    report = check(root(branch(option("o", A, low), option("q", B, high))))
    assert "no option is eligible if soc is unknown" in str(report.findings)


@pytest.mark.parametrize(
    ("start", "maintain"),
    [(":m = 1", ":m = 2"), (":m > 5", ":m < 3"), (":outcome a = succeeded", ":outcome a = failed")],
)
def test_start_and_maintain_conditions_that_exclude_each_other_never_let_a_node_start(
    start: str, maintain: str
) -> None:
    second = f":start-conditions ((database ({start}))) :maintain-conditions ((database ({maintain})))"
    report = check(root(A, f"(task :id b :action image {second})"))
    assert [(f.code, f.node) for f in report.findings] == [("W073", "b")]


FAILED = "((database (:outcome a = failed)))"


@pytest.mark.parametrize(
    ("first", "expected"),
    [
        ("(task :id a :action image)", {"W073"}),
        ("(task :id a :action image :continue-on-failure t)", set()),
        ("(block :id c :node-list ((task :id a :action image)))", {"W073"}),
        ("(block :id c :continue-on-failure t :node-list ((task :id a :action image)))", set()),
        ("(block :id c :node-list ((task :id a :action image :continue-on-failure t)))", set()),
        (
            "(branch :id c :on-option-failure :next :options ((option :id o :node (task :id a :action image))"
            " (option :id q :node (task :id d :action image))))",
            set(),
        ),
    ],
)
def test_what_follows_a_fatal_failure_in_a_block_never_starts_because_of_it(
    first: str, expected: set[str]
) -> None:
    assert codes(root(first, f"(task :id b :action image :start-conditions {FAILED})")) == expected


def test_the_outcome_of_what_precedes_a_branch_in_a_block_is_known() -> None:
    either = branch(
        option("o", B, ":eligible-conditions ((database (:outcome a = succeeded)))"),
        option("q", C, ":eligible-conditions ((database (:outcome a /= succeeded)))"),
    )
    first = "(task :id a :action image :continue-on-failure t)"
    assert "W072" not in codes(root(first, either))
    beside = f"(concurrent-block :id r :node-list ({first} {either}))"
    assert "W072" in codes(beside)


def test_a_built_plan_is_checked_like_a_read_one() -> None:
    condition = Comparison("soc", (), Operator.LT, "high")
    nodes = (
        Task(id="a b", action="image"),
        Task(id="a", action="", retries=-1, probability=2),
        Task(id="a", action="x", start_conditions=(condition,), expectations=(Expectation("time", 1, -1),)),
    )
    found = {f.code for f in validate(Plan(node=Block(id="", node_list=nodes)))}
    assert found == {"E013", "E014", "E015", "E041", "E080", "E084", "W073", "W083"}
    empty = Option(id="o", node=Task(id="a", action="x"), utility=UtilityTable(()))
    from executive.crl.nodes import Branch

    assert "E070" in {f.code for f in validate(Plan(node=Branch(id="b", options=(empty,))))}
    assert "E017" in {f.code for f in validate(Plan(node=Branch(id="b", options=())))}


def test_findings_hold_places_even_without_text() -> None:
    (finding,) = validate(Plan(node=Task(id="a", action="x", probability=2)))
    assert (finding.line, finding.column) == (0, 0)
    assert str(finding).startswith("error E080")


def test_load_raises_with_all_findings() -> None:
    with pytest.raises(CrlValidationError, match=r"E014.*and 1 more") as caught:
        load(task("a", ":retries two :probability 7"))
    assert [f.code for f in caught.value.findings] == ["E014", "E080"]
    assert load(A) == parse(A)


def test_findings_turn_into_json() -> None:
    finding = check(task("a", ":probability 7")).findings[0]
    assert finding.to_json() == {
        "code": "E080",
        "severity": "error",
        "message": 'task a: ":probability" must lie in 0 .. 1, found "7"',
        "node": "a",
        "line": 1,
        "column": 40,
    }
    assert isinstance(finding, Finding)


def test_every_field_has_a_reader() -> None:
    assert sum(len(form.fields) for form in FORMS.values()) == 17 * 4 + 6 + 1 + 1 + 3 + 8 + 10 + 7 + 12


def test_a_reference_into_an_option_is_tried_with_that_option() -> None:
    # No upper bound anywhere: only the reference closes the cycle, and only when the option is taken.
    text = root(
        task("m", after("x", "end", "(-1 :plus-infinity)")),
        branch(option("o", task("x", ":duration (10 20)"))),
    )
    (finding,) = [f for f in check(text).findings if f.code == "E031"]
    assert "with option o is inconsistent by 9 s" in finding.message
