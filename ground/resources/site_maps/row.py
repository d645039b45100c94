"""Tables of site maps."""

from __future__ import annotations

from typing import Any

from sqlalchemy import ForeignKey, String
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Large, Notes, Row, Sha256, Text80, Text300, mission_column


class SiteMapRow(Row):
    """A map made at a frame (GeoTIFF in the frame's east and north), and where its outline lies now."""

    __tablename__ = "site_maps"

    mission_id: Mapped[str] = mission_column()
    name: Mapped[Text80]
    notes: Mapped[Notes]
    frame_id: Mapped[str] = mapped_column(ForeignKey("frames.id"), index=True)
    in_frame: Mapped[dict[str, Any]]
    outline_m: Mapped[list[Any]]
    sigma_m: Mapped[float]
    file_name: Mapped[Text300]
    media: Mapped[str] = mapped_column(String(100))
    size_bytes: Mapped[Large]
    sha256: Mapped[Sha256]
