"""What the views are told: rover, cameras at a pose, coverage, panorama, places to stand."""

from __future__ import annotations

import io
import math
from dataclasses import replace
from pathlib import Path

import httpx
import numpy as np
import pytest
from PIL import Image

from ground.resources.missions.value import Mission
from ground.resources.site_views.look_around import tile_rays
from mission.soltime import SunClock
from rover_iface.cameras.panorama import camera_from_document
from rover_iface.cameras.rig import load_cameras
from rover_iface.profile import load_profile
from rover_iface.terrain import load_terrain, write_terrain
from tests.ground.conftest import Api, yard
from tests.ground.test_missions_api import TARGET, problem, upload


@pytest.fixture
def site(sqlite_api: Api, terrain_folder: Path) -> Mission:
    return yard(sqlite_api.repo, terrain_folder)


def test_the_rover_is_told_as_its_profile_and_cameras_say(sqlite_api: Api, site: Mission) -> None:
    profile, cameras = load_profile("k9"), load_cameras("k9")
    shape = sqlite_api.get(f"/missions/{site.id}/rover")
    assert shape["arm_reach_m"] == profile.arm.reach_m
    assert shape["shoulder_m"] == list(profile.arm.shoulder_m)
    assert shape["mast_pivot_m"][2] == profile.mast.height_m
    assert shape["cone_half_angle_rad"] == pytest.approx(math.radians(20.0))
    by_name = {camera["name"]: camera for camera in shape["cameras"]}
    assert set(by_name) == {name for name, camera in cameras.items() if camera.mount != "tool"}
    assert by_name["navcam_left"]["H"] == list(cameras["navcam_left"].model.H)
    noon = next(place for place in shape["sun"] if place["lmst_h"] == 12.0)
    truth = SunClock.at(120.0, -4.6, 12.0).direction(0.0)
    assert noon["direction"] == pytest.approx(truth, abs=2e-3)


def test_a_camera_looks_at_the_ground_it_is_pointed_to(sqlite_api: Api, site: Mission) -> None:
    place = "east_m=0&north_m=0&heading_rad=0.3&camera=navcam_left"
    view = sqlite_api.get(f"/missions/{site.id}/rover/view?{place}&at_east_m=4&at_north_m=1")
    camera = camera_from_document({**view["camera"], "model": view["camera"]["kind"]})
    height = sqlite_api.get(f"/missions/{site.id}/terrain/point?east_m=4&north_m=1")["up_m"]
    middle = np.array([(camera.width - 1) / 2, (camera.height - 1) / 2])
    assert camera.project(np.array([4.0, 1.0, height])) == pytest.approx(middle, abs=0.2)
    straight = sqlite_api.get(f"/missions/{site.id}/rover/view?{place}&camera=hazcam_left")
    assert straight["camera"]["A"][0] > 0.5
    wrong = sqlite_api("GET", f"/missions/{site.id}/rover/view?east_m=0&north_m=0&camera=periscope")
    assert 'no camera "periscope"' in problem(wrong, 422, "invalid-input")["detail"]
    off = sqlite_api("GET", f"/missions/{site.id}/rover/view?east_m=90&north_m=0&camera=navcam_left")
    problem(off, 422, "outside-terrain")


def test_coverage_tells_hidden_ground_from_seen_and_how_well_it_is_known(
    sqlite_api: Api, site: Mission
) -> None:
    answer = sqlite_api("GET", f"/missions/{site.id}/terrain/coverage?max_posts=102400")
    rows, columns = (int(n) for n in answer.headers["X-Outcrop-Shape"].split(","))
    west, south, east, north = (float(n) for n in answer.headers["X-Outcrop-Bounds"].split(","))
    code = np.frombuffer(answer.content, np.uint8).reshape(rows, columns)

    def at(x: float, y: float) -> int:
        row = round((north - y) / (north - south) * (rows - 1))
        return int(code[row, round((x - west) / (east - west) * (columns - 1))])

    # The boulder at (4, 1) is 12 cm high; from 1.5 m up its shadow of sight ends 0.4 m behind it.
    assert at(3.0, 0.75) > 1
    assert at(4.19, 1.05) == 1
    assert at(5.2, 1.3) > 1
    assert at(12.0, 0.0) > at(6.0, 0.0) > at(3.0, 0.0), "depth is known worse with distance"


def test_a_point_behind_a_rock_is_said_to_be_out_of_view_and_may_still_be_a_target(
    sqlite_api: Api, site: Mission
) -> None:
    """As in the coverage: the boulder at (4, 1) hides 0.4 m behind it."""
    point = f"/missions/{site.id}/terrain/point"
    assert sqlite_api.get(f"{point}?east_m=3&north_m=0.75")["in_view"]
    assert not sqlite_api.get(f"{point}?east_m=4.19&north_m=1.05")["in_view"]
    sqlite_api.post(f"/missions/{site.id}/targets", {"east_m": 4.19, "north_m": 1.05})


@pytest.fixture
def half_seen(sqlite_api: Api, terrain_folder: Path, tmp_path: Path) -> Mission:
    """The yard, but nobody ever saw what lies more than 6 m east."""
    terrain = load_terrain(terrain_folder)
    layer = terrain.layers[0]
    mask = np.ones(layer.heights.shape, dtype=bool)
    mask[:, round((6.0 - layer.west) / layer.spacing) :] = False
    write_terrain(replace(terrain, layers=(replace(layer, mask=mask),)), tmp_path / "half")
    return yard(sqlite_api.repo, tmp_path / "half", "Half seen")


def test_a_target_on_ground_that_was_never_observed_is_refused_wherever_it_comes_from(
    sqlite_api: Api, half_seen: Mission
) -> None:
    targets = f"/missions/{half_seen.id}/targets"
    for seen, east in ((True, 5.5), (False, 7.0)):
        point = sqlite_api.get(f"/missions/{half_seen.id}/terrain/point?east_m={east}&north_m=2")
        assert point["observed"] is seen
    answer = sqlite_api("POST", targets, {"east_m": 7.0, "north_m": 2.0})
    document = problem(answer, 422, "unobserved-ground")
    assert "the ground at (7.00, 2.00) was never observed" in document["detail"]
    assert document["errors"][0]["pointer"] == "/east_m"
    made = sqlite_api.post(targets, {"east_m": 5.5, "north_m": 2.0})
    moved = sqlite_api("PATCH", f"/targets/{made['id']}", {"east_m": 7.0}, headers={"If-Match": "*"})
    problem(moved, 422, "unobserved-ground")
    file = upload(sqlite_api, "g.csv", b"kind,name,east_m,north_m\ntarget,A,7.0,2.0\n")
    imported = sqlite_api("POST", f"/missions/{half_seen.id}/geometry", {"upload_id": file})
    assert imported.status_code == 422
    assert "was never observed" in imported.text
    assert [t["name"] for t in sqlite_api.get(targets)["items"]] == [made["name"]]


def test_the_panorama_shows_what_a_pick_in_it_hits(sqlite_api: Api, site: Mission) -> None:
    panorama = sqlite_api.get(f"/missions/{site.id}/panorama")
    span = panorama["tile_width"] * panorama["rad_per_px"]
    assert span * len(panorama["tiles"]) == pytest.approx(math.tau)
    tile = panorama["tiles"][0]
    assert not tile["ready"]
    image = sqlite_api("GET", tile["url"])
    assert image.headers["content-type"] == "image/jpeg"
    with Image.open(io.BytesIO(image.content)) as opened:
        assert opened.size == (panorama["tile_width"], panorama["tile_height"])
        pixels = np.asarray(opened)
    assert (pixels[:, :] > 0).mean() > 0.999, "no part of a tile lies outside its camera's frame"
    assert pixels.std() > 5
    assert sqlite_api.get(f"/missions/{site.id}/panorama")["tiles"][0]["ready"]

    # A pick in the middle of the tile lies on the ray of that pixel.
    azimuth = tile["left_azimuth_rad"] + span / 2
    point = sqlite_api.get(
        f"/missions/{site.id}/panorama/point?azimuth_rad={azimuth % math.tau}&elevation_rad=-0.3"
    )
    way = np.array([point["east_m"], point["north_m"], point["up_m"]]) - np.array(tile["eye_m"])
    ray = tile_rays(azimuth, -0.3, 0.0, 1, 1)[0, 0]
    assert way / np.linalg.norm(way) == pytest.approx(ray, abs=2e-4)

    sky = sqlite_api("GET", f"/missions/{site.id}/panorama/point?azimuth_rad=1&elevation_rad=0.4")
    assert "meets no ground within 100 m" in problem(sky, 422, "outside-terrain")["detail"]
    none = sqlite_api("GET", f"/missions/{site.id}/panorama/tiles/99")
    assert "it has 0 to" in problem(none, 404, "not-found")["detail"]


def test_a_place_to_stand_is_weighed_and_a_bad_one_refused_with_the_reason(
    sqlite_api: Api, site: Mission
) -> None:
    target = sqlite_api.post(f"/missions/{site.id}/targets", TARGET)
    request = sqlite_api.post(
        f"/missions/{site.id}/observation-requests",
        {"target_id": target["id"], "instrument": "microscopic_imager", "value": 10.0},
    )
    url = f"/observation-requests/{request['id']}"
    good = sqlite_api.get(f"{url}/stand?east_m=3.2&north_m=1.0")
    assert good["reachable"], good["reason"]
    assert good["pose"]["heading_rad"] == pytest.approx(0.0, abs=1e-6)
    assert 0.25 < good["reach_m"] < 0.79
    far = sqlite_api.get(f"{url}/stand?east_m=1.0&north_m=1.0")
    assert not far["reachable"]
    assert "the arm reaches 0.79 m" in far["reason"]
    away = sqlite_api.get(f"{url}/stand?east_m=3.2&north_m=1.0&heading_rad=3.0")
    assert not away["reachable"]

    def put(pose: dict[str, float], revision: int) -> httpx.Response:
        headers = {"If-Match": f'"{revision}"'}
        return sqlite_api("PATCH", url, {"observation_pose": pose}, headers=headers)

    refused = problem(put({"east_m": 1.0, "north_m": 1.0}, 1), 422, "target-unreachable")
    assert refused["errors"][0]["pointer"] == "/observation_pose"
    assert "the arm reaches 0.79 m" in refused["detail"]
    pose = {"east_m": 3.2, "north_m": 1.0, "heading_rad": 0.0}
    assert put(pose, 1).json()["observation_point"] == {
        "pose": pose,
        "reachable": True,
        "manual": True,
        "reason": "",
    }
    sqlite_api.post(
        f"/missions/{site.id}/keep-outs", {"polygon_m": [[2.9, 0.7], [3.5, 0.7], [3.5, 1.3], [2.9, 1.3]]}
    )
    assert "keep-out" in sqlite_api.get(f"{url}/stand?east_m=3.2&north_m=1.0")["reason"]
