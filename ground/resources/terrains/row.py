"""Tables of terrains."""

from __future__ import annotations

from typing import Any

from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Long, Row, Sha256, Text200


class TerrainRow(Row):
    __tablename__ = "terrains"

    name: Mapped[Text200]
    credits: Mapped[Long]
    sha256: Mapped[Sha256] = mapped_column(index=True)
    description: Mapped[dict[str, Any]]
    """Layers, bounds and start pose as in `Terrain`."""
