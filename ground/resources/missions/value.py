"""A mission: one worksite with all that is planned and done there."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from ground.geo.place import Place
from ground.records.stored import Stored


@dataclass(frozen=True, slots=True)
class Counts:
    targets: int
    observation_requests: int
    plans: int
    runs: int
    products: int


@dataclass(frozen=True, slots=True)
class DriveRule:
    """What people say of the drive between two targets' stands, in both directions; null is the start pose.

    `via_m` are the corners (east, north) of the way from the first to the second that the rover has to take,
    none for a straight line; null takes the drive out of the path network.
    """

    from_target_id: str | None
    to_target_id: str
    via_m: list[list[float]] | None


@dataclass(frozen=True, slots=True)
class Mission(Stored):
    """One worksite with all that is planned and done there."""

    name: str
    notes: str
    terrain_id: str
    terrain_name: str
    copied_from: str | None
    rover_profile: str
    anchor_frame_id: str | None
    calibration: dict[str, Any] | None
    drive_rules: list[DriveRule]
    place: Place | None
    """Where the site frame lies on its body; null where nobody has said it."""
    counts: Counts


@dataclass(frozen=True, slots=True)
class Elsewhere:
    """Approvals, waivers, packages, signatures, states of plans and events of an archive: history alone."""

    id: str
    mission_id: str
    author: str
    document: dict[str, Any]
    created_utc: datetime
