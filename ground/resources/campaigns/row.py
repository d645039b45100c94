"""The table of campaigns."""

from __future__ import annotations

from typing import Any

from sqlalchemy import BigInteger, ForeignKey, String, false
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row, mission_column


class CampaignRow(Row):
    """A plan that is flown many times; `result` is `campaign/1` when it has ended."""

    __tablename__ = "campaigns"

    mission_id: Mapped[str] = mission_column()
    plan_id: Mapped[str] = mapped_column(ForeignKey("plans.id", ondelete="CASCADE"), index=True)
    job_id: Mapped[str] = mapped_column(String(40))
    state: Mapped[str] = mapped_column(String(20))
    rover: Mapped[str] = mapped_column(String(80))
    seed: Mapped[int] = mapped_column(BigInteger)
    runs: Mapped[int]
    until_se: Mapped[float | None]
    crl_sha256: Mapped[str] = mapped_column(String(64))
    result: Mapped[dict[str, Any] | None]
    elsewhere: Mapped[bool] = mapped_column(default=False, server_default=false())
    """Came in with an archive: it is shown, and counts for no rule here."""
