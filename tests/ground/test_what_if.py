"""What-if: an answer at once that moves the right way, on common futures; and a what-if kept as a plan."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

import pytest

from ground.resources.plans import answer_what_if
from tests.ground.conftest import Api
from tests.ground.planning import PlannedDay, finished
from tests.ground.test_missions_api import problem as problem_of


@pytest.fixture
def planned_day(
    sqlite_planned_day: PlannedDay, monkeypatch: pytest.MonkeyPatch
) -> tuple[Api, str, dict[str, str], dict[str, Any]]:
    """Give a service that was asked nothing of its plan so far: copies of a day have the same plan."""
    for kept in ("_plans", "_rebuilt"):
        monkeypatch.setattr(answer_what_if, kept, OrderedDict())
    day = sqlite_planned_day
    return day.api, day.mission.id, {name: r["id"] for name, r in day.requests.items()}, day.plan


def test_nothing_changed_changes_nothing(planned_day: Any) -> None:
    api, _, _, plan = planned_day
    answer = api.post(f"/plans/{plan['id']}/what-if", {}, status=200)
    assert answer["change"] == 0.0
    assert answer["value_present"] == answer["value_kept"] == answer["value_found"]
    assert answer["value_present"] == pytest.approx(plan["expected_utility"], rel=0.02)
    assert (answer["gained"], answer["lost"]) == ([], [])
    assert answer["changes"] == "nothing changed"


def test_what_is_taken_away_costs_and_what_is_worth_more_gains(planned_day: Any) -> None:
    api, _, requests, plan = planned_day
    url = f"/plans/{plan['id']}/what-if"
    without = api.post(url, {"exclude": [requests["Near"]]}, status=200)
    assert without["lost"] == [requests["Near"]]
    assert without["change"] < -5.0
    assert requests["Near"] not in without["reach"]
    dearer = api.post(url, {"values": {requests["Far"]: 15.0}}, status=200)
    assert dearer["change"] == pytest.approx(10.0 * dearer["reach"][requests["Far"]], rel=0.1)
    assert dearer["change_error"] < 0.2
    less = api.post(url, {"time_budget_s": 60.0}, status=200)
    assert less["value_found"] == 0.0
    assert sorted(less["lost"]) == sorted(requests.values())
    late = api.post(url, {"start_delay_s": 600.0}, status=200)
    assert late["time_budget_s"] == pytest.approx(answer_budget(api, plan) - 600.0)
    worse = api.post(url, {"loss_factor": 10.0}, status=200)
    assert worse["value_kept"] <= worse["value_present"]


def answer_budget(api: Api, plan: dict[str, Any]) -> float:
    budget: float = api.get(f"/problems/{plan['problem_id']}")["document"]["budget"]["time_s"]
    return budget


def test_other_keep_outs_make_another_network(planned_day: Any) -> None:
    api, _, requests, plan = planned_day
    ring = [[1.0, -2.0], [7.0, -2.0], [7.0, 4.0], [1.0, 4.0]]
    answer = api.post(f"/plans/{plan['id']}/what-if", {"keep_outs": [ring]}, status=200)
    assert answer["lost"] == [requests["Near"]]
    assert any("no longer be reached" in why for why in answer["why"])
    free = api.post(f"/plans/{plan['id']}/what-if", {"keep_outs": []}, status=200)
    assert free["lost"] == []


def test_a_keep_out_that_no_drive_needs_is_answered_without_another_search(
    planned_day: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from planner import what_if

    asked: list[Any] = []
    solve = what_if.solve

    def counted(*given: Any, **options: Any) -> Any:
        asked.append(given)
        return solve(*given, **options)

    monkeypatch.setattr(what_if, "solve", counted)
    api, _, requests, plan = planned_day
    url = f"/plans/{plan['id']}/what-if"

    def moved(by_m: float) -> dict[str, Any]:
        ring = [[x + by_m, y] for x, y in ((-14.0, -14.0), (-13.0, -14.0), (-13.0, -13.0))]
        answer: dict[str, Any] = api.post(url, {"keep_outs": [ring]}, status=200)
        return {name: value for name, value in answer.items() if name not in ("elapsed_s", "changes")}

    first = moved(0.0)
    assert len(asked) == 1
    assert moved(0.25) == first
    assert len(asked) == 1
    ring = [[1.0, -2.0], [7.0, -2.0], [7.0, 4.0], [1.0, 4.0]]
    assert api.post(url, {"keep_outs": [ring]}, status=200)["lost"] == [requests["Near"]]
    assert len(asked) == 2


def test_a_demand_that_cannot_be_met_is_said(planned_day: Any) -> None:
    api, _, requests, plan = planned_day
    url = f"/plans/{plan['id']}/what-if"
    answer = api.post(url, {"force": [requests["Near"]], "time_budget_s": 60.0}, status=200)
    assert answer["feasible"] is False
    assert requests["Near"] in answer["why"][0]
    both = api("POST", url, {"force": [requests["Near"]], "exclude": [requests["Near"]]})
    assert "both excluded and demanded" in problem_of(both, 422, "invalid-input")["detail"]
    unknown = api("POST", url, {"values": {"req-nobody": 3.0}})
    assert "req-nobody is not in the plan's problem" in problem_of(unknown, 422, "invalid-input")["detail"]


def test_a_what_if_kept_is_a_plan_of_its_own_that_nobody_approves(planned_day: Any) -> None:
    api, mission_id, requests, plan = planned_day
    order = {
        "iterations": 3,
        "time_limit_s": 60.0,
        "parent_id": plan["id"],
        "what_if": {"exclude": [requests["Near"]], "loss_factor": 2.0},
    }
    job = api.post(f"/missions/{mission_id}/plans", order, status=202)
    api.jobs()
    job = api.get(f"/jobs/{job['id']}")
    assert job["state"] == "succeeded", job["problem"]
    kept = api.get(job["result_url"])
    assert kept["planned_request_ids"] == [requests["Far"]]
    assert kept["parent_id"] == plan["id"]
    assert kept["stale"] is True
    assert kept["notes"] == "What if: 1 request taken away, tracks lost 2 times as readily."
    summary = api.get(f"/plans/{kept['id']}/summary")
    assert summary["what_if"] == {"exclude": [requests["Near"]], "loss_factor": 2.0}
    compared = api.get(f"/plans/{plan['id']}/comparison/{kept['id']}")
    assert compared["only_in_a"] == [requests["Near"]]


def test_a_comparison_has_histograms_of_both_on_one_scale(planned_day: Any) -> None:
    api, _, requests, plan = planned_day
    compared = api.get(f"/plans/{plan['id']}/comparison/{plan['id']}")
    pair, difference = compared["histogram"], compared["difference_histogram"]
    assert pair["share_a"] == pair["share_b"]
    assert sum(pair["share_a"]) == pytest.approx(1.0)
    assert len(pair["edges"]) == len(pair["share_a"]) + 1
    assert sum(difference["share"]) == pytest.approx(1.0)
    assert compared["begun_a"] == compared["begun_b"]
    assert compared["begun_a"][requests["Far"]] > 0.5
    middle = [(low + high) / 2 for low, high in zip(pair["edges"], pair["edges"][1:], strict=False)]
    mean = sum(m * share for m, share in zip(middle, pair["share_a"], strict=True))
    assert mean == pytest.approx(compared["value_a"], abs=(pair["edges"][1] - pair["edges"][0]))


def test_the_difference_of_two_plans_is_told_by_meaning(planned_day: Any) -> None:
    api, _, _, plan = planned_day
    found = api.get(f"/plans/{plan['id']}/difference/{plan['id']}")
    assert found == {"same": True, "changes": []}
    problem_of(api("GET", f"/plans/{plan['id']}/difference/pln-nobody"), 404, "not-found")


def test_a_plan_that_is_made_again_differs_in_nothing(planned_day: Any) -> None:
    """Each stored text has the id of its own plan, which is where it lies and nothing that it says."""
    api, mission, requests, plan = planned_day
    order: dict[str, Any] = {"iterations": 3, "time_limit_s": 60.0, "max_branches": 2}
    job = finished(api, api.post(f"/missions/{mission}/plans", order, status=202))
    again = job["result_url"].rpartition("/")[2]
    assert again != plan["id"]
    for one, other in ((plan["id"], again), (again, plan["id"])):
        assert api.get(f"/plans/{one}/difference/{other}") == {"same": True, "changes": []}
    order["request_ids"] = [requests["Near"]]
    job = finished(api, api.post(f"/missions/{mission}/plans", order, status=202))
    less = job["result_url"].rpartition("/")[2]
    assert not api.get(f"/plans/{plan['id']}/difference/{less}")["same"]
