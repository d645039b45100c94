"""A mission with two requests and its plan: made over REST, or a copy of what was made before."""

from __future__ import annotations

import copy
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ground.resources.missions.value import Mission

if TYPE_CHECKING:
    from tests.ground.conftest import Api


def file_requests(api: Api, mission: Mission) -> dict[str, dict[str, Any]]:
    """File two targets with a request each; return the requests by the names of their targets."""
    found = {}
    for name, east, north, instrument, value in (
        ("Near", 4.0, 1.0, "microscopic_imager", 20.0),
        ("Far", 2.0, -5.0, "science_camera", 5.0),
    ):
        target = api.post(f"/missions/{mission.id}/targets", {"name": name, "east_m": east, "north_m": north})
        found[name] = api.post(
            f"/missions/{mission.id}/observation-requests",
            {"target_id": target["id"], "instrument": instrument, "value": value},
        )
    return found


def finished(api: Api, job: dict[str, Any]) -> dict[str, Any]:
    """Do the work that waits; return a job as it is then."""
    api.jobs()
    done: dict[str, Any] = api.get(f"/jobs/{job['id']}")
    return done


def planned(api: Api, mission: Mission, **order: Any) -> dict[str, Any]:
    """Return a new plan of a mission."""
    order = {"iterations": 3, "time_limit_s": 60.0, "max_branches": 2, **order}
    job = finished(api, api.post(f"/missions/{mission.id}/plans", order, status=202))
    assert job["state"] == "succeeded", job["problem"]
    plan: dict[str, Any] = api.get(job["result_url"])
    return plan


@dataclass(frozen=True)
class PlannedDay:
    """A service with a mission, its requests by the names of their targets, and its plan."""

    api: Api
    mission: Mission
    requests: dict[str, dict[str, Any]]
    plan: dict[str, Any]


def plan_day(api: Api, mission: Mission) -> PlannedDay:
    """File requests in an empty mission and plan them."""
    requests = file_requests(api, mission)
    return PlannedDay(api, mission, requests, planned(api, mission))


@dataclass(frozen=True)
class KeptDay:
    """A planned day that tests work on copies of: a plan costs a second of a processor.

    `folder` is the data folder; `database` names the database on a server, and is empty where that lies in
    the folder.
    """

    folder: Path
    mission: Mission
    requests: dict[str, dict[str, Any]]
    plan: dict[str, Any]
    database: str = ""

    def copied(self, folder: Path, opened: Callable[[Path], Iterator[Api]]) -> Iterator[PlannedDay]:
        """Give a copy in a folder that is not there yet, as `opened` opens its service."""
        shutil.copytree(self.folder, folder)
        for api in opened(folder):
            yield PlannedDay(api, self.mission, copy.deepcopy(self.requests), copy.deepcopy(self.plan))
