"""Places on the ground."""

from __future__ import annotations

from mission.values import value


@value
class Pose:
    """Where the rover stands: metres east and north in the site frame, heading in radians from east,
    counter-clockwise (REP 103).
    """

    east_m: float
    north_m: float
    heading_rad: float = 0.0
