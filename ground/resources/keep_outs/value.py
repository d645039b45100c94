"""A keep-out: ground that the rover must not enter."""

from __future__ import annotations

from dataclasses import dataclass

from ground.records.located import OutlineIn
from ground.records.stored import OfMission


@dataclass(frozen=True, slots=True)
class KeepOut(OfMission):
    """A polygon the rover must not enter; corners are [east_m, north_m], the ring is closed by itself."""

    name: str
    notes: str
    polygon_m: list[list[float]]
    frame_id: str | None
    sigma_m: float
    at: OutlineIn | None = None
    """Its outline in the reference that was asked for with `crs`."""
