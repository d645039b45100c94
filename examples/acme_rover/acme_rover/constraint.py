"""A constraint of our own: an observation waits until the panels have warmed the electronics."""

from __future__ import annotations

from typing import Literal

from mission import Sky
from mission.constraints import Constraint, SunElevation, Window
from mission.errors import MissionError
from mission.values import NotNegative, value


@value
class PanelWarm(Constraint):
    """The sun has stood over the horizon for `after_sunrise_s` seconds when the observation starts."""

    after_sunrise_s: NotNegative
    kind: Literal["panel_warm"] = "panel_warm"

    def reduced(self, sky: Sky, day_s: float) -> tuple[Constraint, ...]:
        """Return the windows in which the panels are warm: those of daylight, each with a later start.

        A plan that starts by daylight finds the panels warmed since the sunrise of that day.
        """
        found = []
        for window in SunElevation(at_least_rad=0.0).reduced(sky, day_s):
            if isinstance(window, Window):
                opens_s = window.opens_s - _lit_before_s(sky, window.opens_s) + self.after_sunrise_s
                opens_s = max(opens_s, window.opens_s)
                if opens_s <= window.closes_s:
                    found.append(Window(opens_s, window.closes_s))
        if not found:
            raise MissionError(
                f"the panels are at no time of the plan's {day_s:g} s warm for {self.after_sunrise_s:g} s"
            )
        return tuple(found)


def _lit_before_s(sky: Sky, at_s: float, step_s: float = 60.0) -> float:
    """Return for how long the sun has been up at a time of the plan; a whole sol at most."""
    clock, lit_s = sky.clock(), 0.0
    while lit_s < 88_775.0 and clock.elevation_rad(at_s - lit_s - step_s) >= 0.0:
        lit_s += step_s
    return lit_s
