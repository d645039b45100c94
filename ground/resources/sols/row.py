"""Tables of sols."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import UniqueConstraint
from sqlalchemy.orm import Mapped

from ground.gdr.base import Notes, Row, mission_column


class SolRow(Row):
    __tablename__ = "sols"
    __table_args__ = (UniqueConstraint("mission_id", "number"),)

    mission_id: Mapped[str] = mission_column()
    number: Mapped[int]
    notes: Mapped[Notes]
    start_pose: Mapped[dict[str, Any]]
    start_utc: Mapped[datetime | None]
    start_lmst_h: Mapped[float]
    battery_j: Mapped[float]
    energy_floor_j: Mapped[float]
    time_budget_s: Mapped[float]
    energy_budget_j: Mapped[float]
    overrun_penalty: Mapped[float]
    passes: Mapped[list[Any]]
    uplink_deadline_utc: Mapped[datetime | None]


def usable_energy_j(battery_j: float, energy_floor_j: float, energy_budget_j: float) -> float:
    """Return what a sol's plan may draw, joules: its budget, as far as the charge is above the floor."""
    return max(0.0, min(energy_budget_j, battery_j - energy_floor_j))
