"""Tables of uplink packages."""

from __future__ import annotations

from sqlalchemy import (
    ForeignKey,
    String,
    UniqueConstraint,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row, mission_column


class PackageRow(Row):
    """An uplink package that was made; sequence numbers ascend without a gap in each mission."""

    __tablename__ = "packages"
    __table_args__ = (UniqueConstraint("mission_id", "sequence"),)

    mission_id: Mapped[str] = mission_column()
    plan_id: Mapped[str] = mapped_column(ForeignKey("plans.id", ondelete="CASCADE"), index=True)
    sequence: Mapped[int]
    sha256: Mapped[str] = mapped_column(String(64))
    key_id: Mapped[str] = mapped_column(String(64))
