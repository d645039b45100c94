"""The front end: what a source stands for, and what is refused; the page of patterns, run as it stands."""

from __future__ import annotations

import json
import re
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from executive.crl import canonical_text, check, parse
from executive.crl.expand import expand_items
from executive.runtime.scenario import parse_scenario, run_scenario
from ground.cli.crl import crl_app

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "crl-patterns.md"
EXAMPLES = re.findall(r"## ([^\n]+)\n.*?```lisp\n(.*?)```\n\n```json\n(.*?)```", PAGE.read_text(), re.DOTALL)


def plain(source: str) -> str:
    """Return the canonical text of a source that must be valid."""
    report = check(source, front=expand_items)
    assert report.plan is not None
    assert report.valid, [str(finding) for finding in report.findings]
    return canonical_text(report.plan)


def refusal(source: str, **options: int) -> tuple[str, int, str]:
    """Return code, line and message of the one finding that ends an expansion."""
    report = check(source, front=partial(expand_items, **options))
    (finding,) = report.findings
    assert report.plan is None
    return finding.code, finding.line, finding.message


@pytest.mark.parametrize(("title", "source", "world"), EXAMPLES, ids=[e[0] for e in EXAMPLES])
def test_a_pattern_of_the_page_runs_as_the_page_says(title: str, source: str, world: str) -> None:
    document = json.loads(world)
    trace = document.pop("trace")
    scenario = parse_scenario({"plan": plain(source), "world": document, "expect": {"events": trace}}, title)
    assert run_scenario(scenario).differences == ()


def test_every_pattern_of_the_page_is_run() -> None:
    assert len(EXAMPLES) == PAGE.read_text().count("```lisp") >= 15


SOURCE = """(!constant speed 0.1)
(!macro visit ((rock symbol) (metres number) (tries integer 2) (guard conditions nil))
  (task :id (!name go ?rock) :action navigate :duration (0 (!* 1.5 (!div ?metres ?speed)))
        :retries (!- ?tries 1) :maintain-conditions ((database (:tilt < 0.3)) ?guard))
  (!repeat (i 1 ?tries) (task :id (!name shot ?rock ?i) :action image :parameters (target=?rock n=?i))))
(block :id root :node-list
  ((!use visit :rock r1 :metres 20)
   (!each (rock r2 r3) (!use visit :rock ?rock :metres 10 :tries 1 :guard ((database (:soc > 20)))))))
"""


def test_macros_repetition_and_arithmetic_leave_plain_crl() -> None:
    assert plain(SOURCE) == canonical_text(
        parse(
            """(block :id root :node-list (
            (task :id go-r1 :action navigate :duration (0 300) :retries 1
              :maintain-conditions ((database (:tilt < 0.3))))
            (task :id shot-r1-1 :action image :parameters (target=r1 n=1))
            (task :id shot-r1-2 :action image :parameters (target=r1 n=2))
            (task :id go-r2 :action navigate :duration (0 150)
              :maintain-conditions ((database (:tilt < 0.3)) (database (:soc > 20))))
            (task :id shot-r2-1 :action image :parameters (target=r2 n=1))
            (task :id go-r3 :action navigate :duration (0 150)
              :maintain-conditions ((database (:tilt < 0.3)) (database (:soc > 20))))
            (task :id shot-r3-1 :action image :parameters (target=r3 n=1))))"""
        )
    )


def test_a_finding_points_to_the_line_of_the_macro() -> None:
    report = check(SOURCE.replace("(:tilt < 0.3)", "(:tilt < low)"), front=expand_items)
    assert {(f.code, f.line, f.node) for f in report.errors} == {
        ("E041", 4, "go-r1"),
        ("E041", 4, "go-r2"),
        ("E041", 4, "go-r3"),
    }


TASK = "(task :id a :action x)"


@pytest.mark.parametrize(
    ("source", "code", "line", "words"),
    [
        (f"(!macro m () (!use m))\n{TASK}\n", "", 0, ""),
        ("(!macro m () (!use n))\n(!macro n () (!use m))\n(!use m)", "E204", 2, "m -> n -> m"),
        ("(!macro m ((n number)) (task :id a :action x :retries ?n))\n(!use m :n two)", "E203", 2, '"two"'),
        ("(!macro m ((n integer)) (task :id a :action x))\n(!use m :n 1.5)", "E203", 2, "integer"),
        ("(!macro m ((k node)) ?k)\n(!use m :k (option))", "E203", 2, "node"),
        ("(!macro m ((n number)) (task :id a :action x))\n(!use m)", "E202", 2, '"n" is missing'),
        ("(!macro m () (task :id a :action x))\n(!use m :n 1)", "E202", 2, 'no parameter "n"'),
        ("(!macro m ((n value)) (task :id ?n :action x))\n(!use m :n 1 :n 2)", "E202", 2, "twice"),
        ("(!use visitt)", "E201", 1, '"visitt"'),
        ("(task :id ?a :action x)", "E201", 1, '"?a"'),
        ("(!whatever 1)", "E201", 1, '"!whatever"'),
        ("(block :id r :node-list ((!repeat (i 1 :plus-infinity) (task :id ?i))))", "E205", 1, "whole"),
        ("(block :id r :node-list ((!repeat (i 1 5 0) (task :id ?i))))", "E205", 1, "first last"),
        ("(block :id r :node-list ((!repeat (i 1) (task :id ?i))))", "E205", 1, "first last"),
        ("(task :id a :action x :retries (!div 1 0))", "E207", 1, "(!div 1 0)"),
        ("(task :id a :action x :retries (!+ 1 b))", "E207", 1, "numbers"),
        ("(task :id a :action x :retries (!min))", "E207", 1, "(!min"),
        ("(!constant a 1)\n(!constant a 2)\n(task :id a :action x)", "E200", 2, "twice"),
        ("(task :id a :action (!each (x b c) ?x))", "E200", 1, '":action"'),
        ("(block :id r :node-list ((!macro m () 1)))", "E200", 1, "before the plan"),
        ("(" * 400 + ")" * 400, "E206", 1, "300"),
        ("(block :id r :node-list ((!repeat (i 1 1000000000) (!each (j) ?j))))", "E206", 1, "1,000,000"),
    ],
)
def test_what_is_wrong_is_refused_at_its_place(source: str, code: str, line: int, words: str) -> None:
    if not code:  # a macro that nobody uses is never expanded
        assert plain(source) == canonical_text(parse(TASK))
        return
    found, at, message = refusal(source)
    assert (found, at) == (code, line)
    assert words in message


def test_an_expansion_that_multiplies_is_stopped_at_the_limit_that_is_named() -> None:
    macros = "\n".join(f"(!macro m{n} () (!repeat (i 1 10) (!use m{n + 1})))" for n in range(9))
    code, _, message = refusal(
        f"{macros}\n(!macro m9 () x)\n(block :id r :node-list ((!use m0)))", limit=20_000
    )
    assert code == "E206"
    assert "20,000" in message


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(-50, 50), min_size=1, max_size=6), st.integers(1, 9))
def test_arithmetic_and_repetition_agree_with_python(numbers: list[int], count: int) -> None:
    total = " ".join(map(str, numbers))
    source = (
        f"(block :id r :node-list ((!repeat (i 1 {count}) (task :id (!name t ?i) :action x "
        f":parameters (a = (!+ {total} ?i) b = (!max {total}) c = (!- 0 (!* 2 ?i)))))))"
    )
    tasks = [
        f"(task :id t-{i} :action x :parameters (a={sum(numbers) + i} b={max(numbers)} c={-2 * i}))"
        for i in range(1, count + 1)
    ]
    assert plain(source) == canonical_text(parse(f"(block :id r :node-list ({' '.join(tasks)}))"))


def test_the_command_prints_the_canonical_plan_and_shows_findings_in_the_source(tmp_path: Path) -> None:
    file = tmp_path / "plan.crl"
    file.write_text(SOURCE)
    shown = CliRunner().invoke(crl_app, ["expand", str(file)])
    assert shown.exit_code == 0
    assert shown.stdout.strip() == plain(SOURCE)
    file.write_text(SOURCE.replace("?guard))", "(database (:soc > low))))"))
    shown = CliRunner().invoke(crl_app, ["expand", str(file)])
    assert shown.exit_code == 1
    assert f"{file}:4:" in shown.stderr
    assert "E041" in shown.stderr


def nested(head: str, count: int, inner: str = "1") -> str:
    return f"({head} " * count + inner + ")" * count


DEEP = {
    "arithmetic": f"(task :id a :action x :retries {nested('!max', 299)})",
    "each": "(block :id r :node-list (" + "(!each (y " * 145 + "b" + ") ?y)" * 145 + "))",
    "constants": "(!constant c0 x)\n"
    + "\n".join(f"(!constant c{n} {nested('', 250, f'?c{n - 1}')})" for n in range(1, 9))
    + "\n(task :id ?c8 :action x)",
    "macros": "".join(f"(!macro m{n} () (!use m{n + 1}))\n" for n in range(400))
    + "(!macro m400 () x)\n(task :id (!use m0) :action x)",
}


@pytest.mark.parametrize("name", DEEP)
def test_what_is_nested_too_deep_is_refused_however_deep_the_caller_stands(name: str) -> None:
    def findings(frames: int) -> list[tuple[str, str]]:
        if frames:
            return findings(frames - 1)
        return [(f.code, f.message) for f in check(DEEP[name], front=expand_items).findings]

    for frames in (0, 100, 500):
        found = [(code, text) for code, text in findings(frames) if code == "E206"]
        assert len(found) <= 1
        assert all("nested" in text and len(text) < 200 for _, text in found)
        assert found or (frames < 500 and name in ("arithmetic", "each"))


def test_names_that_grow_are_charged_by_their_letters() -> None:
    source = f'(!constant s0 "{"a" * 1000}")\n'
    source += "\n".join(f"(!constant s{n} (!name {f'?s{n - 1} ' * 1000}))" for n in range(1, 4))
    code, line, message = refusal(source + "\n(task :id ?s3 :action x)")
    assert (code, line) == ("E206", 3)
    assert "1,000,000" in message
