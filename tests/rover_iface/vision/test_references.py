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


def taken_from(bearing_deg: float, away_m: float = 6.0) -> Kept:
    """Return a pair of a target that was taken from a bearing of it."""
    side: Any = SimpleNamespace(view=SimpleNamespace(left_camera=SimpleNamespace(C=eye(bearing_deg, away_m))))
    return Kept(side, np.zeros(2), PLACE, 0.001)


def eye(bearing_deg: float, away_m: float = 6.0) -> Array:
    angle = math.radians(bearing_deg)
    return PLACE - away_m * np.array([math.cos(angle), math.sin(angle), 0.0])


def test_the_pairs_from_nearest_to_the_line_of_sight_come_first() -> None:
    first, left, right = taken_from(0.0), taken_from(40.0), taken_from(-30.0, 9.0)
    known = References([first, left, right])
    assert known.likeliest(eye(35.0, 3.0), PLACE) == [left, first]
    assert known.likeliest(eye(-80.0), PLACE, most=1) == [right]
    assert left.turned_rad(eye(10.0, 2.0), PLACE) == pytest.approx(math.radians(30.0))


def test_another_pair_is_due_once_the_line_has_turned_from_all_and_was_not_tried() -> None:
    known = References([taken_from(0.0)])
    by, again = math.radians(25.0), math.radians(8.0)
    due = [known.turned(eye(bearing), PLACE, by, again) for bearing in (0, 20, 30, 33)]
    assert due == [False, False, True, True]
    known.tried.append(PLACE - eye(30.0))
    assert [known.turned(eye(bearing), PLACE, by, again) for bearing in (33, 39)] == [False, True]
    known.keep(taken_from(39.0))
    assert not known.tried
    assert [known.turned(eye(bearing), PLACE, by, again) for bearing in (60, 65)] == [False, True]
    assert angle_rad(PLACE, 2.0 * PLACE) == 0.0
