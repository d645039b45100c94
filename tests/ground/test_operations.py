"""What an administrator sees of a service that is at work, and nobody else."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from sqlalchemy import delete

from ground.jobs.presence import Beat, Presence
from ground.jobs.row import JobRow
from ground.resources.missions.value import Mission
from ground.resources.upkeep.noted import note
from tests.ground.conftest import Api
from tests.ground.test_upkeep import job

ADMIN = "Administrator"


def filed(api: Api, mission: Mission | None, name: str, state: str, age_s: float, **given: Any) -> None:
    created = datetime.now(UTC) - timedelta(seconds=age_s)
    row = job(None if mission is None else mission.id, name, state, created)
    for column, value in given.items():
        setattr(row, column, value)
    with api.repo.database.write() as session:
        session.add(row)


@pytest.fixture
def at_work(api: Api, mission: Mission) -> Api:
    """A service with a job of each state and a worker whose engine is away."""
    with api.repo.database.write() as session:
        session.execute(delete(JobRow))
    now = datetime.now(UTC)
    begun = now - timedelta(seconds=40)
    filed(api, mission, "job-a", "queued", 90, kind="generate_plan")
    filed(api, mission, "job-b", "queued", 30, kind="dry_run")
    filed(api, None, "job-c", "queued", 10, kind="generate_plan")
    filed(
        api, mission, "job-d", "running", 60, kind="fly_campaign", started_utc=begun, finished_utc=None,
        progress=0.25, message="flown 25 of 100", worker="far:7", attempt=2,
    )  # fmt: skip
    for number in range(12):
        filed(api, mission, f"job-s{number:02}", "succeeded", 100, finished_utc=now,
              started_utc=now - timedelta(seconds=10 * number + 1))  # fmt: skip
    filed(api, mission, "job-old", "succeeded", 9e5, started_utc=now - timedelta(days=20),
          finished_utc=now - timedelta(days=8))  # fmt: skip
    filed(api, mission, "job-never", "cancelled", 100, finished_utc=now)
    Beat(api.repo.job_dir()).say(Presence("far:7", "distributed", 1, "OSError: no scheduler", "2026-11-23"))
    note(api.repo, "backup")
    note(api.repo, "audit", faults=2)
    return api


def test_an_administrator_sees_workers_queue_disk_and_upkeep(at_work: Api, mission: Mission) -> None:
    told = at_work.get("/operations", who=ADMIN)
    (worker,) = told["workers"]
    assert (worker["name"], worker["running"]) == ("far:7", 1)
    assert worker["trouble"] == "OSError: no scheduler since 2026-11-23, tried again"
    assert 0 <= worker["heard_s"] < 30
    of = {(b["kind"], b["mission_name"]): (b["waiting"], b["running"]) for b in told["backlog"]}
    assert of == {
        ("generate_plan", mission.name): (1, 0),
        ("dry_run", mission.name): (1, 0),
        ("generate_plan", ""): (1, 0),
        ("fly_campaign", mission.name): (0, 1),
    }
    (runs,) = told["running"]
    assert (runs["id"], runs["worker"], runs["attempt"], runs["progress"]) == ("job-d", "far:7", 2, 0.25)
    assert runs["took_s"] == pytest.approx(40, abs=30)
    disk = told["disk"]
    assert disk["size_bytes"] > disk["free_bytes"] > 0
    assert disk["database_bytes"] > 100_000
    upkeep = {u["act"]: (u["at_utc"] is not None, u["faults"]) for u in told["upkeep"]}
    assert upkeep == {"backup": (True, 0), "audit": (True, 2), "contents": (False, None)}
    assert told["history_events"] >= 2


def test_jobs_that_wait_stand_in_the_order_in_which_a_worker_takes_them(at_work: Api) -> None:
    waiting = at_work.get("/operations", who=ADMIN)["waiting"]
    # what somebody waits for goes first, then the mission with the fewest running
    assert [(w["position"], w["id"]) for w in waiting] == [(1, "job-b"), (2, "job-c"), (3, "job-a")]
    assert waiting[2]["took_s"] == pytest.approx(90, abs=30)


def test_the_slowest_jobs_of_the_last_week_stand_first(at_work: Api) -> None:
    slowest = at_work.get("/operations", who=ADMIN)["slowest"]
    assert [s["id"] for s in slowest] == [f"job-s{number:02}" for number in range(11, 1, -1)]
    assert slowest[0]["took_s"] == pytest.approx(111, abs=0.2)


@pytest.mark.parametrize("who", ["Viewer", "Scientist", "Planner", "Flight Director", "Operator"])
def test_nobody_else_sees_it(api: Api, who: str) -> None:
    answer = api("GET", "/operations", who=who)
    assert answer.status_code == 403
    assert answer.headers["content-type"] == "application/problem+json"
    assert "may not administer" in answer.json()["detail"]
