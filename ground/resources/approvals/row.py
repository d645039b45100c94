"""Tables of approvals, waivers and flight rules."""

from __future__ import annotations

from sqlalchemy import ForeignKey, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Long, Notes, Row, Sha256, Text80, mission_column


class ApprovalRow(Row):
    __tablename__ = "approvals"

    mission_id: Mapped[str] = mission_column()
    plan_id: Mapped[str] = mapped_column(ForeignKey("plans.id", ondelete="CASCADE"), index=True)
    note: Mapped[Notes]
    crl_sha256: Mapped[Sha256]
    terrain_sha256: Mapped[Sha256]
    dictionary_sha256: Mapped[Sha256]
    models_sha256: Mapped[Sha256]


class WaiverRow(Row):
    """A flight rule that does not hold for one plan, accepted by somebody with the right to."""

    __tablename__ = "waivers"
    __table_args__ = (UniqueConstraint("plan_id", "rule"),)

    mission_id: Mapped[str] = mission_column()
    plan_id: Mapped[str] = mapped_column(ForeignKey("plans.id", ondelete="CASCADE"), index=True)
    rule: Mapped[Text80]
    reason: Mapped[Long]
