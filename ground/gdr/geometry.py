"""Points, poses and rectangles of the site frame."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Point:
    """A point in the site frame."""

    east_m: float
    north_m: float
    up_m: float


@dataclass(frozen=True, slots=True)
class Pose:
    """A place to stand in the site frame."""

    east_m: float
    north_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class Bounds:
    """A rectangle of the site frame."""

    east_min_m: float
    north_min_m: float
    east_max_m: float
    north_max_m: float
