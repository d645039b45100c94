"""Transforms and frame conventions."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_iface.errors import FrameError
from rover_iface.frames import (
    NED_FROM_ENU,
    Pose,
    Transform,
    across,
    quaternion_of,
    rotation_from_quaternion,
    rpy_of,
    site_from_rover_flu,
    wrap_angle,
)
from tests.shared import shared

angle = st.floats(-math.pi, math.pi)
pitch = st.floats(-1.5, 1.5)
length = st.floats(-100, 100)
transforms = st.builds(
    lambda r, p, y, a, b, c: Transform.from_rpy(r, p, y, (a, b, c)),
    angle,
    pitch,
    angle,
    length,
    length,
    length,
)


@given(transforms)
def test_a_transform_times_its_inverse_is_identity(a_from_b: Transform) -> None:
    both = a_from_b * a_from_b.inverse()
    assert np.allclose(both.rotation, np.eye(3), atol=1e-12)
    assert np.allclose(both.translation, 0, atol=1e-9)


@given(transforms, transforms, st.tuples(length, length, length))
def test_a_product_applies_the_right_factor_first(
    a_from_b: Transform, b_from_c: Transform, point: tuple[float, float, float]
) -> None:
    assert np.allclose((a_from_b * b_from_c).apply(point), a_from_b.apply(b_from_c.apply(point)), atol=1e-9)


@given(angle, pitch, angle)
def test_angles_survive_the_way_through_a_matrix_and_a_quaternion(r: float, p: float, y: float) -> None:
    rotation = Transform.from_rpy(r, p, y).rotation
    assert np.allclose(Transform.from_rpy(*rpy_of(rotation)).rotation, rotation, atol=1e-9)
    assert np.allclose(rotation_from_quaternion(*quaternion_of(rotation)), rotation, atol=1e-9)


@given(transforms)
def test_the_rovers_convention_and_back_is_identity(pose: Transform) -> None:
    back = site_from_rover_flu(site_from_rover_flu(pose))
    assert np.allclose(back.rotation, pose.rotation, atol=1e-12)
    assert np.allclose(back.translation, pose.translation)


def test_north_east_nadir() -> None:
    assert (NED_FROM_ENU @ [1.0, 2.0, 3.0]).tolist() == [2.0, 1.0, -3.0]


def test_heading_is_counter_clockwise_from_east_and_positive_pitch_puts_the_nose_down() -> None:
    forward = Pose(0, 0, 0, heading=math.pi / 2, pitch=0.1).site_from_rover.rotate([1.0, 0.0, 0.0])
    assert np.allclose(forward, [0.0, math.cos(0.1), -math.sin(0.1)])


@given(st.floats(-50, 50))
def test_wrapped_angles_are_the_same_direction(a: float) -> None:
    w = wrap_angle(a)
    assert -math.pi < w <= math.pi
    assert math.cos(w) == pytest.approx(math.cos(a), abs=1e-9)


@given(angle, pitch, angle)
def test_a_pose_survives_its_transform(r: float, p: float, y: float) -> None:
    pose = Pose(1, 2, 3, y, p, r)
    again = Pose.from_transform(pose.site_from_rover)
    assert np.allclose(again.site_from_rover.rotation, pose.site_from_rover.rotation, atol=1e-9)
    assert pose.tilt == pytest.approx(math.acos(math.cos(r) * math.cos(p)), abs=1e-7)


def test_what_is_no_rotation_is_refused() -> None:
    with pytest.raises(FrameError, match="matrix is not a rotation"):
        Transform(np.diag([1.0, 1.0, -1.0]), np.zeros(3))
    with pytest.raises(FrameError, match="no direction"):
        rotation_from_quaternion(0, 0, 0, 0)
    with pytest.raises(FrameError, match="3x3 and 3"):
        Transform(np.eye(2), np.zeros(3))


def test_spirits_138_site_frames_chain_to_the_published_place() -> None:
    """The README of the data gives site 138 at N -2034.054, E 3104.650, D -80.972 m, 5480.7 m along the
    chain (on the map).
    """
    tree = ElementTree.parse(shared("data/terrain/mer_spirit/mer2_master.svf"))
    here = Transform.identity()
    way = 0.0
    steps = 0
    for solution in tree.iter():
        if not solution.tag.endswith("solution"):
            continue
        offset = next((e for e in solution.iter() if e.tag.endswith("offset")), None)
        turn = next((e for e in solution.iter() if e.tag.endswith("orientation")), None)
        if offset is None or turn is None:
            continue
        q = [float(turn.attrib[k]) for k in ("s", "v1", "v2", "v3")]
        t = [float(offset.attrib[k]) for k in ("x", "y", "z")]
        here = here * Transform(rotation_from_quaternion(*q), np.array(t))
        way += math.hypot(t[0], t[1])
        steps += 1
    assert steps >= 137
    assert np.allclose(here.translation, [-2034.054, 3104.650, -80.972], atol=2e-3)
    assert way == pytest.approx(5480.7, abs=0.1)


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (0.6, 0.0, 0.8), (-0.48, 0.64, 0.6)])
def test_two_axes_lie_across_a_normal(normal: tuple[float, float, float]) -> None:
    axes = np.vstack((across(normal), normal))
    assert np.allclose(axes @ axes.T, np.eye(3))
    assert np.linalg.det(axes) == pytest.approx(1.0)
