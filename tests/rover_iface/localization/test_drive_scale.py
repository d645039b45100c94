"""The scale of visual odometry from legs with rocks: unbiased, with the deviation it says."""

from __future__ import annotations

import numpy as np
import pytest

from rover_iface.errors import LocalizationError
from rover_iface.frames import Transform
from rover_iface.localization.drive_scale import MeasuredLeg, drive_scale


def test_the_scale_is_found_as_well_as_it_says() -> None:
    rng = np.random.default_rng(3)
    normal = []
    for _ in range(400):
        scale = 1.0 + rng.normal(0, 0.005)
        legs = []
        for _ in range(12):
            true = rng.uniform(20, 30)
            measured = true / scale + rng.normal(0, 0.02)
            legs.append(MeasuredLeg(measured, 0.02, true + rng.normal(0, 0.15), 0.15))
        found = drive_scale(legs, 0.005)
        normal.append((found.scale - scale) / found.sigma)
    assert found.sigma == pytest.approx(0.15 / 25 / np.sqrt(12), rel=0.1)
    assert np.std(normal) == pytest.approx(1.0, abs=0.1)
    assert np.mean(normal) == pytest.approx(0.0, abs=0.15)


def test_without_legs_it_is_the_prior_and_wrong_numbers_are_named() -> None:
    nothing = drive_scale([], 0.005)
    assert (nothing.scale, nothing.sigma) == (1.0, 0.005)
    moved = nothing.corrected(Transform(np.eye(3), np.array([3.0, 0.0, 0.0])))
    assert moved.translation == pytest.approx([3.0, 0.0, 0.0])
    with pytest.raises(LocalizationError, match="deviation of 0"):
        drive_scale([], 0.0)
    with pytest.raises(LocalizationError, match=r"a leg of 20\.0 m has deviations 0\.1 and 0\.0 m"):
        drive_scale([MeasuredLeg(20.0, 0.1, 20.0, 0.0)], 0.01)
