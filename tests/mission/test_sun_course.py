"""What a course of the sun refuses."""

from __future__ import annotations

import math

import pytest

from mission.errors import MissionError
from mission.sky import SunCourse

UP = ((0.0, 0.0, 1.0),) * 4


def test_a_start_that_is_no_time_is_named() -> None:
    with pytest.raises(MissionError, match="yesterday"):
        SunCourse("yesterday", 0.0, 60.0, UP)


def test_a_direction_that_is_no_number_is_refused() -> None:
    with pytest.raises(MissionError, match="length nan"):
        SunCourse("2026-11-22T10:00:00Z", 0.0, 60.0, (*UP, (math.nan, 0.0, 1.0)))
