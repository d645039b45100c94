"""Tables of missions."""

from __future__ import annotations

from typing import Any

from sqlalchemy import ForeignKey, false
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Notes, Row, Text40, Text80, Text200, mission_column


class MissionRow(Row):
    __tablename__ = "missions"
    mission_key = "id"

    name: Mapped[Text200]
    notes: Mapped[Notes]
    terrain_id: Mapped[str] = mapped_column(ForeignKey("terrains.id"))
    copied_from: Mapped[Text40 | None]
    rover_profile: Mapped[Text80]
    anchor_frame_id: Mapped[Text40 | None]
    """The site whose frame, east-north-up, is the one of terrain, targets and keep-outs."""
    calibration: Mapped[dict[str, Any] | None]
    """`calibration/1` of the path network; the rover profile's numbers when there is none."""
    drive_rules: Mapped[list[Any] | None]
    """Drives that people forbid or draw, as in `DriveRule`; null = none."""
    in_making: Mapped[bool] = mapped_column(default=False, server_default=false())
    """It is being copied and not there for anybody yet."""
    place: Mapped[dict[str, Any] | None]
    """Where the site frame lies, as in `Place`; null where nobody has said it."""


class ElsewhereRow(Row):
    """Approvals, packages, signatures, states of plans and events of an archive: history, and no rights."""

    __tablename__ = "elsewhere"

    mission_id: Mapped[str] = mission_column()
    document: Mapped[dict[str, Any]]
