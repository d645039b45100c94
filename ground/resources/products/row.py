"""Tables of data products."""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    BigInteger,
    ForeignKey,
    String,
    UniqueConstraint,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row, mission_column


class ProductRow(Row):
    __tablename__ = "products"
    __table_args__ = (UniqueConstraint("run_id", "file_name"),)

    mission_id: Mapped[str] = mission_column()
    run_id: Mapped[str] = mapped_column(ForeignKey("runs.id", ondelete="CASCADE"), index=True)
    plan_id: Mapped[str | None] = mapped_column(String(40))
    task_id: Mapped[str] = mapped_column(String(200))
    request_id: Mapped[str | None] = mapped_column(String(40), index=True)
    target_id: Mapped[str | None] = mapped_column(String(40), index=True)
    kind: Mapped[str] = mapped_column(String(80))
    instrument: Mapped[str] = mapped_column(String(80), default="")
    media: Mapped[str] = mapped_column(String(100))
    file_name: Mapped[str] = mapped_column(String(300))
    size_bytes: Mapped[int] = mapped_column(BigInteger)
    sha256: Mapped[str] = mapped_column(String(64), index=True)
    t_s: Mapped[float]
    label: Mapped[dict[str, Any]]
