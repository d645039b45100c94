"""Tables of data products."""

from __future__ import annotations

from typing import Any

from sqlalchemy import ForeignKey, String, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Large, Row, Sha256, Text40, Text80, Text200, Text300, mission_column


class ProductRow(Row):
    __tablename__ = "products"
    __table_args__ = (UniqueConstraint("run_id", "file_name"),)

    mission_id: Mapped[str] = mission_column()
    run_id: Mapped[str] = mapped_column(ForeignKey("runs.id", ondelete="CASCADE"), index=True)
    plan_id: Mapped[Text40 | None]
    task_id: Mapped[Text200]
    request_id: Mapped[Text40 | None] = mapped_column(index=True)
    target_id: Mapped[Text40 | None] = mapped_column(index=True)
    kind: Mapped[Text80]
    instrument: Mapped[Text80] = mapped_column(default="")
    media: Mapped[str] = mapped_column(String(100))
    file_name: Mapped[Text300]
    size_bytes: Mapped[Large]
    sha256: Mapped[Sha256] = mapped_column(index=True)
    t_s: Mapped[float]
    label: Mapped[dict[str, Any]]
