"""The table of jobs."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import (
    ForeignKey,
    Index,
    String,
    Text,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row


class JobRow(Row):
    """Long work: who leases it, how far it is, what came of it. `token` fences a worker that lost its
    lease.
    """

    __tablename__ = "jobs"
    __table_args__ = (Index("ix_jobs_claim", "state", "lease_until_utc"),)

    mission_id: Mapped[str | None] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), index=True)
    kind: Mapped[str] = mapped_column(String(60))
    payload: Mapped[dict[str, Any]]
    subject_kind: Mapped[str] = mapped_column(String(40))
    subject_id: Mapped[str] = mapped_column(String(40))
    state: Mapped[str] = mapped_column(String(20))
    progress: Mapped[float] = mapped_column(default=0.0)
    message: Mapped[str] = mapped_column(Text, default="")
    attempt: Mapped[int] = mapped_column(default=0)
    max_attempts: Mapped[int]
    time_limit_s: Mapped[float]
    token: Mapped[int] = mapped_column(default=0)
    lease_until_utc: Mapped[datetime | None]
    worker: Mapped[str] = mapped_column(String(120), default="")
    cancel_requested: Mapped[bool] = mapped_column(default=False)
    result_url: Mapped[str | None] = mapped_column(String(300))
    problem: Mapped[dict[str, Any] | None]
    log: Mapped[list[Any]]
    started_utc: Mapped[datetime | None]
    finished_utc: Mapped[datetime | None]
    traceparent: Mapped[str | None] = mapped_column(String(60))
    """Of the request that asked for it, where that was traced."""

    @property
    def topic(self) -> str:
        """Return what those follow to whom a change is told."""
        return self.id
