"""Sol paths over REST: the first sol is an ordinary plan, and beside it what the later ones are worth."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from ground.day.worksite import Worksite
from ground.resources.missions.value import Mission
from ground.resources.plans import work as plan_work
from ground.resources.plans.order import ORDERS, Ahead, PlanWork, Search
from mission import Day, Limits, Pose
from planner.problem import problem_from_dict
from tests.ground.conftest import Api, yard
from tests.ground.planning import file_requests, finished
from tests.ground.test_missions_api import problem
from tests.planner.examples import observation, problem_document

POWER = {
    "battery": {"capacity_j": 900_000.0, "charge_j": 300_000.0, "floor_j": 100_000.0},
    "sols": [{"time_s": 3000.0, "rest": [{"duration_s": 10_000.0, "solar_w": 30.0}]}],
}


@pytest.fixture
def world(sqlite_api: Api, terrain_folder: Path) -> tuple[Api, Mission]:
    mission = yard(sqlite_api.repo, terrain_folder)
    for number, (east, north) in enumerate([(4.0, 1.0), (2.0, -5.0), (-6.0, 3.0), (-3.0, -6.0)]):
        place = {"name": f"R{number}", "east_m": east, "north_m": north}
        target = sqlite_api.post(f"/missions/{mission.id}/targets", place)
        request = {"target_id": target["id"], "instrument": "science_camera", "value": 5.0 + number}
        sqlite_api.post(f"/missions/{mission.id}/observation-requests", request)
    return sqlite_api, mission


def test_a_sol_path_is_a_plan_of_the_mission_and_what_later_sols_are_worth(
    world: tuple[Api, Mission],
) -> None:
    api, mission = world
    order = {"sols": 3, "power": POWER, "time_limit_s": 2.0, "name": "Three sols"}
    job = finished(api, api.post(f"/missions/{mission.id}/sol-paths", order, status=202))
    assert job["state"] == "succeeded", job["problem"]
    assert job["subject_kind"] == "plan"
    plan = api.get(job["result_url"])
    assert (plan["name"], plan["state"], plan["stale"]) == ("Three sols", "computed", False)
    path = api.get(f"/plans/{plan['id']}/sol-path")
    assert [sol["sol"] for sol in path["sols"]] == [1, 2, 3]
    assert 0.0 < path["lower"] <= path["mean"] <= path["upper"]
    assert plan["planned_request_ids"]
    later = {name: sol["sol"] for sol in path["sols"][1:] for name in sol["observations"]}
    assert later  # one sol does not hold all four
    for name in later.keys() - set(plan["planned_request_ids"]):
        assert plan["left_out"][name] == f"planned for sol {later[name]} of 3"
    budget = api.get(f"/problems/{plan['problem_id']}")["document"]["budget"]
    assert budget["time_s"] == 3000.0
    assert 0.0 < budget["energy_j"] <= 200_000.0  # what the nights need stays
    assert "(plan" in api("GET", f"/plans/{plan['id']}/crl").text
    assert {r["rule"] for r in api.get(f"/plans/{plan['id']}/flight-rules")} >= {"FR-TILT", "FR-ENERGY-FLOOR"}


def test_what_sol_paths_cannot_be_asked_for_is_refused_by_name(world: tuple[Api, Mission]) -> None:
    api, mission = world
    url = f"/missions/{mission.id}/sol-paths"
    for changed, said in (
        ({"sols": 0}, "sols"),
        ({"sols": 31}, "sols"),
        ({"sols": 2, "power": {**POWER, "battery": {"capacity_j": 1.0, "charge_j": 2.0}}}, "charge_j is 2"),
        ({"sols": 2, "power": {**POWER, "sols": []}}, "sols"),
        ({"sols": 2, "time_limit_s": 0.0}, "time_limit_s"),
    ):
        assert said in str(problem(api("POST", url, changed), 422, "invalid-input"))
    file_requests(api, mission)  # one of them tracked
    job = finished(api, api.post(url, {"sols": 2, "time_limit_s": 1.0}, status=202))
    assert job["state"] == "failed"
    assert "needs its track; sol paths do not plan with that" in job["problem"]["detail"]


def test_a_plan_of_one_sol_has_no_path(world: tuple[Api, Mission]) -> None:
    api, mission = world
    job = finished(
        api, api.post(f"/missions/{mission.id}/plans", {"iterations": 1, "max_branches": 0}, status=202)
    )
    assert (
        "single sol" in problem(api("GET", f"{job['result_url'][7:]}/sol-path"), 404, "not-found")["detail"]
    )


def test_a_sol_path_that_is_cancelled_keeps_the_best_so_far(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [[observation(f"O{k + 1}", "image")] for k in range(5)]
    places = [(4.0 * k - 8.0, 5.0) for k in range(5)]
    day = SimpleNamespace(
        problem=problem_from_dict(problem_document(places=places, observations=rows, time_s=4000.0)),
        refused=(),
    )
    monkeypatch.setattr(Worksite, "prepare", lambda site, of, report: day)
    monkeypatch.setattr(plan_work, "network_geometry", lambda of: {})
    monkeypatch.setattr(plan_work, "observation_points", lambda of: {})
    order = PlanWork(
        Worksite("mis_1", "", "k9"), Day("d", Pose(0.0, 0.0), Limits(1.0, 1.0)), "pln_1",
        Search("optimal", 2, 200.0, None, 1), ahead=Ahead(2),
    )  # fmt: skip
    assert ORDERS.from_document(ORDERS.document(order)) == order
    heard: list[str] = []
    told: dict[str, Any] = plan_work.work(
        order, lambda share, text: heard.append(text), lambda: any("orders" in text for text in heard)
    )
    assert told["summary"]["stopped"] is True
    assert told["summary"]["sol_path"]["stopped"] is True
    assert told["status"] == "planned"
