"""Sols that follow each other: a battery, the time of each sol's work, and the power until next morning.

Times are seconds, energies joules, powers watts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Le, MaxLen, MinLen

from mission.codec import Codec
from mission.errors import MissionError
from mission.values import NotNegative, Positive, value

MAX_SOLS = 30
"""By hand: what is planned further ahead than a month is overtaken by what the first sols find."""

SolNumber = Annotated[int, Ge(1), Le(MAX_SOLS)]


@value
class Battery:
    """A battery: what it holds at most, in the first morning, and at least at any instant."""

    capacity_j: Positive
    charge_j: NotNegative
    floor_j: NotNegative = 0.0

    def __post_init__(self) -> None:
        if self.charge_j > self.capacity_j:
            raise MissionError(f"charge_j is {self.charge_j:g}; it must be at most {self.capacity_j:g}")
        if self.floor_j > self.charge_j:
            raise MissionError(f"floor_j is {self.floor_j:g}; it must be at most charge_j, {self.charge_j:g}")


@value
class PowerSegment:
    """A time of constant power: what the sun gives, and what sleep and heaters take."""

    duration_s: Positive
    solar_w: NotNegative = 0.0
    sleep_w: NotNegative = 0.0
    heater_w: NotNegative = 0.0

    @property
    def net_j(self) -> float:
        """What the battery gains, below its capacity; negative where it loses."""
        return self.duration_s * (self.solar_w - self.sleep_w - self.heater_w)


@value
class SolTimeline:
    """One sol: the time that its work may use, and the power from the end of that to the next morning.

    The work may use all energy that the battery holds above what the nights to come need.
    """

    time_s: Positive
    rest: tuple[PowerSegment, ...] = ()


@value
class SolWindow:
    """An observation may be made on this sol, at any time or within a window of its plan clock."""

    observation: str
    sol: SolNumber
    window_s: tuple[NotNegative, NotNegative] | None = None

    def __post_init__(self) -> None:
        if self.window_s is not None and self.window_s[0] > self.window_s[1]:
            raise MissionError(
                f"window_s opens at {self.window_s[0]:g} s after it closes at {self.window_s[1]:g} s"
            )


@value
class SolSeries:
    """Sols that follow each other (`sol-series/1`).

    An observation that `windows` names may be made on the sols that stand there and on no other.
    """

    battery: Battery
    sols: Annotated[tuple[SolTimeline, ...], MinLen(1), MaxLen(MAX_SOLS)]
    windows: tuple[SolWindow, ...] = ()

    def repeated(self, count: int) -> SolSeries:
        """Return the series with so many sols: cut off, or with the last one repeated.

        Raises
        ------
        MissionError
            If the count is not from 1 to `MAX_SOLS`.
        """
        if not 1 <= count <= MAX_SOLS:
            raise MissionError(f"the number of sols is {count}; it must be 1 to {MAX_SOLS}")
        more = (self.sols[-1],) * (count - len(self.sols))
        return SolSeries(self.battery, (*self.sols, *more)[:count], self.windows)


@dataclass(frozen=True, slots=True)
class Rest:
    """What the time from the end of the work to the next morning does to the battery, in closed form.

    A charge x of at least `need_j` becomes min(`ceiling_j`, x + `gain_j`); one below does not survive.
    """

    need_j: float
    gain_j: float
    ceiling_j: float

    def morning_j(self, charge_j: float) -> float:
        """Return the charge in the morning after; `charge_j` is that after the work, at least `need_j`."""
        return min(self.ceiling_j, charge_j + self.gain_j)


def rest_of(sol: SolTimeline, battery: Battery) -> Rest:
    """Return the rest of a sol: its segments one after the other, the charge cut off at the capacity.

    `need_j` is infinite where no charge that the battery holds survives.
    """
    need = lowest = battery.floor_j
    gain, ceiling = 0.0, battery.capacity_j
    for segment in sol.rest:
        gain += segment.net_j
        ceiling = min(battery.capacity_j, ceiling + segment.net_j)
        need = max(need, battery.floor_j - gain)
        lowest = min(lowest, ceiling)
    survives = lowest >= battery.floor_j and need <= battery.capacity_j
    return Rest(need if survives else float("inf"), gain, ceiling)


SOL_SERIES = Codec(SolSeries, "sol-series/1", "series of sols")
