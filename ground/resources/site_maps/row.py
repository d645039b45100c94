"""Tables of site maps."""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    BigInteger,
    ForeignKey,
    String,
    Text,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row, mission_column


class SiteMapRow(Row):
    """A map made at a frame (GeoTIFF in the frame's east and north), and where its outline lies now."""

    __tablename__ = "site_maps"

    mission_id: Mapped[str] = mission_column()
    name: Mapped[str] = mapped_column(String(80))
    notes: Mapped[str] = mapped_column(Text, default="")
    frame_id: Mapped[str] = mapped_column(ForeignKey("frames.id"), index=True)
    in_frame: Mapped[dict[str, Any]]
    outline_m: Mapped[list[Any]]
    sigma_m: Mapped[float]
    file_name: Mapped[str] = mapped_column(String(300))
    media: Mapped[str] = mapped_column(String(100))
    size_bytes: Mapped[int] = mapped_column(BigInteger)
    sha256: Mapped[str] = mapped_column(String(64))
