"""Tables of path networks."""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    JSON,
    String,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row, mission_column


class PathNetworkRow(Row):
    __tablename__ = "path_networks"

    mission_id: Mapped[str] = mission_column()
    job_id: Mapped[str] = mapped_column(String(40))
    inputs_sha256: Mapped[str] = mapped_column(String(64))
    geometry: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    """Nodes, segments and what cannot be reached, as in `PathNetwork`; null while it is computed."""
