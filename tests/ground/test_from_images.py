"""A folder of pictures as a mission whose panorama is those pictures."""

from __future__ import annotations

import io
import math
import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ground.records.actor import SYSTEM_ACTOR
from ground.resources.mission_archives.mission_archive import export_mission
from ground.resources.mission_setup.create_mission import FolderTerrain, create_mission
from ground.resources.missions.value import Mission
from ground.resources.sols.create_sol import create_sol
from rover_iface.cameras.panorama import load_panorama
from rover_iface.reconstruction.site_model import SiteOptions, reconstruct
from rover_iface.terrain import write_terrain
from tests.ground.conftest import Api
from tests.ground.test_missions_api import problem
from tests.rover_iface.reconstruction.products import rendered, rendered_folder, site


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("real") / "site"
    made = reconstruct(rendered_folder(out.with_name("pictures")), SiteOptions(under_rover_m=3.0))
    made.panorama.save(out)
    return write_terrain(made.terrain_in(out), out)


@pytest.fixture
def mission(sqlite_api: Api, folder: Path) -> Mission:
    made = create_mission(sqlite_api.repo, SYSTEM_ACTOR, name="Real", source=FolderTerrain(folder))
    create_sol(sqlite_api.repo, SYSTEM_ACTOR, made.id)
    return made


def test_the_panorama_of_a_real_site_is_its_pictures(sqlite_api: Api, mission: Mission) -> None:
    strip = sqlite_api.get(f"/missions/{mission.id}/panorama")
    assert strip["camera"] == "pictures"
    assert all(tile["ready"] for tile in strip["tiles"])
    images = []
    for tile in strip["tiles"]:
        answer = sqlite_api("GET", tile["url"].removeprefix("/api/v1"))
        image = np.asarray(Image.open(io.BytesIO(answer.content)))
        assert image.shape == (strip["tile_height"], strip["tile_width"])
        images.append(image)
    shown = np.hstack(images)
    # the rover looked to its front, on both sides of 0.7 rad from east
    middle = (
        strip["tiles"][0]["left_azimuth_rad"]
        + 0.5 * float((shown.max(axis=0) > 0).sum()) * strip["rad_per_px"]
    )
    assert middle == pytest.approx(math.pi / 2 - 0.7 + 0.05, abs=0.15)
    assert float(shown.max()) > 200
    none = sqlite_api("GET", f"/missions/{mission.id}/panorama/tiles/{len(images)}")
    assert "has no tile" in problem(none, 404, "not-found")["detail"]


def test_a_point_picked_in_the_pictures_is_where_the_ground_is(sqlite_api: Api, mission: Mission) -> None:
    base = rendered()[0][0].z
    found = 0
    for azimuth in np.linspace(math.pi / 2 - 0.7 - 0.4, math.pi / 2 - 0.7 + 0.4, 6):
        for elevation in (-0.3, -0.2):
            where = f"/missions/{mission.id}/panorama/point?azimuth_rad={azimuth}&elevation_rad={elevation}"
            answer = sqlite_api("GET", where)
            if answer.status_code == 422:
                continue
            point = answer.json()
            truth = float(site().height(point["east_m"], point["north_m"])) - base
            assert abs(point["up_m"] - truth) < 0.12
            ray = math.atan2(point["east_m"], point["north_m"])
            assert ray == pytest.approx(azimuth, abs=0.15)
            found += 1
    assert found >= 8


def test_where_no_picture_looks_nothing_is_picked(sqlite_api: Api, mission: Mission) -> None:
    behind = sqlite_api("GET", f"/missions/{mission.id}/panorama/point?azimuth_rad=4.0&elevation_rad=-0.2")
    assert "does not show" in problem(behind, 422, "outside-terrain")["detail"]
    sky = sqlite_api("GET", f"/missions/{mission.id}/panorama/point?azimuth_rad=0.87&elevation_rad=1.2")
    problem(sky, 422, "outside-terrain")


def test_a_hole_is_no_ground_for_a_target(sqlite_api: Api, mission: Mission) -> None:
    target = {"name": "hidden", "east_m": -2.9, "north_m": -2.9}
    refused = sqlite_api("POST", f"/missions/{mission.id}/targets", json=target)
    assert "lies in a hole" in problem(refused, 422, "outside-terrain")["detail"] or "outside" in refused.text


def test_an_archive_of_the_mission_holds_its_pictures(
    sqlite_api: Api, mission: Mission, tmp_path: Path
) -> None:
    archive = tmp_path / "mission.zip"
    export_mission(sqlite_api.repo, SYSTEM_ACTOR, mission.id, archive)
    names = zipfile.ZipFile(archive).namelist()
    assert [n for n in names if "wedge" in n] == [
        f"terrain/wedge0{k}_{side}.png" for k in (0, 1) for side in ("left", "right")
    ]
    zipfile.ZipFile(archive).extractall(tmp_path / "out")
    assert len(load_panorama(tmp_path / "out/terrain").wedges) == 2
