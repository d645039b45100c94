"""Tables of terrains."""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    String,
    Text,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row


class TerrainRow(Row):
    __tablename__ = "terrains"

    name: Mapped[str] = mapped_column(String(200))
    credits: Mapped[str] = mapped_column(Text)
    sha256: Mapped[str] = mapped_column(String(64), index=True)
    description: Mapped[dict[str, Any]]
    """Layers, bounds and start pose as in `Terrain`."""
