"""An observation request: what a scientist asks of a target."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from ground.gdr.geometry import Pose
from ground.records.stored import OfMission


class RequestState(StrEnum):
    """Life of an observation request."""

    OPEN = "open"
    PLANNED = "planned"
    ATTEMPTED = "attempted"
    SATISFIED = "satisfied"
    FAILED = "failed"
    CARRIED = "carried"


@dataclass(frozen=True, slots=True)
class ObservationPoint:
    """Where the rover stands for an observation; `reason` says why there is no such place."""

    pose: Pose | None
    reachable: bool
    manual: bool
    reason: str


@dataclass(frozen=True, slots=True)
class ObservationRequest(OfMission):
    """What a scientist asks of a target."""

    target_id: str
    target_name: str
    instrument: str
    value: float
    tracked: bool
    window_s: list[float] | None
    after: list[str]
    must_do: bool
    dwell_s: float | None
    constraints: list[dict[str, Any]]
    notes: str
    rationale: str
    observation_point: ObservationPoint | None
    state: RequestState
    state_reason: str


@dataclass(frozen=True, slots=True)
class StandCheck:
    """Whether a target can be observed from a pose, and the figures; null where they mean nothing.

    `reach_m` is from the arm's shoulder (contact instruments) or the mast (remote ones) to the target,
    `tool_tilt_rad` between tool or view and the surface normal.
    """

    pose: Pose
    reachable: bool
    reason: str
    reach_m: float | None
    tool_tilt_rad: float | None
    slope_rad: float | None
    clearance_m: float | None
