"""What stands in exported files, what is told to be left out, and what is refused."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner
from unified_planning.io import ANMLReader, PDDLReader

from ground.cli.plan import register
from ground.extras import missing_extra
from neighbours.planning.documents import Language, problem_text
from neighbours.planning.errors import PlanningFormatError
from neighbours.planning.model import Metric, foreign_problem
from neighbours.planning.plan_back import plan_of_text
from planner.plan_tree import Navigate, Observe, OnFail
from planner.problem import Amount, Problem, problem_from_dict
from tests.planner.examples import amount, example, observation, problem_document

SKIP = OnFail.SKIP
app = typer.Typer()
app.callback()(lambda: None)
register(app)


def exact() -> Problem:
    """Return a problem in whole numbers in which nothing is by chance."""
    rows = [
        [observation(f"O{k}", observe={"time_s": amount(300.0), "energy_j": amount(9000.0)})] for k in (1, 2)
    ]
    document = problem_document(places=[(3.0, 4.0), (6.0, 8.0)], observations=rows, spread=0.0, loss=0.0)
    for leg in document["legs"]:
        leg["energy_j"]["sd"] = 0.0
    return problem_from_dict(document)


def text(problem: Problem, language: Language = Language.PDDL, *goals: str) -> str:
    return "\n".join(content for _, content in problem_text(problem, language, goals).files)


def test_what_can_be_said_in_full_has_an_empty_list() -> None:
    assert problem_text(exact(), Language.PDDL).unsaid == ()


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"spread": 0.5}, "uncertain times and energies"),
        ({"loss": 0.2}, "tracks may be lost on the way"),
        ({"overrun_penalty": 7.0}, "the penalty of 7 for an end over a budget"),
        ({"max_overrun_probability": 0.05}, "the limit of 0.05 on the chance of an end over a budget"),
    ],
)
def test_each_chance_that_is_left_out_is_told_and_stands_in_the_head(
    change: dict[str, Any], told: str
) -> None:
    problem = example(**{"spread": 0.5, **change})
    for language in Language:
        written = problem_text(problem, language)
        assert any(told in str(one) for one in written.unsaid)
        for _, content in written.files:
            assert told in content.partition("\n\n")[0]


def test_values_that_fade_or_fail_and_a_shut_window_are_told() -> None:
    document = problem_document()
    document["targets"][0]["observations"] = [observation("A", p_success=0.5), observation("B")]
    document["targets"][0]["diminishing"] = 0.5
    document["targets"][1]["observations"] = [observation("C", window_s=[-20.0, -10.0])]
    told = {one.where: one.what for one in problem_text(problem_from_dict(document), Language.PDDL).unsaid}
    assert told["observation A"] == "may fail"
    assert told["target T1"] == "further observations are worth less"
    assert told["observation C"] == "may begin at no time of the day"
    assert "(:durative-action observe___c" not in text(problem_from_dict(document))


def test_anml_tells_that_values_are_not_said_and_pddl_says_them() -> None:
    (one,) = problem_text(exact(), Language.ANML).unsaid
    assert one.what == "observations that are worth something and may be left out"
    assert "(:metric maximize (utility))" in text(exact())
    assert problem_text(exact(), Language.ANML, ["O1", "O2"]).unsaid == ()


def test_both_texts_are_read_back_as_the_same_actions() -> None:
    problem = example()
    pddl = dict(problem_text(problem, Language.PDDL, ["O1"]).files)
    names = {a.name for a in foreign_problem(problem, ["O1"], Metric.NONE).actions}
    read = PDDLReader().parse_problem_string(pddl["domain.pddl"], pddl["problem.pddl"])
    assert {a.name for a in read.actions} == names
    read = ANMLReader().parse_problem_string(text(problem, Language.ANML, "O1"))
    assert {a.name for a in read.actions} == names
    assert [str(goal) for goal in read.goals] == ["done___o1"]


def test_must_do_is_a_goal() -> None:
    document = problem_document()
    document["targets"][1]["observations"][0]["must_do"] = True
    made = foreign_problem(problem_from_dict(document))
    assert [str(goal) for goal in made.goals] == ["done___o2"]


def test_names_that_are_no_identifiers_of_pddl_are_read_back() -> None:
    names = ["and", "Röck-1", "ROCK", "rock", "9", "a__b", "石"]
    document = problem_document(
        places=[(1.0 + k, 0.0) for k in range(len(names))],
        observations=[[observation(f"over {name}".replace(" ", "_"))] for name in names],
    )
    new = {f"T{k + 1}": name for k, name in enumerate(names)}
    for target in document["targets"]:
        target["id"] = new[target["id"]]
    for leg in document["legs"]:
        leg["from"], leg["to"] = new.get(leg["from"], leg["from"]), new[leg["to"]]
        leg["p_lose"] = {}
    document["name"] = "two\nlines; (and) 石"
    problem = problem_from_dict(document)
    for language in Language:
        found = text(problem, language)
        assert found.isascii()
    read = PDDLReader().parse_problem_string(
        *(content for _, content in problem_text(problem, Language.PDDL).files)
    )
    lines = "".join(f"({a.name})\n" for a in read.actions if a.name.startswith("observe"))
    plan = plan_of_text(lines, problem)
    assert {step.target for step in plan if isinstance(step, Observe)} == set(names)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"hotel_w": math.nan}, "hotel_w is nan"),
        ({"track_start_time_s": math.inf}, "track_start: time_s is inf"),
    ],
)
def test_numbers_that_are_none_are_named(change: dict[str, Any], message: str) -> None:
    with pytest.raises(PlanningFormatError, match=message):
        problem_text(replace(example(), **change), Language.PDDL)


def test_nan_in_a_leg_is_named() -> None:
    problem = exact()
    bad = replace(problem.legs[0], time_s=Amount(math.nan))
    with pytest.raises(PlanningFormatError, match="leg start -> T1: time_s is nan"):
        problem_text(replace(problem, legs=(bad, *problem.legs[1:])), Language.PDDL)


def test_too_many_targets_and_unknown_goals_are_refused() -> None:
    document = problem_document(places=[(1.0 + k, 0.0) for k in range(61)])
    document["legs"] = document["legs"][:1]
    with pytest.raises(PlanningFormatError, match="problem has 61 targets; at most 60"):
        problem_text(problem_from_dict(document), Language.PDDL)
    with pytest.raises(PlanningFormatError, match='goal "O9" names no observation'):
        problem_text(example(), Language.PDDL, ["O9"])


def test_plan_text_is_read_by_its_times() -> None:
    plan = "; found\n1500.001: (OBSERVE___O1) [300]\n0.0: (drive__start___t1)[1500.0]\n\n"
    assert plan_of_text(plan, exact()) == (Navigate("T1", False, SKIP), Observe("O1", "T1", SKIP))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("plan", "message"),
    [
        ("0.0: drive", "line 1: .* is not a line of a plan"),
        ("(drive__start___t1)\n1: (observe___o1)", "line 2: only some lines of the plan have a time"),
        ("1: (observe___o1)\n(drive__start___t1)", "line 2: only some lines of the plan have a time"),
        ("0: (fly__t1)", 'action "fly__t1" is not one of the problem example'),
        ("nan: (observe___o1)", "line 1: .* is not a line of a plan"),
    ],
)
def test_what_is_no_plan_of_the_problem_is_refused(plan: str, message: str) -> None:
    with pytest.raises(PlanningFormatError, match=message):
        plan_of_text(plan, exact())


def written(folder: Path, document: dict[str, Any]) -> str:
    (folder / "problem.json").write_text(json.dumps(document), encoding="utf-8")
    return str(folder / "problem.json")


def test_command_writes_the_files_and_reads_a_plan(tmp_path: Path) -> None:
    file = written(tmp_path, problem_document())
    result = CliRunner().invoke(app, ["plan", "export-problem", file, "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    assert "not said: " in result.stderr
    assert {p.name for p in (tmp_path / "out").iterdir()} == {"domain.pddl", "problem.pddl"}
    (tmp_path / "plan.txt").write_text("0: (drive__start___t2)\n9: (observe___o2)\n", encoding="utf-8")
    back = ["plan", "read-plan", file, str(tmp_path / "plan.txt"), "--out", str(tmp_path / "back")]
    result = CliRunner().invoke(app, back)
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("1 observations, expected utility 4.")
    assert {p.name for p in (tmp_path / "back").iterdir()} == {"plan.crl", "plan_tree.json"}


def test_command_refuses_in_one_line(tmp_path: Path) -> None:
    document = problem_document()
    document["budget"]["time_s"] = math.nan
    refused = ["plan", "export-problem", written(tmp_path, document), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, refused)
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert "NaN is not a number of JSON" in result.stderr
    refused = ["plan", "export-problem", written(tmp_path, problem_document()), "--goal", "X", "--out", "o"]
    result = CliRunner().invoke(app, refused)
    assert (result.exit_code, result.stderr) == (2, 'outcrop: goal "X" names no observation of the problem\n')
    assert not (tmp_path / "out").exists()


def test_without_the_extra_one_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [n for n in sys.modules if n.startswith(("unified_planning", "neighbours.planning"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "unified_planning", None)
    args = ["plan", "export-problem", written(tmp_path, problem_document()), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, args)
    assert isinstance(result.exception, ModuleNotFoundError)
    told = "this needs the package unified_planning, which is not installed: pip install 'outcrop[formats]'"
    assert missing_extra(result.exception) == told
