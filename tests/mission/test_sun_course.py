"""What a course of the sun refuses."""

from __future__ import annotations

import math
import random

import pytest
from pydantic import TypeAdapter, ValidationError

from mission.errors import MissionError
from mission.sky import LARGEST_STEP_S, SunCourse

UP = ((0.0, 0.0, 1.0),) * 4


def test_a_start_that_is_no_time_is_named() -> None:
    with pytest.raises(MissionError, match="yesterday"):
        SunCourse("yesterday", 0.0, 60.0, UP)


def test_a_direction_that_is_no_number_is_refused() -> None:
    with pytest.raises(MissionError, match="length nan"):
        SunCourse("2026-11-22T10:00:00Z", 0.0, 60.0, (*UP, (math.nan, 0.0, 1.0)))


def test_directions_that_cancel_are_refused_by_number() -> None:
    """Half way between two opposite directions there is none: it was a division by zero."""
    cancelling = ((0.0, 0.0, 1.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 0.0, -1.0))
    with pytest.raises(MissionError, match=r"turns by 180\.0 degrees between directions 2 and 3; at most 46"):
        SunCourse("2026-11-22T10:00:00Z", 0.0, 600.0, cancelling)


def test_the_longest_step_is_an_eighth_of_the_shortest_day() -> None:
    read = TypeAdapter(SunCourse).validate_python
    given = {"start_utc": "2026-11-22T10:00:00Z", "first_s": 0.0, "directions": UP}
    assert read({**given, "step_s": LARGEST_STEP_S}).step_s == 86_400 / 8
    for step in (0.0, 1e-300, LARGEST_STEP_S + 1, 1e300):
        with pytest.raises(ValidationError, match="step_s"):
            read({**given, "step_s": step})


def test_whatever_is_taken_gives_a_direction_of_length_one_at_every_moment() -> None:
    """200 courses that turn as far as they may, each time to another side."""
    draw = random.Random(20261123)
    for _ in range(200):
        ways = [(0.0, 0.0, 1.0)]
        while len(ways) < 12:
            turn, about = math.radians(45.9), draw.uniform(0.0, 2 * math.pi)
            east, north, up = ways[-1]
            helper = (1.0, 0.0, 0.0) if abs(east) < 0.9 else (0.0, 1.0, 0.0)
            dot = east * helper[0] + north * helper[1] + up * helper[2]
            side = [h - dot * w for h, w in zip(helper, ways[-1], strict=True)]
            size = math.hypot(*side)
            one = [s / size for s in side]
            two = (north * one[2] - up * one[1], up * one[0] - east * one[2], east * one[1] - north * one[0])
            off = [math.cos(about) * a + math.sin(about) * b for a, b in zip(one, two, strict=True)]
            new = [math.cos(turn) * w + math.sin(turn) * o for w, o in zip(ways[-1], off, strict=True)]
            ways.append((new[0] / math.hypot(*new), new[1] / math.hypot(*new), new[2] / math.hypot(*new)))
        course = SunCourse("2026-11-22T10:00:00Z", 0.0, 600.0, tuple(ways))
        for _ in range(50):
            t_s = draw.uniform(600.0, 600.0 * (len(ways) - 2))
            assert course.reaches(t_s)
            assert math.hypot(*course.direction(t_s)) == pytest.approx(1.0)
