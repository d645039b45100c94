"""When and where the sun stands over a site."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mission.errors import MissionError
from mission.values import value

if TYPE_CHECKING:
    from mission.soltime import SunClock


@value
class Sky:
    """Season and place of the site, and local mean solar time at the start of the plan."""

    ls_deg: float = 120.0
    latitude_deg: float = -4.6
    start_lmst_h: float = 10.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.start_lmst_h < 24.0:
            raise MissionError(f"start_lmst_h is {self.start_lmst_h:g}; it must be at least 0 and below 24")
        if not -90.0 <= self.latitude_deg <= 90.0:
            raise MissionError(f"latitude_deg is {self.latitude_deg:g}; it must lie in -90 to 90")

    def clock(self) -> SunClock:
        """Return the sun's course from the start of the plan on."""
        from mission.soltime import SunClock

        return SunClock.at(self.ls_deg, self.latitude_deg, self.start_lmst_h)
