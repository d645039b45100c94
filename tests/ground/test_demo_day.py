"""A whole day in one command."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from executive.crl import digest, parse
from ground.campaigns.inputs import expected_utility
from ground.demo.day import loss_to_inject
from tests.shared import ROOT, shared


def _demo(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ground.cli", "demo", "--time-limit", "8", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def _rows(path: Path) -> list[Any]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.mark.slow
def test_demo_runs_a_whole_day_on_generated_terrain(tmp_path: Path) -> None:
    out = tmp_path / "day"
    done = _demo("--seed", "2", "--out", str(out))
    assert done.returncode == 0, done.stderr
    problem = json.loads((out / "problem.json").read_text())
    assert problem["format"] == "problem/2"
    assert sum(len(t["observations"]) for t in problem["targets"]) <= 14
    assert json.loads((out / "plan_tree.json").read_text())["format"] == "plan-tree/2"
    summary = json.loads((out / "summary.json").read_text())
    assert summary["format"] == "plan-summary/1"
    assert expected_utility(out / "plan.crl") == summary["expected_utility"] > 0
    assert summary["crl_sha256"] == digest(parse((out / "plan.crl").read_text()))
    run = json.loads((out / "run.json").read_text())
    assert run["format"] == "run/1"
    assert [f["kind"] for f in run["faults"]] == ["lose-target"]
    trace = _rows(out / "trace.jsonl")
    assert trace[0][1:] == ["start", "root"]
    assert trace[-1][1:3] == ["end", "root"]
    assert (out / "map.png").stat().st_size > 50_000
    for row in _rows(out / "products.jsonl"):
        assert row["label"]["request"].startswith("R")
        assert (out / row["path"]).stat().st_size > 0
    for request in (f"R{k}" for k in range(1, 15)):
        assert f"  {request} " in done.stdout
    lost = {
        s
        for row in _rows(out / "telemetry.jsonl")
        for s, t in row["trackers"].items()
        if t["state"] == "lost"
    }
    assert run["faults"][0]["target"] in lost
    _another_rover_executes_the_package(out, tmp_path / "run")


def _another_rover_executes_the_package(day: Path, out: Path) -> None:
    """The physics engine's rover in the day's own world: the same plan, decided by what that rover meets."""
    flags = ("--rover", "mujoco", "--world", str(day / "world"), "--trust", str(day / "keys/trust.json"))
    command = [
        sys.executable,
        "-m",
        "ground.cli",
        "execute",
        str(day / "package.zip"),
        *flags,
        "--out",
        str(out),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    assert _rows(out / "trace.jsonl")[-1][1:3] == ["end", "root"]
    assert (out / "plan.crl").read_text() == (day / "plan.crl").read_text()
    drives = [row for row in _rows(out / "trace.jsonl") if row[1] == "end" and row[2].startswith("navigate-")]
    assert drives


@pytest.mark.slow
def test_demo_runs_on_curiosity_terrain(tmp_path: Path) -> None:
    folder = shared("data/terrain/msl_onsight/murray_buttes")
    done = _demo("--terrain", str(folder), "--out", str(tmp_path / "day"))
    assert done.returncode == 0, done.stderr
    assert "murray_buttes: 10 targets, 14 observation requests" in done.stdout
    assert _rows(tmp_path / "day/products.jsonl")


def test_demo_refuses_a_folder_that_holds_a_day(tmp_path: Path) -> None:
    (tmp_path / "journal.jsonl").write_text("")
    done = _demo("--out", str(tmp_path))
    assert done.returncode == 2
    assert done.stderr.strip() == (
        f"outcrop: {tmp_path} holds the journal of an earlier day; choose another folder or remove it"
    )


def test_demo_names_a_terrain_that_is_not_there(tmp_path: Path) -> None:
    done = _demo("--terrain", str(tmp_path / "nowhere"), "--out", str(tmp_path / "day"))
    assert done.returncode == 2
    assert "nowhere" in done.stderr
    assert "Traceback" not in done.stderr


def test_loss_strikes_a_target_that_a_branch_asks_about() -> None:
    problem = {
        "track_start": {"time_s": 20.0},
        "legs": [{"from": "start", "to": "T1", "time_s": {"mean": 100.0}}],
    }
    assert loss_to_inject(problem, _tree(_ask("T2"))) == {"kind": "lose-target", "target": "T2", "at_s": 90.0}


def test_loss_strikes_where_its_branch_gains_most() -> None:
    still = _ask("T1", lost=False, gain=9.0)
    tree = _tree(_ask("T1", gain=0.1), still, _ask("T2", gain=1.5), _ask("T1", gain=0.7))
    assert (loss_to_inject({"track_start": {"time_s": 20.0}, "legs": []}, tree) or {})["target"] == "T2"


def _ask(target: str, *, lost: bool = True, gain: float | None = None) -> dict[str, Any]:
    option: dict[str, Any] = {"when": [{"var": "tracked", "target": target, "is": not lost}], "plan": []}
    return option if gain is None else {**option, "gain": gain}


def _tree(*options: dict[str, Any]) -> dict[str, Any]:
    return {
        "plan": [
            {"op": "track_start", "target": "T1"},
            {"op": "track_start", "target": "T2"},
            {"op": "visit", "target": "T1"},
            {"op": "branch", "options": list(options)},
        ]
    }


def test_nothing_is_lost_where_nothing_is_tracked() -> None:
    assert loss_to_inject({"legs": []}, {"plan": [{"op": "visit", "target": "T1"}]}) is None


@pytest.mark.slow
def test_executive_earns_on_curiosity_terrain_what_the_planner_evaluated() -> None:
    from benchmarks.executive_equality import compare
    from ground.day.prepare import prepare_day
    from ground.demo.mission import demo_mission
    from planner.problem import problem_to_dict
    from planner.solve import solve
    from rover_iface.profile import load_profile
    from rover_iface.terrain import load_terrain

    terrain = load_terrain(shared("data/terrain/msl_onsight/murray_buttes"))
    profile = load_profile("k9")
    day = demo_mission(terrain, profile, seed=1)
    problem = prepare_day(terrain, profile, day).problem
    result = solve(problem, max_branches=6, time_limit_s=20.0, seed=1, least_taken=0.02)
    assert result.expected_utility > 60.0
    assert all(notes.p_taken >= 0.02 for notes in result.tree.option_notes.values())
    assert compare(problem_to_dict(problem), result.tree, 200, seed=11) == []
