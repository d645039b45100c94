"""Tables of uploads."""

from __future__ import annotations

from sqlalchemy.orm import Mapped

from ground.gdr.base import Large, Row, Sha256, Text300


class UploadRow(Row):
    __tablename__ = "uploads"

    file_name: Mapped[Text300]
    size_bytes: Mapped[Large]
    sha256: Mapped[Sha256]
