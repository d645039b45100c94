"""A planning job that is cancelled keeps the best plan it had."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from ground.day.worksite import Worksite
from ground.jobs.queue import WorkStoppedError
from ground.resources.plans import draft
from ground.resources.plans import work as plan_work
from ground.resources.plans.order import PlanWork, Search
from mission import Day, Limits, Pose
from planner.plan_tree import plan_tree_from_dict, planned_observations
from planner.problem import load_problem, problem_from_dict
from tests.planner.examples import problem_document
from tests.shared import shared

SEARCH = Search("optimal", 6, 600.0, None, 1)
ORDER = PlanWork(Worksite("mis_1", "", "k9"), Day("d", Pose(0.0, 0.0), Limits(1.0, 1.0)), "pln_1", SEARCH)


@pytest.fixture
def day(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Let the work find this day instead of preparing one on terrain."""
    found = SimpleNamespace(problem={}, refused=())
    monkeypatch.setattr(Worksite, "prepare", lambda site, day, report: found)
    monkeypatch.setattr(plan_work, "network_geometry", lambda day: {})
    monkeypatch.setattr(plan_work, "observation_points", lambda day: {})
    return found


def _work(stop_at: str) -> tuple[dict[str, Any], list[str]]:
    """Do the work, asked to stop once a report holds a text."""
    heard: list[str] = []

    def should_stop() -> bool:
        return any(stop_at in text for text in heard)

    return plan_work.work(ORDER, lambda share, text: heard.append(text), should_stop), heard


def test_a_cancelled_plan_is_the_best_so_far_and_says_so(day: SimpleNamespace) -> None:
    problem = load_problem(shared("contingency/instances/dev-reserve-5.json"))
    day.problem = problem
    result, heard = _work("branching")
    told = [float(text.split()[1].rstrip(",")) for text in heard if text.startswith("branching")]
    assert result["status"] == "planned"
    assert "stopped" in result["stopped"]
    assert result["summary"]["stopped"] is True
    assert result["expected_utility"] >= max(told) * 0.98
    assert result["lower"] <= result["expected_utility"] <= result["upper"] < 1.2 * result["expected_utility"]
    tree = plan_tree_from_dict(result["tree"], problem)
    assert {str(o) for o in planned_observations(tree.plan)} == set(result["planned_request_ids"])
    assert result["crl_text"]


def test_each_better_plan_can_be_looked_at_while_the_search_goes_on(
    day: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(draft, "network_geometry", lambda day: {"nodes": []})
    day.problem = problem = problem_from_dict(
        problem_document(places=[(4.0, 1.0), (-3.0, 2.0), (6.0, -5.0), (-8.0, -4.0)])
    )
    place = tmp_path / "plan-draft.json"
    seen: dict[int, dict[str, Any]] = {}

    def look(_share: float, _text: str) -> None:
        if place.exists():
            found = json.loads(place.read_text())
            seen.setdefault(found["number"], found)

    search = replace(SEARCH, iterations=20)
    result = plan_work.work(replace(ORDER, search=search, draft=str(place)), look, lambda: False)
    assert list(seen) == list(range(1, len(seen) + 1)), "every one was there when it was told of"
    assert len(seen) > 1
    for found in seen.values():
        assert found["format"] == "plan-draft/1"
        tree = plan_tree_from_dict(found["tree"], problem)
        assert planned_observations(tree.plan)
        assert any(step.get("p_reached") for step in found["tree"]["plan"]), (
            "odds and times are there to be drawn"
        )
        assert found["value"] <= result["upper"] + 1e-6
    assert max(found["value"] for found in seen.values()) >= 0.95 * result["expected_utility"]


def test_a_plan_that_ended_by_itself_is_not_marked(day: SimpleNamespace) -> None:
    day.problem = problem_from_dict(problem_document(places=[(4.0, 1.0)]))
    result, _ = _work("never said")
    assert result["stopped"] == ""
    assert result["summary"]["stopped"] is False


def test_cancelled_before_there_is_a_plan_there_is_none(day: SimpleNamespace) -> None:
    day.problem = problem_from_dict(problem_document(time_s=60.0))
    assert day.problem.observations
    with pytest.raises(WorkStoppedError):
        _work("reading")
