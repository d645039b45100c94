"""Tables of traverses."""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    JSON,
    String,
    Text,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row, mission_column


class TraverseRow(Row):
    """Stops of recorded runs that were adjusted together: a job's result."""

    __tablename__ = "traverses"

    mission_id: Mapped[str] = mission_column()
    name: Mapped[str] = mapped_column(String(200))
    notes: Mapped[str] = mapped_column(Text, default="")
    job_id: Mapped[str] = mapped_column(String(40))
    stops: Mapped[list[Any]]
    """Frame and source of each, in the order driven."""
    document: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    """`localization/1`, with the pictures; null while it is computed."""
    solution_ids: Mapped[list[Any]]
