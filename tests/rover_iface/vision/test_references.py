"""Which pairs that are kept of a target show it as it is seen now."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rover_iface.cameras.model import Array
from rover_iface.vision.narrow.references import Kept, References, angle_rad

PLACE = np.array([6.0, 0.0, 0.0])


def taken_from(bearing_deg: float, away_m: float = 6.0, t_s: float = 0.0) -> Kept:
    """Return a pair of a target that was taken from a bearing of it."""
    camera = SimpleNamespace(C=eye(bearing_deg, away_m))
    side: Any = SimpleNamespace(view=SimpleNamespace(left_camera=camera, t_s=t_s))
    return Kept(side, np.zeros(2), PLACE, 0.001)


def eye(bearing_deg: float, away_m: float = 6.0) -> Array:
    angle = math.radians(bearing_deg)
    return PLACE - away_m * np.array([math.cos(angle), math.sin(angle), 0.0])


def test_the_pairs_from_nearest_to_the_line_of_sight_come_first() -> None:
    first, left, right = taken_from(0.0), taken_from(40.0), taken_from(-30.0, 9.0)
    known = References([first, left, right])
    assert known.likeliest(eye(35.0, 3.0), PLACE, 0.0) == [left, first]
    assert known.likeliest(eye(-80.0), PLACE, 0.0, most=1) == [right]
    assert left.turned_rad(eye(10.0, 2.0), PLACE) == pytest.approx(math.radians(30.0))


def test_of_pairs_from_one_side_the_one_in_the_same_light_comes_first() -> None:
    morning, noon = taken_from(0.0), taken_from(20.0, t_s=4 * 3600.0)
    known = References([morning, noon])
    assert noon.sun_rad(5 * 3600.0) == pytest.approx(math.radians(15.0))
    assert known.likeliest(eye(5.0), PLACE, 4.5 * 3600.0, most=1) == [noon]
    assert known.likeliest(eye(5.0), PLACE, 1800.0, most=1) == [morning]


def test_another_pair_is_due_once_line_or_sun_have_turned_from_all_and_since_a_try() -> None:
    known = References([taken_from(0.0)])
    by, again = math.radians(25.0), math.radians(8.0)

    def due(*bearings: float, t_s: float = 0.0) -> list[bool]:
        return [known.outdated(eye(bearing), PLACE, t_s, by, again) for bearing in bearings]

    assert due(0, 20, 30, 33) == [False, False, True, True]
    assert due(0, t_s=5000.0) == [False]
    assert due(0, t_s=6100.0) == [True]
    known.tried = PLACE - eye(30.0), 0.0
    assert due(33, 39) == [False, True]
    assert due(33, t_s=2000.0) == [True]
    known.keep(taken_from(39.0))
    assert known.tried is None
    assert due(60, 65) == [False, True]
    assert angle_rad(PLACE, 2.0 * PLACE) == 0.0
