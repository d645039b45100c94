"""A planning job that is cancelled keeps the best plan it had."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from ground.day.worksite import Worksite
from ground.jobs.queue import WorkStoppedError
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
