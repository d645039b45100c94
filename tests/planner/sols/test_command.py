"""`outcrop plan --sols`: files, and what is refused in one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ground.cli.main import app, register_all
from tests.planner.examples import observation, problem_document

register_all()


@pytest.fixture
def problem(tmp_path: Path) -> Path:
    file = tmp_path / "problem.json"
    rows = [[observation(f"O{k}", "image")] for k in (1, 2, 3)]
    file.write_text(json.dumps(problem_document(observations=rows)), encoding="utf-8")
    return file


def test_a_path_is_written_beside_the_plan_of_its_first_sol(problem: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = CliRunner().invoke(
        app, ["plan", str(problem), "--out", str(out), "--sols", "2", "--time-limit", "1"]
    )
    assert done.exit_code == 0, done.output
    path = json.loads((out / "sol_path.json").read_text(encoding="utf-8"))
    assert path["mean"] <= path["upper"] + 3.0 * path["standard_error"]
    assert (out / "plan.crl").is_file()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--sols", "0"), "--sols"),
        (("--sols", "2", "--strategy", "pico2005"), "--strategy: not for several sols"),
        (
            ("--sols", "2", "--iterations", "5", "--least-taken", "0.1"),
            "--iterations, --least-taken: not for several sols",
        ),
    ],
)
def test_what_does_not_go_with_several_sols_is_refused(
    problem: Path, tmp_path: Path, options: tuple[str, ...], said: str
) -> None:
    done = CliRunner().invoke(app, ["plan", str(problem), "--out", str(tmp_path / "out"), *options])
    assert done.exit_code == 2
    assert said.removeprefix("--sols") in done.output
    assert len(done.output.strip().splitlines()) == 1


def test_an_older_plan_does_not_stay_where_the_first_sol_has_none(problem: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    asked = ["--out", str(out), "--sols", "2", "--time-limit", "1"]
    assert CliRunner().invoke(app, ["plan", str(problem), *asked]).exit_code == 0
    document = json.loads(problem.read_text(encoding="utf-8"))
    for target in document["targets"]:
        target["observations"][0]["utility"] = 0.0
    problem.write_text(json.dumps(document), encoding="utf-8")
    done = CliRunner().invoke(app, ["plan", str(problem), *asked])
    assert done.exit_code == 0, done.output
    assert [file.name for file in out.iterdir()] == ["sol_path.json"]
    assert "sol 1 has nothing to do: no plan was written" in done.output


def test_an_older_plan_does_not_stay_where_a_day_has_none(problem: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    asked = ["plan", str(problem), "--out", str(out), "--time-limit", "1"]
    assert CliRunner().invoke(app, asked).exit_code == 0
    document = json.loads(problem.read_text(encoding="utf-8"))
    document["targets"][0]["observations"][0]["must_do"] = True
    document["budget"]["time_s"] = 10.0
    problem.write_text(json.dumps(document), encoding="utf-8")
    assert CliRunner().invoke(app, asked).exit_code == 3
    assert [file.name for file in out.iterdir()] == ["summary.json"]


def test_a_path_that_was_stopped_before_a_plan_ends_with_status_4(
    problem: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ground.cli.terminal.Interrupt.wanted", lambda self: True)
    done = CliRunner().invoke(app, ["plan", str(problem), "--out", str(tmp_path / "out"), "--sols", "2"])
    assert done.exit_code == 4, done.output
    assert (tmp_path / "out" / "sol_path.json").is_file()
