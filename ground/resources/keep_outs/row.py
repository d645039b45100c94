"""Tables of keep-outs."""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    JSON,
    String,
    Text,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row, mission_column
from ground.resources.keep_outs.rules import kept_clear
from mission import KeepOut


class KeepOutRow(Row):
    __tablename__ = "keep_outs"

    mission_id: Mapped[str] = mission_column()
    name: Mapped[str] = mapped_column(String(80))
    notes: Mapped[str] = mapped_column(Text, default="")
    polygon_m: Mapped[list[Any]]
    frame_id: Mapped[str | None] = mapped_column(String(40), index=True)
    in_frame: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    sigma_m: Mapped[float] = mapped_column(default=0.0, server_default="0")
    """Of where the outline lies, the worst direction, by the solutions between its frame and the anchor."""


def day_keep_out(row: KeepOutRow) -> KeepOut:
    """Return a stored keep-out as a value of the day, wider where its place is not quite known."""
    return KeepOut(row.id, tuple((e, n) for e, n in kept_clear(row.polygon_m, row.sigma_m)))
