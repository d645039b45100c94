"""A target: a point on a rock."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from ground.gdr.geometry import Point


@dataclass(frozen=True, slots=True)
class Target:
    """A point on a rock that somebody finds worth a look."""

    id: str
    mission_id: str
    name: str
    notes: str
    position: Point
    normal: list[float]
    slope_rad: float
    covariance_m2: list[list[float]]
    source_image: str
    frame_id: str | None
    author: str
    created_utc: datetime
    modified_utc: datetime
    revision: int
