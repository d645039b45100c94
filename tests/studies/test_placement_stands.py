"""The study of placements, from another stand of the rover."""

from __future__ import annotations

import numpy as np
import pytest

from rover_iface.frames import Pose
from studies.common.placement_rocks import rock_scene
from studies.common.true_surface import TrueLimits
from studies.placement import designated

SEED = 15_000


def test_the_same_rock_stands_before_the_rover_wherever_it_stands() -> None:
    stand = Pose(0.3, -0.2, 0.02, 0.4, 0.05, -0.03)
    rover = stand.site_from_rover.inverse()
    here, there = rock_scene(SEED), rock_scene(SEED, stand)
    picked = designated(here)[0]
    normal = np.array([-0.3, 0.1, 0.9]) / np.linalg.norm([-0.3, 0.1, 0.9])
    at, up = (np.asarray(v, dtype=np.float64) for v in (rover.apply(picked), rover.rotate(normal)))
    one = here.true_patch(picked, normal, 0.03, TrueLimits())
    other = there.true_patch(at, up, 0.03, TrueLimits())
    # the rays of the truth lie on another raster round the same axis
    assert other.protrusion_m == pytest.approx(one.protrusion_m, abs=0.003)
    assert other.depth_m == pytest.approx(one.depth_m, abs=0.003)
    assert other.slope_rad == pytest.approx(one.slope_rad, abs=0.01)
    assert there.centre == pytest.approx(rover.apply(here.centre))
    assert there.sun.direction == pytest.approx(rover.rotate(here.sun.direction))
