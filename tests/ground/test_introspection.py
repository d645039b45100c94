"""Looking into a run: the executive's state at each record, and a stream without gaps."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from executive.runtime.journal import JournalFile
from ground.gdr.packed import read_kept
from ground.resources.runs import work as run_work
from tests.ground.conftest import Api
from tests.ground.planning import PlannedDay, finished
from tests.ground.test_missions_api import problem

LOOK_AT = 12
"""The record of the trace at which the tests look into a run that goes on."""


@pytest.fixture
def day(sqlite_planned_day: PlannedDay) -> tuple[Api, str, str]:
    made = sqlite_planned_day
    return made.api, made.mission.id, made.plan["id"]


def carried_out(day: tuple[Api, str, str]) -> dict[str, Any]:
    api, mission, plan = day
    job = finished(api, api.post(f"/missions/{mission}/runs", {"plan_id": plan, "seed": 4}, status=202))
    run: dict[str, Any] = api.get(job["result_url"])
    return run


def events(text: str) -> list[tuple[int, str, Any]]:
    """Return number, kind and data of each event of a stream."""
    found = []
    for block in text.split("\n\n"):
        members = dict(line.split(": ", 1) for line in block.splitlines() if not line.startswith(":"))
        if "data" in members:
            found.append((int(members["id"]), members["event"], json.loads(members["data"])))
    return found


def _journal(path: Path) -> JournalFile:
    return JournalFile(path, read_kept(path))


def test_a_snapshot_follows_the_journal_record_by_record(day: tuple[Api, str, str]) -> None:
    api, run = day[0], carried_out(day)
    url = f"/runs/{run['id']}/snapshot"
    last = api.get(url)
    records = _journal(api.repo.run_dir(run["id"]) / "journal.jsonl").records
    trace = api.get(f"/runs/{run['id']}/trace")["events"]
    assert (last["seq"], last["last_seq"]) == (len(records) - 1,) * 2
    assert (last["over"], last["complete"], last["outcome"]) == (True, True, "SUCCEEDED")
    assert last["trace_count"] == len(trace)
    assert {n["state"] for n in last["nodes"] if n["outcome"]} == {"FINISHED"}
    assert last["commands"] == []
    first = api.get(f"{url}?seq=0")
    assert first["t_s"] == records[0]["start"] / 1000
    assert [n["id"] for n in first["nodes"]] == [n["id"] for n in last["nodes"]]
    assert all(n["outcome"] is None for n in first["nodes"])
    known = {n["id"] for n in first["nodes"]}
    times = []
    for number in range(0, len(records), 9):
        seen = api.get(f"{url}?seq={number}")
        times.append(seen["t_s"])
        assert all(n["parent"] is None or n["parent"] in known for n in seen["nodes"])
        assert {task["task"] for task in seen["commands"]} <= {
            n["id"] for n in seen["nodes"] if n["state"] not in {"INACTIVE", "FINISHED"}
        }
        started = [e["arguments"][0] for e in trace[: seen["trace_count"]] if e["event"] == "start"]
        assert set(started) == {n["id"] for n in seen["nodes"] if n["start_s"] is not None}
    assert times == sorted(times)


def test_a_snapshot_by_time_is_that_of_the_last_record_until_then(day: tuple[Api, str, str]) -> None:
    api, run = day[0], carried_out(day)
    url = f"/runs/{run['id']}/snapshot"
    half = run["duration_s"] / 2
    seen = api.get(f"{url}?t_s={half}")
    assert seen["t_s"] <= half
    assert api.get(f"{url}?seq={seen['seq']}") == seen
    assert api.get(f"{url}?seq={seen['seq'] + 1}")["t_s"] > half
    assert not seen["over"]
    assert api.get(f"{url}?t_s=1e8")["seq"] == seen["last_seq"]


def test_a_snapshot_that_cannot_be_given_says_why(day: tuple[Api, str, str]) -> None:
    api, mission, plan = day
    run = carried_out(day)
    url = f"/runs/{run['id']}/snapshot"
    last = api.get(url)["last_seq"]
    answer = problem(api("GET", f"{url}?seq={last + 1}"), 422, "invalid-input")
    assert f"records 0 to {last}" in answer["detail"]
    problem(api("GET", f"{url}?seq=1&t_s=2"), 422, "invalid-input")
    problem(api("GET", "/runs/run-nobody/snapshot"), 404, "not-found")
    job = api.post(f"/missions/{mission}/runs", {"plan_id": plan, "seed": 5}, status=202)
    waiting = problem(api("GET", f"/runs/{job['subject_id']}/snapshot"), 409, "wrong-state")
    assert "is queued and has no journal" in waiting["detail"]


def test_a_run_that_goes_on_can_be_looked_into(
    day: tuple[Api, str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    api, mission, plan = day
    seen: list[dict[str, Any]] = []
    job = api.post(f"/missions/{mission}/runs", {"plan_id": plan, "seed": 4}, status=202)
    url = f"/runs/{job['subject_id']}/snapshot"
    tell, count = run_work._Live.trace, 0

    def trace(self: Any, record: Any) -> None:
        nonlocal count
        tell(self, record)
        count += 1
        if count == LOOK_AT:
            seen.append(api.get(url))

    monkeypatch.setattr(run_work._Live, "trace", trace)
    assert finished(api, job)["state"] == "succeeded"
    (early,) = seen
    assert (early["over"], early["complete"], early["outcome"]) == (False, False, None)
    assert any(n["state"] == "EXECUTING" for n in early["nodes"])
    assert "battery-energy" in "".join(early["database"])
    after = api.get(f"{url}?seq={early['seq']}")
    assert {**early, "complete": True, "last_seq": after["last_seq"]} == after


def test_a_stream_taken_up_again_has_every_event_once(day: tuple[Api, str, str]) -> None:
    api, run = day[0], carried_out(day)
    url = f"/runs/{run['id']}/events"
    whole = events(api("GET", url).text)
    *lines, (end, kind, _) = whole
    assert [number for number, _, _ in lines] == list(range(1, len(lines) + 1))
    assert (end, kind) == (len(lines), "end")
    trace = [data for _, kind, data in lines if kind == "trace"]
    assert trace == api.get(f"/runs/{run['id']}/trace")["events"]
    for cut in (0, 1, len(lines) // 2, len(lines) - 1, len(lines)):
        rest = events(api("GET", url, headers={"Last-Event-ID": str(cut)}).text)
        assert lines[:cut] + rest == whole
