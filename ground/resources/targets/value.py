"""A target: a point on a rock."""

from __future__ import annotations

from dataclasses import dataclass

from ground.gdr.geometry import Point
from ground.records.located import PointIn
from ground.records.stored import OfMission


@dataclass(frozen=True, slots=True)
class Target(OfMission):
    """A point on a rock that somebody wants observed."""

    name: str
    notes: str
    feature_type: str
    position: Point
    normal: list[float]
    slope_rad: float
    covariance_m2: list[list[float]]
    source_image: str
    frame_id: str | None
    at: PointIn | None = None
    """Its place in the reference that was asked for with `crs`."""
