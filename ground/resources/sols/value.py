"""A sol: one day of work, its budgets and its passes."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from ground.gdr.geometry import Pose
from ground.records.stored import OfMission


@dataclass(frozen=True, slots=True)
class CommunicationPass:
    """A time in which the rover can be heard or commanded."""

    name: str
    start_s: float
    end_s: float
    data_mbit: float


@dataclass(frozen=True, slots=True)
class Sol(OfMission):
    """One day of work: where it starts, what may be spent, when there is contact."""

    number: int
    notes: str
    start_pose: Pose
    start_utc: datetime | None
    start_lmst_h: float
    battery_j: float
    energy_floor_j: float
    time_budget_s: float
    energy_budget_j: float
    overrun_penalty: float
    passes: list[CommunicationPass]
    uplink_deadline_utc: datetime | None
