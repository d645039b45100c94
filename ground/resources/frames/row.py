"""Tables of frames of the site chain."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import ForeignKey, Index, String, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Large, Notes, Row, Sha256, Text40, Text80, Text300, mission_column


class FrameRow(Row):
    """A site, the end of a drive or a pose, by its motion counter, and the solution in use for it."""

    __tablename__ = "frames"
    __table_args__ = (UniqueConstraint("mission_id", "key"), Index("ix_frames_site", "mission_id", "site"))

    mission_id: Mapped[str] = mission_column()
    key: Mapped[str] = mapped_column(String(120))
    """Name and motion counter, `ROVER_FRAME 137.26`."""
    name: Mapped[Text80]
    counter: Mapped[list[Any]]
    level: Mapped[str] = mapped_column(String(10))
    site: Mapped[int]
    drive: Mapped[int | None]
    notes: Mapped[Notes]
    solution_id: Mapped[Text40 | None]
    chosen_utc: Mapped[datetime | None]
    """When a person chose the solution; null while the rule of the files did."""


class FrameFileRow(Row):
    """A mission's frame file (.svf, .rvf) that was taken in: all of it that is not a solution."""

    __tablename__ = "frame_files"

    mission_id: Mapped[str] = mission_column()
    file_name: Mapped[Text300]
    sha256: Mapped[Sha256]
    rover: Mapped[Text80]
    variant: Mapped[Text80]
    counter: Mapped[list[Any]]
    priority: Mapped[list[Any]]
    aliases: Mapped[list[Any]]
    """`old`, `new` and `position` of each."""
    added: Mapped[int]
    known: Mapped[int]
    """Solutions that came with it, and that were here before."""


class SolutionRow(Row):
    """One answer to where a frame lies; never changed and never deleted."""

    __tablename__ = "solutions"
    __table_args__ = (Index("ix_solutions_position", "mission_id", "position"),)

    mission_id: Mapped[str] = mission_column()
    frame_id: Mapped[str] = mapped_column(ForeignKey("frames.id", ondelete="CASCADE"), index=True)
    reference_id: Mapped[str] = mapped_column(ForeignKey("frames.id", ondelete="CASCADE"), index=True)
    file_id: Mapped[Text40 | None]
    label: Mapped[Text80]
    offset_m: Mapped[list[Any]]
    quaternion: Mapped[list[Any]]
    covariance: Mapped[list[Any] | None]
    """[6, 6] of a small motion (turn in rad, shift in m) in the frame's axes."""
    added_utc: Mapped[datetime]
    position: Mapped[Large]
    """Place in the order of arrival, that of the files."""
    source: Mapped[dict[str, Any]]
    notes: Mapped[Notes]
