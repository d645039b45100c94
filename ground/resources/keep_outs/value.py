"""A keep-out: ground that the rover must not enter."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True, slots=True)
class KeepOut:
    """A polygon the rover must not enter; corners are [east_m, north_m], the ring is closed by itself."""

    id: str
    mission_id: str
    name: str
    notes: str
    polygon_m: list[list[float]]
    frame_id: str | None
    sigma_m: float
    author: str
    created_utc: datetime
    modified_utc: datetime
    revision: int
