"""Tables of keep-outs."""

from __future__ import annotations

from typing import Any

from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Notes, Row, Text40, Text80, mission_column
from ground.resources.keep_outs.rules import kept_clear
from mission import KeepOut


class KeepOutRow(Row):
    __tablename__ = "keep_outs"

    mission_id: Mapped[str] = mission_column()
    name: Mapped[Text80]
    notes: Mapped[Notes]
    polygon_m: Mapped[list[Any]]
    frame_id: Mapped[Text40 | None] = mapped_column(index=True)
    in_frame: Mapped[dict[str, Any] | None]
    sigma_m: Mapped[float] = mapped_column(default=0.0, server_default="0")
    """Of where the outline lies, the worst direction, by the solutions between its frame and the anchor."""


def day_keep_out(row: KeepOutRow) -> KeepOut:
    """Return a stored keep-out as a value of the day, wider where its place is not quite known."""
    return KeepOut(row.id, tuple((e, n) for e, n in kept_clear(row.polygon_m, row.sigma_m)))
