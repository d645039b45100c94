"""A mission's place over REST: given, taken from a terrain, changed, undone, refused."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ground.geo.references import _reference
from ground.geo.site_frame import site_frame
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
        ({**UTAH, "crs": "EPSG:1"}, "not a coordinate reference that is known"),
        ({**UTAH, "crs": "IAU_2015:49901"}, "to the west"),
        (
            {"crs": "EPSG:3857", "x": -12_333_000, "y": 4_635_000},
            "counts 1.276 metres for a metre on the ground",
        ),
        ({"crs": "EPSG:32612", "x": 4_251_500, "y": 518_334}, "counts 1.179 metres for a metre"),
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


def on_terrain(api: Api, terrain_folder: Path, folder: Path, origin: str) -> Any:
    """Return the place of a mission on a terrain whose file tells this origin; JSON as it stands."""
    shutil.copytree(terrain_folder, folder)
    described = json.loads((folder / "terrain.json").read_text())
    text = json.dumps({**described, "origin": "HERE"}).replace('"HERE"', origin)
    (folder / "terrain.json").write_text(text)
    mission = yard(api.repo, folder).id
    assert api("GET", f"/missions/{mission}/geometry").status_code == 200
    return api.get(f"/missions/{mission}")["place"]


OF_NO_USE = [
    '{"crs": "local grid of the yard", "x": 0, "y": 0}',
    '{"crs": "EPSG:4326", "x": 38.41, "y": -110.79}',
    '{"crs": "EPSG:2053", "x": 0, "y": 0}',
    '{"crs": "LOCAL_CS[\\"yard\\",UNIT[\\"metre\\",1]]", "x": 0, "y": 0}',
    '{"crs": "EPSG:32612", "x": 4251500, "y": 518334}',
    '{"crs": "EPSG:3857", "x": -12333000, "y": 4635000}',
]
NO_NUMBERS = [
    '{"crs": "EPSG:4326", "x": NaN, "y": 0}',
    '{"crs": "EPSG:4326", "x": Infinity, "y": 0}',
    '{"crs": "EPSG:4326", "x": 1' + 400 * "0" + ', "y": 0}',
    '{"crs": "EPSG:4326", "x": true, "y": 0}',
    '{"crs": "EPSG:32612", "x": 2e8, "y": 0}',
    '{"crs": ["EPSG:4326"], "x": 0, "y": 0}',
]


@pytest.mark.parametrize("origin", [*OF_NO_USE, *NO_NUMBERS])
def test_an_origin_of_no_use_is_no_place(
    sqlite_api: Api, terrain_folder: Path, tmp_path: Path, origin: str
) -> None:
    assert on_terrain(sqlite_api, terrain_folder, tmp_path / "yard", origin) is None


@pytest.mark.parametrize("origin", [*NO_NUMBERS, json.dumps(UTAH)])
def test_an_origin_is_looked_at_without_pyproj(
    sqlite_api: Api, terrain_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, origin: str
) -> None:
    site_frame.cache_clear()
    _reference.cache_clear()
    monkeypatch.setitem(sys.modules, "pyproj", None)
    place = on_terrain(sqlite_api, terrain_folder, tmp_path / "yard", origin)
    assert place == (None if origin in NO_NUMBERS else FULL)


def test_a_map_of_mars_keeps_its_place_and_takes_a_height(
    sqlite_api: Api, terrain_folder: Path, tmp_path: Path
) -> None:
    """Maps of Mars are stretched by some percent: their grid is the site's by construction, so it is kept."""
    api = sqlite_api
    origin = {"crs": "IAU_2015:49910", "x": 4_590_000.0, "y": 1_093_000.0}
    place = on_terrain(api, terrain_folder, tmp_path / "yard", json.dumps(origin))
    assert place == {**FULL, **origin}
    (mission,) = api.get("/missions")["items"]
    assert change(api, mission["id"], {**origin, "height_m": -2500.0}).status_code == 200
    moved = change(api, mission["id"], {**origin, "y": 1_094_000.0})
    assert "counts 1.054 metres" in problem(moved, 422, "invalid-input")["detail"]


def test_a_point_of_the_site_is_told_in_another_reference(sqlite_api: Api, sqlite_mission: Mission) -> None:
    from pyproj import Transformer

    api, url = sqlite_api, f"/missions/{sqlite_mission.id}/coordinates?east_m=40&north_m=-30"
    assert "no place on a body" in problem(api("GET", f"{url}&crs=lonlat"), 422, "invalid-input")["detail"]
    assert api.get(f"{url}&crs=site") == {"crs": "site", "x": 40.0, "y": -30.0}
    change(api, sqlite_mission.id, {"crs": "EPSG:32612", "x": 518_334, "y": 4_251_500})
    assert api.get(f"{url}&crs=EPSG:32612") == {"crs": "EPSG:32612", "x": 518_374.0, "y": 4_251_470.0}
    found = api.get(f"{url}&crs=lonlat")
    x, y = Transformer.from_crs("EPSG:4326", "EPSG:32612", always_xy=True).transform(found["x"], found["y"])
    assert (x, y) == pytest.approx((518_374.0, 4_251_470.0), abs=1e-3)
    problem(api("GET", f"{url}&crs=nowhere"), 422, "invalid-input")
    problem(api("GET", "/missions/msn-nobody/coordinates?east_m=0&north_m=0&crs=site"), 404, "not-found")
