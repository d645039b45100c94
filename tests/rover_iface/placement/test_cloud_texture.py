"""Where a smooth rock fits itself in more than one place, its brightness tells where a cloud belongs."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from rover_iface.frames import Transform
from rover_iface.placement.cloud import Array, SurfaceCloud, cloud_of_points
from rover_iface.placement.cloud_alignment import align
from rover_iface.placement.cloud_texture import tie
from rover_iface.vision.sift_motion import small_rotation

CENTRE, RADIUS_M = np.array([1.0, 0.0, -2.8]), 3.0
TOP = CENTRE + np.array([0.0, 0.0, RADIUS_M])
HAZCAM, MAST = np.array([0.3, 0.1, 0.6]), np.array([0.15, 0.0, 1.45])
PATTERN = cv2.GaussianBlur(np.random.default_rng(3).standard_normal((400, 400)), (0, 0), 3.0)


def ball(eye: Array, pitch_m: float, seed: int, *, plain: bool = False) -> SurfaceCloud:
    """What an eye sees of a smooth face with dark and bright spots of a centimetre, half a millimetre off."""
    line = np.arange(-0.16, 0.16, pitch_m)
    x, y = (v.ravel() for v in np.meshgrid(line, line))
    rise = np.sqrt(RADIUS_M**2 - x**2 - y**2)
    noise = np.random.default_rng(seed).normal(0.0, 0.0005, (len(x), 3))
    cells = np.round((np.column_stack((x, y)) + 0.2) / 0.001).astype(np.int64)
    spots = PATTERN[cells[:, 1], cells[:, 0]]
    cloud = cloud_of_points(CENTRE + np.column_stack((x, y, rise)) + noise, sigma_m=0.001, eye=eye)
    return replace(cloud, intensity=np.full(len(x), 0.5) if plain else 0.5 + spots)


def slid(cloud: SurfaceCloud, along_m: float) -> SurfaceCloud:
    """The cloud as the mast has it that stands off in tilt: its surface slides along itself by so much."""
    return cloud.moved(slide(along_m))


def slide(along_m: float) -> Transform:
    turn = small_rotation(np.array([0.0, along_m / float(np.linalg.norm(TOP - MAST)), 0.0]))
    return Transform(turn, MAST - turn @ MAST)


def off_m(along_m: float, *, plain: bool) -> float:
    found = align(slid(ball(MAST, 0.0026, 1, plain=plain), along_m), ball(HAZCAM, 0.003, 0, plain=plain))
    assert found is not None
    return float(np.linalg.norm(found.motion.apply(slide(along_m).apply(TOP)) - TOP))


def test_a_cloud_that_slid_over_a_smooth_rock_is_brought_back_by_its_brightness() -> None:
    assert off_m(0.008, plain=True) > 0.004
    assert off_m(0.008, plain=False) < 0.0015


def test_the_shift_is_told_across_the_surface_to_a_fraction_of_a_cell() -> None:
    first, second = ball(HAZCAM, 0.003, 0), slid(ball(MAST, 0.0026, 1), 0.005)
    found = tie(second, first)
    assert found is not None
    shift = found.place - second.points[found.number]
    assert np.linalg.norm(shift) == pytest.approx(0.005, abs=0.001)
    assert abs(shift @ np.cross(*found.along)) < 1e-9


@pytest.mark.parametrize("seed", range(3))
def test_other_spots_tell_nothing(seed: int) -> None:
    first, second = ball(HAZCAM, 0.003, 0), ball(MAST, 0.0026, 1)
    assert second.intensity is not None
    other = np.random.default_rng(seed).permutation(second.intensity)
    assert tie(replace(second, intensity=other), first) is None


def test_without_brightness_the_shape_alone_decides() -> None:
    first, second = ball(HAZCAM, 0.003, 0), ball(MAST, 0.0026, 1)
    assert tie(replace(second, intensity=None), first) is None
    assert tie(second, replace(first, intensity=None)) is None
    assert align(replace(second, intensity=None), first) is not None
