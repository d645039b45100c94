"""Live runs over REST: held, stepped, given faults, stopped; what the page needs is in the stream."""

from __future__ import annotations

import json
import re
import threading

from ground.resources.runs.work import LIVE, live_lines_of
from ground.uplink.live import stop_run
from tests.ground.planning import PlannedDay
from tests.ground.test_control_run import _over, _until
from tests.ground.test_missions_api import problem


def test_a_live_run_is_held_stepped_given_a_fault_and_stopped(sqlite_planned_day: PlannedDay) -> None:
    api, mission, plan = sqlite_planned_day.api, sqlite_planned_day.mission, sqlite_planned_day.plan
    order = {"plan_id": plan["id"], "live": True, "pace": 200.0}
    refused = api("POST", f"/missions/{mission.id}/runs", {**order, "light_time_s": 1.0})
    assert "no light time" in problem(refused, 422, "invalid-input")["detail"]
    jobs = [api.post(f"/missions/{mission.id}/runs", order, status=202) for _ in range(2)]
    first, second = (job["subject_id"] for job in jobs)
    assert [job["kind"] for job in jobs] == ["live", "live"]
    early = api("POST", f"/runs/{first}/faults", {"kind": "novelty", "amount": 0.5})
    assert "only a live run that goes on" in problem(early, 409, "wrong-state")["detail"]
    worker = threading.Thread(target=api.jobs)
    worker.start()
    try:
        done = _until(lambda: _over(api, first), 120)
        assert (done["kind"], done["state"], done["outcome"]) == ("live", "succeeded", "SUCCEEDED")
        folder = api.repo.run_dir(first)
        links = live_lines_of(folder / LIVE, "link")
        assert links
        assert {"t_s", "up", "age_s", "round_trip_s", "offset_s", "breaks", "commands"} <= links[0].keys()
        assert any(link["up"] for link in links)
        samples = live_lines_of(folder / LIVE, "telemetry")
        assert len({(s["east_m"], s["north_m"]) for s in samples}) > 3  # the trail of its pose
        assert api.get(f"/runs/{first}/trace")["events"][0]["event"] == "start"
        products = live_lines_of(folder / LIVE, "product")
        assert len(products) == len(api.get(f"/missions/{mission.id}/products")["items"]) > 0
        assert api.get(f"/runs/{first}/snapshot")["over"] is True

        run = f"/runs/{second}"
        _until(lambda: len(api.get(f"{run}/telemetry")["t_s"]) > 0, 60)
        held = api.post(f"{run}/control", {"paused": True}, status=200)
        assert (held["paused"], held["pace"], held["abort"]) == (True, 200.0, False)
        stepped = api.post(f"{run}/control", {"step": True}, status=200)
        assert (stepped["paused"], stepped["steps"]) == (True, 1)
        paced = api("POST", f"{run}/control", {"pace": 5.0})
        assert "its pace is that of its rover" in problem(paced, 409, "wrong-state")["detail"]
        api.post(f"{run}/faults", {"kind": "novelty", "amount": 0.5}, status=200)
        wrong = api("POST", f"{run}/faults", {"kind": "lose-target"})
        assert "target" in problem(wrong, 409, "wrong-state")["detail"]
        [kept] = api.get(run)["faults"]
        assert (kept["kind"], kept["amount"], kept["task"]) == ("novelty", 0.5, None)
        assert kept["at_s"] > 0.0  # when it came
        live = api.repo.run_dir(second) / LIVE
        _until(lambda: any(w["paused"] for w in live_lines_of(live, "control")))
        for who, wish in (
            ("Scientist", {"stop": True}),
            ("Viewer", {"stop": True}),
            ("Operator", {"paused": True}),
            ("Operator", {"stop": True, "step": True}),
        ):
            problem(api("POST", f"{run}/control", wish, who=who), 403, "forbidden")
        stopped = api.post(f"{run}/control", {"stop": True}, status=200, who="Operator")
        assert stopped["abort"] is True
        done = _until(lambda: _over(api, second), 60)
        assert (done["state"], done["outcome"]) == ("succeeded", "ABORTED")
        assert json.loads((live.parent / "run.json").read_text())["stopped"] is True
        told = [(note["kind"], note["text"]) for note in live_lines_of(live, "note")]
        assert ("operator", "fault 'novelty' injected by Planner") in told
        assert ("operator", "STOP by Operator") in told
        assert len(done["faults"]) == 1  # what the refused one would have been is not kept
        first_line, last_line = done["notes"].splitlines()
        assert re.search(r"UTC: fault novelty at \d+ s, injected by Planner$", first_line)
        assert re.match(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d UTC: STOP by Operator$", last_line)
        acts = api.get(f"/missions/{mission.id}/history?limit=1000")["items"]
        assert ("stop", "Operator", second) in {(e["action"], e["actor"], e["subject_id"]) for e in acts}
    finally:
        for run_id in (first, second):
            if not _over(api, run_id):
                stop_run(api.repo.run_dir(run_id))
        worker.join(60.0)


def test_a_live_run_that_waits_is_stopped_by_whoever_may_stop(sqlite_planned_day: PlannedDay) -> None:
    api, mission, plan = sqlite_planned_day.api, sqlite_planned_day.mission, sqlite_planned_day.plan
    order = {"plan_id": plan["id"], "live": True, "pace": 200.0}
    live = api.post(f"/missions/{mission.id}/runs", order, status=202)
    dry = api.post(f"/missions/{mission.id}/runs", {"plan_id": plan["id"]}, status=202)
    problem(api("POST", f"/jobs/{dry['id']}/cancel", who="Operator"), 403, "forbidden")
    problem(api("POST", f"/jobs/{live['id']}/cancel", who="Scientist"), 403, "forbidden")
    cancelled = api("POST", f"/jobs/{live['id']}/cancel", who="Operator")
    assert cancelled.json()["state"] == "cancelled"
