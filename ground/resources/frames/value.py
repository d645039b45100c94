"""The frames of the site chain.

A motion counter is (site, drive, ...). A place is east, north, up of the mission's anchor site.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum

from ground.records.stored import OfMission


class Level(StrEnum):
    """What a frame stands for."""

    SITE = "site"
    DRIVE = "drive"
    """Where a drive ended: the motion counter has two indices, or all behind them are 0."""
    POSE = "pose"
    """The same place after arm or mast moved, or any frame of another name."""


@dataclass(frozen=True, slots=True)
class FramePlace:
    """Where a frame lies as seen from the anchor, by the solutions in use.

    `unknown_links` solutions on the way have no covariance and count as exact.
    """

    east_m: float
    north_m: float
    up_m: float
    heading_rad: float
    covariance_m2: list[list[float]]
    unknown_links: int


@dataclass(frozen=True, slots=True)
class Frame(OfMission):
    """A site, the end of a drive or a pose; `declared_at` is the motion counter at which a site was declared.

    `place` is null, with the `reason`, while nothing ties the frame to the anchor.
    """

    name: str
    counter: list[int]
    level: Level
    site: int
    drive: int | None
    declared_at: list[int] | None
    solution_id: str | None
    chosen_utc: datetime | None
    solutions: int
    place: FramePlace | None
    reason: str
    notes: str
