"""A path network: drives between the start and the observation points."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from ground.gdr.geometry import Pose


@dataclass(frozen=True, slots=True)
class NetworkNode:
    """A place of the path network: the start or an observation point."""

    id: str
    pose: Pose
    target_id: str | None
    request_ids: list[str]


@dataclass(frozen=True, slots=True)
class NetworkSegment:
    """A drive between two places, one way; `p_lose` is the chance to lose each tracked target on it,
    `p_fail` the chance that it ends short of its place.
    """

    id: str
    start: str
    end: str
    points_m: list[list[float]]
    length_m: float
    time_mean_s: float
    time_sd_s: float
    energy_mean_j: float
    energy_sd_j: float
    p_lose: dict[str, float]
    p_fail: float = 0.0


@dataclass(frozen=True, slots=True)
class TrackingRegion:
    """The cone in which a target is tracked well."""

    target_id: str
    polygon_m: list[list[float]]


@dataclass(frozen=True, slots=True)
class PathNetwork:
    """Drives between the start and the observation points, computed from one state of the mission.

    `segments` are the drives, each a polyline; `hazards_m` what the heights forbid, `margins_m` that and the
    keep-outs with the clearance round them; `unreachable` says why a request has no drive.
    """

    id: str
    mission_id: str
    inputs_sha256: str
    stale: bool
    nodes: list[NetworkNode]
    segments: list[NetworkSegment]
    regions: list[TrackingRegion]
    hazards_m: list[list[list[float]]]
    margins_m: list[list[list[float]]]
    unreachable: dict[str, str]
    notes: list[str]
    job_id: str
    computed: bool
    author: str
    created_utc: datetime
    revision: int
