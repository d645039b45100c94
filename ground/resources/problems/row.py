"""Tables of planning problems."""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    String,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row, mission_column


class ProblemRow(Row):
    __tablename__ = "problems"

    mission_id: Mapped[str] = mission_column()
    sha256: Mapped[str] = mapped_column(String(64))
    document: Mapped[dict[str, Any]]
