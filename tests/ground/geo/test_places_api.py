"""A mission's place over REST: given, taken from a terrain, changed, undone, refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ground.resources.missions.value import Mission
from tests.ground.conftest import Api, yard
from tests.ground.test_missions_api import problem, upload
from tests.rover_iface.test_georeferenced_terrain import from_origin
from tests.rover_iface.test_terrain import geotiff
from tests.shared import needed

needed("pyproj")


@pytest.fixture
def sqlite_mission(sqlite_api: Api, terrain_folder: Path) -> Mission:
    return yard(sqlite_api.repo, terrain_folder)


UTAH = {"crs": "EPSG:4326", "x": -110.79, "y": 38.41}
FULL = {**UTAH, "rotation_rad": 0.0, "height_m": None, "heights": "unknown"}


def change(api: Api, mission: str, place: object) -> Any:
    tag = api("GET", f"/missions/{mission}").headers["etag"]
    return api("PATCH", f"/missions/{mission}", {"place": place}, headers={"If-Match": tag})


def test_a_place_is_set_shown_undone_and_taken_away(sqlite_api: Api, sqlite_mission: Mission) -> None:
    api, mission = sqlite_api, sqlite_mission.id
    assert api.get(f"/missions/{mission}")["place"] is None
    assert change(api, mission, UTAH).json()["place"] == FULL
    assert change(api, mission, None).json()["place"] is None
    api.post(f"/missions/{mission}/undo", {}, status=200)
    assert api.get(f"/missions/{mission}")["place"] == FULL


@pytest.mark.parametrize(
    ("place", "why"),
    [
        ({**UTAH, "x": 38.41, "y": -110.79}, "look swapped"),
        ({**UTAH, "crs": "EPSG:1"}, "no coordinate reference that is known"),
        ({**UTAH, "crs": "IAU_2015:49901"}, "to the west"),
    ],
)
def test_a_place_of_no_use_is_refused(
    sqlite_api: Api, sqlite_mission: Mission, place: object, why: str
) -> None:
    told = problem(change(sqlite_api, sqlite_mission.id, place), 422, "invalid-input")
    assert why in told["detail"]
    assert told["errors"][0]["pointer"].startswith("/place/")


def test_a_mission_on_a_dem_in_degrees_knows_its_place(sqlite_api: Api, tmp_path: Path) -> None:
    step = 5e-6
    dem = geotiff(
        tmp_path / "dem.tif",
        np.zeros((100, 100)),
        transform=from_origin(77.4, 18.4, step, step),
        crs="IAU_2015:49900",
    )
    source = {"source": "uploaded", "upload_id": upload(sqlite_api, "dem.tif", dem.read_bytes())}
    made = sqlite_api.post("/missions", {"name": "Jezero", "terrain": source})
    assert made["place"]["crs"] == "IAU_2015:49900"
    assert made["place"]["x"] == pytest.approx(77.4 + 50 * step)
    assert made["place"]["y"] == pytest.approx(18.4 - 50 * step)
    moved = sqlite_api.post("/missions", {"name": "Utah", "terrain": source, "place": UTAH})
    assert moved["place"] == FULL
