"""When and where the sun stands over a site."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise
from typing import Annotated

from annotated_types import Ge, Le, MaxLen, MinLen

from mission.errors import MissionError
from mission.soltime import SunClock
from mission.values import value

LARGEST_STEP_S = 10_800.0
"""An eighth of a day of the Earth, the shortest of the days: the sun turns by 45 degrees in it."""
LARGEST_TURN_RAD = math.radians(46.0)
"""Between two samples: what the sun turns in the largest step, and a degree for refraction and rounding.

The cubic through directions that are no further apart keeps at least 0.9 of their length.
"""


@value
class SunCourse:
    """The sun's direction in even steps, as an ephemeris gives it.

    `directions` are unit vectors, east-north-up, at `first_s`, `first_s + step_s` ... seconds after
    `start_utc`, the start of the plan; two that follow each other are at most 46 degrees apart.
    """

    start_utc: str
    first_s: float
    step_s: Annotated[float, Ge(0.001), Le(LARGEST_STEP_S)]
    directions: Annotated[tuple[tuple[float, float, float], ...], MinLen(4), MaxLen(2000)]

    def __post_init__(self) -> None:
        try:
            start = datetime.fromisoformat(self.start_utc)
        except ValueError as err:
            raise MissionError(f"start_utc {self.start_utc!r} is not a time in ISO 8601") from err
        if start.tzinfo is None:
            raise MissionError(f"start_utc {self.start_utc} has no zone")
        for way in self.directions:
            if not abs(math.hypot(*way) - 1.0) <= 1e-6:  # NaN too
                raise MissionError(f"a direction of the sun has length {math.hypot(*way):g}; it must be 1")
        for number, (one, other) in enumerate(pairwise(self.directions), 1):
            turn = math.atan2(math.hypot(*_cross(one, other)), sum(map(operator.mul, one, other)))
            if turn > LARGEST_TURN_RAD:
                raise MissionError(
                    f"the sun turns by {math.degrees(turn):.1f} degrees between directions {number} and "
                    f"{number + 1}; at most {math.degrees(LARGEST_TURN_RAD):g} may be"
                )

    def reaches(self, t_s: float) -> bool:
        """Return whether a moment lies between the second sample and the last but one."""
        share = (t_s - self.first_s) / self.step_s
        return 1.0 <= share <= len(self.directions) - 2

    def direction(self, t_s: float) -> tuple[float, float, float]:
        """Return the unit vector to the sun, by the cubic through four samples round the moment."""
        share = (t_s - self.first_s) / self.step_s
        k = min(max(int(share), 1), len(self.directions) - 3)
        f = share - k
        weights = (
            -f * (f - 1.0) * (f - 2.0) / 6.0,
            (f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0,
            -(f + 1.0) * f * (f - 2.0) / 2.0,
            (f + 1.0) * f * (f - 1.0) / 6.0,
        )
        four = self.directions[k - 1 : k + 3]
        east, north, up = (sum(w * way[i] for w, way in zip(weights, four, strict=True)) for i in range(3))
        length = math.hypot(east, north, up)
        return east / length, north / length, up / length


def _cross(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@dataclass(frozen=True, slots=True)
class CourseClock(SunClock):
    """A clock whose sun is where a course has it, and where the formulas have it beyond the course."""

    course: SunCourse

    def direction(self, t_s: float) -> tuple[float, float, float]:
        if self.course.reaches(t_s):
            return self.course.direction(t_s)
        # not super(): a dataclass with slots is another class than the one that stands here
        return SunClock.direction(self, t_s)


@value
class Sky:
    """Season and place of the site, and local mean solar time at the start of the plan.

    Where an ephemeris was asked, `course` is what it said, and the others are for clocks.
    """

    ls_deg: float = 120.0
    latitude_deg: float = -4.6
    start_lmst_h: float = 10.0
    course: SunCourse | None = None

    def __post_init__(self) -> None:
        if not 0.0 <= self.start_lmst_h < 24.0:
            raise MissionError(f"start_lmst_h is {self.start_lmst_h:g}; it must be at least 0 and below 24")
        if not -90.0 <= self.latitude_deg <= 90.0:
            raise MissionError(f"latitude_deg is {self.latitude_deg:g}; it must lie in -90 to 90")

    def clock(self) -> SunClock:
        """Return the sun's course from the start of the plan on."""
        clock = SunClock.at(self.ls_deg, self.latitude_deg, self.start_lmst_h)
        if self.course is None:
            return clock
        return CourseClock(clock.start_utc, clock.latitude_deg, clock.longitude_east_deg, self.course)
