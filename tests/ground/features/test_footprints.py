"""The ground in an image, against closed forms and against each ground point asked by itself."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from ground.resources.features.footprints import footprint, seen_ground
from rover_iface.cameras.model import pinhole
from rover_iface.cameras.panorama import camera_document
from rover_iface.terrain import Terrain, write_terrain
from tests.rover_iface.worlds import bumpy, plane


def walled(height_m: float) -> Terrain:
    """Return flat ground with a wall from east 6.0 to 6.5 m, as high as told."""
    return bumpy(lambda x, y: np.where((x > 5.99) & (x < 6.51), height_m, 0.0) + 0.0 * y, half=20.0)


def test_a_camera_straight_down_sees_a_square() -> None:
    camera = pinhole(focal_px=100, width=100, height=100, center=(1, 2, 4), forward=(0, 0, -1), up=(0, 1, 0))
    shape = seen_ground(camera, plane())
    assert shape is not None
    assert shape.symmetric_difference(shapely.box(-1, 0, 3, 4)).area < 1e-6


@given(st.floats(25, 70), st.floats(1.0, 3.0), st.floats(-math.pi, math.pi))
@settings(max_examples=30, deadline=None)
def test_a_camera_aslant_sees_the_trapezoid_of_its_four_corners(
    down_deg: float, up_m: float, heading: float
) -> None:
    tilt = math.radians(down_deg)
    ahead = (math.cos(heading) * math.cos(tilt), math.sin(heading) * math.cos(tilt), -math.sin(tilt))
    camera = pinhole(focal_px=400, width=200, height=160, center=(0, 0, up_m), forward=ahead)
    ring = []
    for sample, line in ((-0.5, -0.5), (199.5, -0.5), (199.5, 159.5), (-0.5, 159.5)):
        _, way = camera.back_project([sample, line])
        ring.append(-up_m / way[2] * way[:2])
    shape = seen_ground(camera, plane(half=60.0, spacing=1.0))
    assert shape is not None
    assert shape.symmetric_difference(shapely.Polygon(ring)).area < 1e-3 * shape.area


def test_flat_ground_is_seen_up_to_the_reach_below_the_horizon() -> None:
    camera = pinhole(focal_px=64, width=128, height=128, center=(0, 0, 1.0), forward=(1, 0, 0))
    shape = seen_ground(camera, plane(), 9.0)
    assert shape is not None
    assert 8.0 < shape.bounds[2] <= 9.0
    assert not shape.contains(shapely.Point(-1, 0))


def test_ground_behind_a_wall_is_not_in_the_image() -> None:
    camera = pinhole(
        focal_px=300, width=300, height=300, center=(0, 0, 1.5), forward=(1, 0, -0.15), up=(0, 0, 1)
    )
    behind = shapely.box(8.0, -0.5, 9.0, 0.5)
    before = shapely.box(4.5, -0.5, 5.5, 0.5)
    open_view, hidden = seen_ground(camera, walled(0.0)), seen_ground(camera, walled(2.0))
    assert open_view is not None
    assert hidden is not None
    assert open_view.contains(behind)
    assert open_view.contains(before)
    assert not hidden.intersects(behind)
    assert hidden.contains(before)


def test_a_label_of_any_rover_gives_what_can_be_read(tmp_path: Path) -> None:
    folder = write_terrain(plane(), tmp_path / "flat")
    camera = pinhole(focal_px=100, width=100, height=100, center=(1, 2, 4), forward=(0, 0, -1), up=(0, 1, 0))
    seen = footprint({"camera_model": camera_document(camera), "point_m": [1.0, 2.0, 0.0]}, folder)
    assert seen is not None
    assert seen.area == pytest.approx(16.0)
    for model in ({"model": "CAHVOX"}, "none", {"model": "CAHV", "width": -1, "height": 1e9}, None):
        told = footprint({"camera_model": model, "point_m": [1.0, 2.0, 0.0]}, folder)
        assert told == shapely.Point(1.0, 2.0)
    sky = pinhole(focal_px=100, width=100, height=100, center=(1, 2, 4), forward=(1, 0, 1))
    assert footprint({"camera_model": camera_document(sky)}, folder) is None
