"""Tables of targets."""

from __future__ import annotations

from typing import Any, TypedDict

from sqlalchemy import Index, UniqueConstraint, text
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import JsonObject, Notes, Row, Text40, Text80, Text200, mission_column
from mission import Target

_NAMED = text("frame_id IS NOT NULL")
"""Most targets were designated in the site frame, and cost the index nothing."""


class SeenTarget(TypedDict):
    """What was seen of a target from a frame, in the frame's axes; the covariance is 3x3."""

    position_m: list[float]
    normal: list[float]
    slope_over_normal_rad: float
    covariance_m2: list[list[float]]


class TargetRow(Row):
    __tablename__ = "targets"
    __table_args__ = (
        UniqueConstraint("mission_id", "name"),
        Index("ix_targets_frame_id", "frame_id", sqlite_where=_NAMED, postgresql_where=_NAMED),
    )

    mission_id: Mapped[str] = mission_column(index=False)
    name: Mapped[Text80]
    notes: Mapped[Notes]
    feature_type: Mapped[Text80] = mapped_column(default="", server_default="")
    """What it lies on, in the words of the science team: float, vein, outcrop, soil."""
    east_m: Mapped[float]
    north_m: Mapped[float]
    up_m: Mapped[float]
    normal: Mapped[list[Any]]
    slope_rad: Mapped[float]
    covariance_m2: Mapped[list[Any]]
    source_image: Mapped[Text200] = mapped_column(default="")
    frame_id: Mapped[Text40 | None]
    in_frame: Mapped[SeenTarget | None] = mapped_column(JsonObject(none_as_null=True))
    """What was seen from the frame, in its own axes; the columns above follow from it."""


def day_target(row: TargetRow) -> Target:
    """Return a stored target as a value of the day."""
    east, north, up = row.normal
    return Target(row.id, row.name, (row.east_m, row.north_m, row.up_m), (east, north, up))
