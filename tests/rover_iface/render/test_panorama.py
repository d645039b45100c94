"""The stereo panorama: rendered, kept, shown as a mosaic, picked from."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from rover_iface.cameras.panorama import Panorama, load_panorama
from rover_iface.errors import CameraError
from rover_iface.frames import Pose
from rover_iface.simulator.render.panorama import take_panorama
from tests.rover_iface.render.scenes import SUN, rig, rock_renderer

POSE = Pose(-5.0, 0.0, 0.0, 0.2)


@pytest.fixture(scope="module")
def panorama() -> Panorama:
    return take_panorama(
        rock_renderer(), rig(), POSE, SUN, from_azimuth_rad=0.6, span_rad=1.2, name="start", t_s=12.0
    )


def test_a_point_picked_in_the_panorama_is_the_surface_there_within_its_covariance(
    panorama: Panorama,
) -> None:
    scene = rock_renderer().scene
    eye = panorama.eye
    for point in ((-0.45, 0.0, 0.4), (-0.4, -0.15, 0.5), (-2.0, 0.5, 0.0)):
        ray = np.array(point) - eye
        azimuth, elevation = math.atan2(ray[0], ray[1]), math.asin(ray[2] / np.linalg.norm(ray))
        wedge, pixel = panorama.find(azimuth, elevation)
        match = wedge.pick(pixel)
        origin, direction = wedge.left_camera.back_project(pixel)
        truth = origin + float(scene.ranges(origin, direction[None])[0]) * direction
        off = match.point - truth
        assert np.linalg.norm(off) < 0.06
        assert off @ np.linalg.solve(match.covariance, off) < 16.0
        assert match.normal @ (wedge.left_camera.C - match.point) > 0


def test_a_panorama_is_the_same_after_it_was_kept(panorama: Panorama, tmp_path: Path) -> None:
    again = load_panorama(panorama.save(tmp_path / "pan"))
    assert again.name == "start"
    assert again.t_s == 12.0
    for one, two in zip(panorama.wedges, again.wedges, strict=True):
        assert np.array_equal(one.left, two.left)
        assert np.array_equal(one.right, two.right)
        assert np.allclose(one.left_camera.packed, two.left_camera.packed, atol=1e-12)


def test_the_mosaic_shows_the_wedges_in_place(panorama: Panorama) -> None:
    mosaic, edges = panorama.mosaic(1024)
    wedge = panorama.wedges[0]
    pixel = np.array([500.0, 400.0])
    ray = wedge.left_camera.back_project(pixel)[1]
    azimuth, elevation = math.atan2(ray[0], ray[1]) % math.tau, math.asin(ray[2])
    column = round((azimuth - edges["left_azimuth_rad"]) / edges["rad_per_px"])
    row = round((edges["top_elevation_rad"] - elevation) / edges["rad_per_px"])
    found, at = panorama.find(azimuth, elevation)
    there = found.left[int(at[1]) - 6 : int(at[1]) + 7, int(at[0]) - 6 : int(at[0]) + 7]
    assert mosaic[row - 1 : row + 2, column - 1 : column + 2].mean() == pytest.approx(there.mean(), abs=20)
    assert (mosaic == 0).mean() > 0.5  # only 69 degrees of the horizon were taken


def test_what_the_panorama_cannot_give_is_refused(panorama: Panorama, tmp_path: Path) -> None:
    with pytest.raises(CameraError, match="does not show azimuth"):
        panorama.pick(math.radians(270.0), 0.0)
    with pytest.raises(CameraError, match="no stereo at pixel"):
        panorama.wedges[0].pick((2.0, 2.0))
    with pytest.raises(CameraError, match="cannot be read"):
        load_panorama(tmp_path)
    (tmp_path / "panorama.json").write_text(json.dumps({"format": "panorama/9"}))
    with pytest.raises(CameraError, match="panorama/9"):
        load_panorama(tmp_path)
    with pytest.raises(CameraError, match="at least one wedge"):
        Panorama([])
