"""What lies on a ground below the size of its rocks, and how the renderer should texture it."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Le

from mission.values import NotNegative, Share, reads_over, value


@reads_over
@value
class Surface:
    """The surface of a terrain that was made by a geology; the defaults are those of one that was not.

    `wind_rad` is the azimuth (counter-clockwise from east) that the wind comes from, `banks` the share of the
    rocks with sand banked against them, to windward and in their lee. `stones_per_m2` are bodies of 2 to
    9.5 cm, the fewer of them large the greater `stone_power`; `gravel` is how dense smaller stones lie. The
    others are those of the renderer's `Look`.
    """

    geology: str = ""
    wind_rad: float = 0.0
    banks: Share = 0.0
    stones_per_m2: Annotated[float, Ge(0), Le(400)] = 6.0
    stone_power: Annotated[float, Ge(0.5), Le(10)] = 3.0
    gravel: Share = 0.55
    gravel_mottle: Annotated[float, Ge(0), Le(2)] = 1.0
    soil_slope: NotNegative = 0.10
    soil_mottle: Annotated[float, Ge(0), Le(4)] = 1.0
    sand: Share = 0.0
    grain: Share = 0.0
    ripples: Annotated[float, Ge(0), Le(0.5)] = 0.0
    stone_slope: Annotated[float, Ge(0), Le(1)] = 0.06
    mottle: Share = 0.11
