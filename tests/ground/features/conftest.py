"""One repository with a mission on Earth that has everything, one on Mars and one without a place."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from ground.gdr.ids import new_id
from ground.gdr.repository import open_repository
from ground.geo.place import Place
from ground.geo.site_frame import SiteFrame, site_frame
from ground.resources.people.accounts import ensure_profiles
from ground.resources.traverses.row import TraverseRow
from tests.ground.conftest import Api, open_api, settings_for, yard
from tests.ground.geo.test_places_api import change
from tests.ground.planning import file_requests, finished, planned

EARTH = {"crs": "EPSG:32612", "x": 518_334.0, "y": 4_251_500.0}
MARS = {"crs": "IAU_2015:49900", "x": 77.4508, "y": 18.4447}
RING = [[6.0, 6.0], [8.0, 6.0], [8.0, 8.5]]


@dataclass(frozen=True, slots=True)
class World:
    """The service and the ids of what is in it."""

    api: Api
    earth: str
    mars: str
    nowhere: str
    targets: dict[str, str]
    plan: str

    @property
    def frame(self) -> SiteFrame:
        """Return the site frame of the mission on Earth."""
        return site_frame(Place(**EARTH))  # type: ignore[arg-type] # two kinds of members

    def root(self, mission: str | None = None) -> str:
        """Return the path of the landing page."""
        return f"/missions/{mission or self.earth}/features"

    def items(self, collection: str, mission: str | None = None, **asked: Any) -> Any:
        """Return a page of features."""
        names = {name.replace("_", "-"): value for name, value in asked.items()}
        path = f"{self.root(mission)}/collections/{collection}/items"
        return self.api("GET", path, params={"limit": 1000, **names})

    def names(self, collection: str = "targets", **asked: Any) -> list[str]:
        """Return the names of the features that fit, in their order."""
        answer = self.items(collection, **asked)
        assert answer.status_code == 200, answer.text
        return [feature["properties"]["name"] for feature in answer.json()["features"]]


def _traverse(api: Api, mission: str) -> None:
    stops = [{"name": n, "adjusted_m": [e, 0.0, 0.0]} for n, e in (("A", 0.0), ("B", 5.0), ("C", 9.0))]
    with api.repo.database.write() as session:
        row = TraverseRow(
            id=new_id("trv"),
            author="Planner",
            mission_id=mission,
            name="First drive",
            notes="",
            job_id="job-1",
            stops=[{"name": stop["name"]} for stop in stops],
            document={"format": "localization/1", "stops": stops, "legs": []},
            solution_ids=[],
        )
        session.add(row)


@pytest.fixture(scope="module")
def world(
    sqlite_template: Path, terrain_folder: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[World]:
    folder = tmp_path_factory.mktemp("features") / "data"
    folder.mkdir()
    shutil.copyfile(sqlite_template, folder / "outcrop.db")
    repo = open_repository(settings_for(folder))
    ensure_profiles(repo)
    opened = open_api(repo)
    api = next(opened)
    earth, mars, nowhere = (yard(repo, terrain_folder, name) for name in ("Utah", "Jezero", "Yard"))
    assert change(api, earth.id, EARTH).status_code == 200
    assert change(api, mars.id, MARS).status_code == 200
    requests = file_requests(api, earth)
    plain = {"name": "Größe", "east_m": -3.0, "north_m": 3.0, "notes": "50% o'clock", "feature_type": "vein"}
    api.post(f"/missions/{earth.id}/targets", plain)
    api.post(f"/missions/{mars.id}/targets", {"name": "Rock", "east_m": 4.0, "north_m": 1.0})
    api.post(f"/missions/{earth.id}/keep-outs", {"name": "Sand", "polygon_m": RING})
    plan = planned(api, earth)
    run = api.post(f"/missions/{earth.id}/runs", {"plan_id": plan["id"], "seed": 3}, status=202)
    assert finished(api, run)["state"] == "succeeded"
    _traverse(api, earth.id)
    _traverse(api, mars.id)
    targets = {name: request["target_id"] for name, request in requests.items()}
    yield World(api, earth.id, mars.id, nowhere.id, targets, plan["id"])
    opened.close()
    repo.database.dispose()
