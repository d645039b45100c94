"""Tables of approvals, waivers and flight rules."""

from __future__ import annotations

from sqlalchemy import (
    ForeignKey,
    String,
    Text,
    UniqueConstraint,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row, mission_column


class ApprovalRow(Row):
    __tablename__ = "approvals"

    mission_id: Mapped[str] = mission_column()
    plan_id: Mapped[str] = mapped_column(ForeignKey("plans.id", ondelete="CASCADE"), index=True)
    note: Mapped[str] = mapped_column(Text, default="")
    crl_sha256: Mapped[str] = mapped_column(String(64))
    terrain_sha256: Mapped[str] = mapped_column(String(64))
    dictionary_sha256: Mapped[str] = mapped_column(String(64))
    models_sha256: Mapped[str] = mapped_column(String(64))


class WaiverRow(Row):
    """A flight rule that does not hold for one plan, accepted by somebody with the right to."""

    __tablename__ = "waivers"
    __table_args__ = (UniqueConstraint("plan_id", "rule"),)

    mission_id: Mapped[str] = mission_column()
    plan_id: Mapped[str] = mapped_column(ForeignKey("plans.id", ondelete="CASCADE"), index=True)
    rule: Mapped[str] = mapped_column(String(80))
    reason: Mapped[str] = mapped_column(Text)
