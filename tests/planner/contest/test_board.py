"""The board and its commands, with a planner of somebody else."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ground.cli.main import app, register_all
from planner.contest.board import Entry, append, newest, read_board, table
from planner.contest.entrants import ask
from planner.contest.instance import generate
from planner.errors import PlannerError

STRANGER = """
import json, os, sys
told = json.load(sys.stdin)
assert os.environ["OUTCROP_BRANCHES"] == "0" and float(os.environ["OUTCROP_SECONDS"]) == 5
best = max(told["targets"], key=lambda t: t["utility"] * t["p_success"])["id"]
print(json.dumps({"format": "plan-tree/1", "plan": [{"op": "visit", "target": best}]}))
"""


def entry(planner: str, digest: str, value: float, **more: object) -> Entry:
    told = {
        "planner": planner, "instance": digest, "digest": digest, "branches": 1, "max_branches": 6,
        "value": value, "standard_error": 0.0, "futures": 1000, "seed": 1, "upper": 10.0, "overruns": 0.1,
        "cpu_s": 2.0, "version": "", "machine": "", "refused": "", **more,
    }  # fmt: skip
    return Entry(**told)  # type: ignore[arg-type]


def test_a_board_ranks_on_what_all_tried_and_a_later_entry_replaces_an_earlier(tmp_path: Path) -> None:
    board = tmp_path / "board.jsonl"
    for row in (entry("a", "x", 5.0), entry("a", "x", 8.0), entry("b", "x", 9.0), entry("b", "y", 1.0)):
        append(board, row)
    assert [e.value for e in newest(read_board(board))] == [8.0, 9.0, 1.0]
    lines = table(read_board(board)).splitlines()
    assert lines[0].startswith("1 instances")
    assert [line.split(" | ")[0] for line in lines[4:6]] == ["| b", "| a"]
    assert "90.00 | 90.00 | 1.0 | 10.0 | 2.0 | 0 |" in lines[4]
    assert "1 instances that not every planner tried are left out" in lines[-1]


def test_a_damaged_line_of_a_board_is_named(tmp_path: Path) -> None:
    board = tmp_path / "board.jsonl"
    append(board, entry("a", "x", 5.0))
    with board.open("a") as out:
        out.write('{"planner": 1')
    with pytest.raises(PlannerError, match="line 2"):
        read_board(board)


def test_a_program_takes_part_and_its_faults_are_said(tmp_path: Path) -> None:
    program = tmp_path / "stranger.py"
    program.write_text(STRANGER)
    document = generate("mixed", 3, 2)
    answer = ask(f"{sys.executable} {program}", document, 0, 5.0)
    assert len(answer.plan["plan"]) == 1
    assert answer.cpu_s > 0
    for text, says in (
        ("raise SystemExit('no idea')", "no idea"),
        ("print('{')", "no JSON"),
        ("print('[1]')", "not a JSON object"),
    ):
        program.write_text(text)
        with pytest.raises(PlannerError, match=says):
            ask(f"{sys.executable} {program}", document, 0, 5.0)
    with pytest.raises(PlannerError, match="is not a planner here"):
        ask("no-such-planner", document, 0, 5.0)


def test_the_commands_draw_check_and_rank(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    if not app.registered_groups:
        register_all()
    (tmp_path / "stranger.py").write_text(STRANGER)
    call = CliRunner().invoke

    def done(*words: str, status: int = 0) -> str:
        answer = call(app, ["bench", "contingency", *words])
        assert answer.exit_code == status, answer.output
        return answer.output

    done("generate", "drawn", "--count", "2", "--sizes", "3", "--seed", "5")
    files = sorted((tmp_path / "drawn").glob("*.json"))
    assert len(files) == 2
    told = done(
        "run", "drawn", "--planner", "greedy", "--planner", f"{sys.executable} stranger.py",
        "--max-branches", "0", "--time-limit", "5", "--futures", "2000",
    )  # fmt: skip
    assert "2 instances" in told
    board = [json.loads(line) for line in (tmp_path / "board.jsonl").read_text().splitlines()]
    assert [row["refused"] for row in board] == [""] * 4
    (tmp_path / "plan.json").write_text(json.dumps({"format": "plan-tree/1", "plan": []}))
    assert "0.0000 +- 0.0000 over 1000 futures" in done(
        "check", str(files[0]), "plan.json", "--futures", "1000"
    )
    (tmp_path / "plan.json").write_text(
        json.dumps({"format": "plan-tree/1", "plan": [{"op": "visit", "target": "X"}]})
    )
    assert "plan[0].target is 'X'" in done("check", str(files[0]), "plan.json", status=2)
    done("run", status=2)
    done("run", "--generate", "1", "--sizes", "many", status=2)
