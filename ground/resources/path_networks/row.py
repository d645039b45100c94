"""Tables of path networks."""

from __future__ import annotations

from typing import Any

from sqlalchemy.orm import Mapped

from ground.gdr.base import Row, Sha256, Text40, mission_column


class PathNetworkRow(Row):
    __tablename__ = "path_networks"

    mission_id: Mapped[str] = mission_column()
    job_id: Mapped[Text40]
    inputs_sha256: Mapped[Sha256]
    geometry: Mapped[dict[str, Any] | None]
    """Nodes, segments and what cannot be reached, as in `PathNetwork`; null while it is computed."""
