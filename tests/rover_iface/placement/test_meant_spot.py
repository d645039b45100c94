"""The designated pixel of the navcams in their cloud, once that is registered to the hazcams'."""

from __future__ import annotations

import numpy as np
import pytest

from rover_iface.behaviour.close_look import HANDED_M, meant_on
from rover_iface.cameras.model import CameraModel
from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.frames import Transform
from rover_iface.placement.cloud import Array, cloud_of_points
from rover_iface.placement.cloud_alignment import Alignment
from rover_iface.vision.sift_motion import small_rotation

AT = np.array([1.0, 0.05, 0.15])
OFF = np.array([0.004, -0.003, 0.002])
"""What the hand-off errs."""


@pytest.fixture
def camera() -> CameraModel:
    """The left navcam as the mast's angles say."""
    rig = CameraRig(load_cameras("k9"), (0.15, 0.0, 1.45))
    return rig.camera("navcam_left", *rig.point_at(AT, "navcam_left"))


def laid(camera: CameraModel, cut: Array | None = None, cliff: bool = False) -> Alignment:
    """A slanted surface as the navcams range it, off by a degree until it was registered."""
    motion = Transform(small_rotation(np.array([0.01, 0.015, -0.02])), np.array([0.01, -0.02, 0.005]))
    line = np.arange(-0.08, 0.08, 0.0025)
    x, y = (v.ravel() for v in np.meshgrid(line, line))
    points = AT + np.column_stack((x, y, 0.3 * x))
    if cliff:
        # beyond an edge the ground lies 15 cm lower
        points[x > 0.002, 2] -= 0.15
    if cut is not None:
        points = points[np.linalg.norm(points - AT, axis=1) > cut]
    cloud = cloud_of_points(points, sigma_m=0.001, eye=motion.apply(camera.C))
    return Alignment(cloud, motion, 0.0, 0.001, 1.0, 0.001)


def pixel_of(camera: CameraModel, alignment: Alignment, point: Array) -> Array:
    """Where the picture truly shows a point: by where the camera truly stands."""
    return np.asarray(camera.transformed(alignment.motion).project(point))


def test_the_designated_pixel_is_found_on_the_registered_cloud(camera: CameraModel) -> None:
    found = laid(camera)
    place = meant_on(found, camera, pixel_of(camera, found, AT), AT + OFF)
    assert place is not None
    assert np.linalg.norm(place - AT) < 0.0005
    # by the mast's angles alone it is centimetres off
    unmoved = Alignment(found.cloud, Transform.identity(), 0.0, 0.001, 1.0, 0.001)
    other = meant_on(unmoved, camera, pixel_of(camera, found, AT), AT + OFF)
    assert other is None or np.linalg.norm(other - AT) > 0.01


def test_what_lies_behind_an_edge_does_not_pull_the_place_away(camera: CameraModel) -> None:
    found = laid(camera, cliff=True)
    place = meant_on(found, camera, pixel_of(camera, found, AT), AT + OFF)
    assert place is not None
    assert np.linalg.norm(place - AT) < 0.001


def test_a_hole_in_the_cloud_tells_nothing(camera: CameraModel) -> None:
    found = laid(camera, cut=np.asarray(0.02))
    assert meant_on(found, camera, pixel_of(camera, found, AT), AT + OFF) is None


def test_a_pixel_far_from_where_the_target_was_handed_off_is_another_spot(camera: CameraModel) -> None:
    found = laid(camera)
    beside = AT + np.array([0.0, HANDED_M + 0.005, 0.0])
    assert meant_on(found, camera, pixel_of(camera, found, beside), AT) is None
