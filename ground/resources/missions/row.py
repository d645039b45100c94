"""Tables of missions."""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    JSON,
    ForeignKey,
    String,
    Text,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row, mission_column


class MissionRow(Row):
    __tablename__ = "missions"
    mission_key = "id"

    name: Mapped[str] = mapped_column(String(200))
    notes: Mapped[str] = mapped_column(Text, default="")
    terrain_id: Mapped[str] = mapped_column(ForeignKey("terrains.id"))
    copied_from: Mapped[str | None] = mapped_column(String(40))
    rover_profile: Mapped[str] = mapped_column(String(80))
    anchor_frame_id: Mapped[str | None] = mapped_column(String(40))
    """The site whose frame, east-north-up, is the one of terrain, targets and keep-outs."""
    calibration: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    """`calibration/1` of the path network; the rover profile's numbers when there is none."""
    drive_rules: Mapped[list[Any] | None] = mapped_column(JSON(none_as_null=True))
    """Drives that people forbid or draw, as in `DriveRule`; null = none."""


class ElsewhereRow(Row):
    """Approvals, packages, signatures, states of plans and events of an archive: history, and no rights."""

    __tablename__ = "elsewhere"

    mission_id: Mapped[str] = mission_column()
    document: Mapped[dict[str, Any]]
