"""A folder of pictures as a mission whose panorama is those pictures."""

from __future__ import annotations

import io
import math
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
import typer
from PIL import Image
from sqlalchemy import select
from typer.testing import CliRunner

from ground.cli import image, terrain
from ground.gdr.migrate import migrate
from ground.gdr.repository import open_repository
from ground.records.actor import SYSTEM_ACTOR
from ground.resources.mission_archives.mission_archive import export_mission
from ground.resources.mission_setup.create_mission import FolderTerrain, create_mission
from ground.resources.missions.row import MissionRow
from ground.resources.missions.value import Mission
from ground.resources.sols.create_sol import create_sol
from ground.settings import load_settings
from rover_iface.cameras.calibrated import CALIBRATIONS
from rover_iface.cameras.panorama import load_panorama
from rover_iface.reconstruction.site_model import SiteOptions, reconstruct
from rover_iface.terrain import write_terrain
from tests.ground.conftest import Api
from tests.ground.test_missions_api import problem
from tests.rover_iface.reconstruction.products import rendered, rendered_folder, site
from tests.shared import shared


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
    # the rover looked to its front, on both sides of 0.7 rad from east; the page opens at the strip's middle
    left = strip["tiles"][0]["left_azimuth_rad"]
    middle = left + 0.5 * shown.shape[1] * strip["rad_per_px"]
    assert middle == pytest.approx(math.pi / 2 - 0.7 + 0.05, abs=0.15)
    filled = np.flatnonzero(shown.max(axis=0) > 40)
    assert filled[0] == pytest.approx(shown.shape[1] - 1 - filled[-1], abs=16)
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


def run(*arguments: str) -> tuple[int, str]:
    app = typer.Typer()
    for group in (terrain, image):
        group.register(app)
    result = CliRunner().invoke(app, list(arguments))
    return result.exit_code, result.output


def test_one_command_makes_terrain_panorama_and_mission(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    monkeypatch.setenv("OUTCROP_DATA_DIR", str(tmp_path / "data"))
    migrate(open_repository(load_settings()).database)
    pictures, out = str(folder.with_name("pictures")), tmp_path / "out"
    asked = ("terrain", "from-images", pictures, "--out", str(out), "--mission", "Real")
    code, said = run(*asked)
    assert code == 2
    assert "--under-rover" in said
    code, said = run(*asked, "--under-rover", "3", "--replace")
    assert code == 0, said
    assert "2N0LEFT: " in said
    assert "% seen" in said
    assert "mission msn-" in said
    with open_repository(load_settings()).database.read() as session:
        assert [row.name for row in session.scalars(select(MissionRow))] == ["Real"]
    code, said = run("terrain", "query", str(out), "5", "4")
    assert code == 0
    assert "known to" in said
    code, said = run("terrain", "query", str(out), "--", "-2.5", "-2.5")
    assert code == 2
    assert "hole" in said or "outside" in said


def test_what_cannot_be_used_is_told_and_nothing_is_written(tmp_path: Path, folder: Path) -> None:
    alone, out = tmp_path / "alone", tmp_path / "out"
    alone.mkdir()
    shutil.copyfile(folder.with_name("pictures") / "2n0left.img", alone / "2n0left.img")
    code, said = run("terrain", "from-images", str(alone), "--out", str(out))
    assert code == 2
    assert "2N0LEFT: no-partner: no right picture of NAVCAM in the folder" in said
    assert not out.exists()
    code, said = run("terrain", "from-images", str(alone), "--out", str(out), "--reach", "-1")
    assert code == 2
    assert "must be positive" in said


def test_a_rig_is_calibrated_from_a_folder_of_boards(tmp_path: Path) -> None:
    boards, out = shared("data/imagery/opencv"), tmp_path / "stereo.json"
    names = ("--left", "left[0-9]*.jpg", "--right", "right[0-9]*.jpg")
    code, said = run("image", "calibrate", str(boards), "--out", str(out), "--square", "0.025", *names)
    assert code == 0, said
    assert "13 boards, corners fit to 0.22 px" in said
    assert CALIBRATIONS.read_file(out).boards == 13
    code, said = run("image", "calibrate", str(tmp_path), "--out", str(out), "--square", "0.025")
    assert code == 2
    assert "0 left and 0 right pictures" in said
