"""Operators hold, step and abort a dry run that goes on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from ground.resources.runs.work import LIVE, live_lines_of
from tests.ground.conftest import Api
from tests.ground.planning import PlannedDay
from tests.ground.test_missions_api import problem


def _until(what: Callable[[], Any], limit_s: float = 60.0) -> Any:
    end = time.monotonic() + limit_s
    while not (found := what()):
        assert time.monotonic() < end, "it did not come to pass"
        time.sleep(0.05)
    return found


def _still(api: Api, run_id: str) -> int:
    """Return how many samples there are, once there have been no more for a while."""
    count, since = -1, time.monotonic()
    while time.monotonic() - since < 0.5:
        now = len(api.get(f"/runs/{run_id}/telemetry")["t_s"])
        if now != count:
            count, since = now, time.monotonic()
        time.sleep(0.05)
    return count


def test_a_run_is_held_stepped_let_go_and_aborted(sqlite_planned_day: PlannedDay) -> None:
    api, mission, plan = sqlite_planned_day.api, sqlite_planned_day.mission, sqlite_planned_day.plan
    order = {"plan_id": plan["id"], "pace": 20.0}
    jobs = [api.post(f"/missions/{mission.id}/runs", order, status=202) for _ in range(2)]
    first, second = (job["subject_id"] for job in jobs)
    refused = api("POST", f"/runs/{first}/control", {"paused": True})
    assert "only a run that goes on" in problem(refused, 409, "wrong-state")["detail"]
    worker = threading.Thread(target=api.jobs)
    worker.start()
    try:
        _until(lambda: len(api.get(f"/runs/{first}/telemetry")["t_s"]) > 1)
        told = live_lines_of(api.repo.run_dir(first) / LIVE, "control")
        assert [(wish["t_s"], wish["pace"], wish["paused"]) for wish in told] == [(0.0, 20.0, False)]
        held = api.post(f"/runs/{first}/control", {"paused": True}, status=200)
        assert (held["paused"], held["pace"]) == (True, 20.0)
        stood = _still(api, first)
        api.post(f"/runs/{first}/control", {"step": True}, status=200)
        _until(lambda: len(api.get(f"/runs/{first}/telemetry")["t_s"]) > stood)
        assert api.get(f"/runs/{first}")["state"] == "running"
        api.post(f"/runs/{first}/control", {"paused": False, "pace": 0.0}, status=200)
        done = _until(lambda: _over(api, first))
        assert (done["state"], done["outcome"]) == ("succeeded", "SUCCEEDED")

        _until(lambda: len(api.get(f"/runs/{second}/telemetry")["t_s"]) > 1)
        api.post(f"/runs/{second}/control", {"abort": True}, status=200)
        done = _until(lambda: _over(api, second))
        assert (done["state"], done["outcome"]) == ("succeeded", "ABORTED")
        trace = api.get(f"/runs/{second}/trace")
        assert trace["events"][-1]["t_s"] < plan_time(api, plan)
    finally:
        worker.join(60.0)


def _over(api: Api, run_id: str) -> Any:
    run = api.get(f"/runs/{run_id}")
    return run if run["state"] not in {"queued", "running"} else None


def plan_time(api: Api, plan: dict[str, Any]) -> float:
    budget: float = api.get(f"/problems/{plan['problem_id']}")["document"]["budget"]["time_s"]
    return budget
