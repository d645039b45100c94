"""Tables of runs."""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    BigInteger,
    ForeignKey,
    String,
    Text,
    false,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row, mission_column


class RunRow(Row):
    __tablename__ = "runs"

    mission_id: Mapped[str] = mission_column()
    plan_id: Mapped[str] = mapped_column(ForeignKey("plans.id"), index=True)
    kind: Mapped[str] = mapped_column(String(20))
    rover: Mapped[str] = mapped_column(String(80))
    seed: Mapped[int] = mapped_column(BigInteger)
    faults: Mapped[list[Any]]
    job_id: Mapped[str | None] = mapped_column(String(40))
    state: Mapped[str] = mapped_column(String(20))
    outcome: Mapped[str] = mapped_column(String(40), default="")
    utility: Mapped[float | None]
    duration_s: Mapped[float | None]
    energy_used_j: Mapped[float | None]
    options_taken: Mapped[list[Any]]
    achieved_request_ids: Mapped[list[Any]]
    crl_sha256: Mapped[str] = mapped_column(String(64))
    package_sha256: Mapped[str | None] = mapped_column(String(64), unique=True)
    trace_sha256: Mapped[str | None] = mapped_column(String(64))
    telemetry_sha256: Mapped[str | None] = mapped_column(String(64))
    notes: Mapped[str] = mapped_column(Text, default="")
    elsewhere: Mapped[bool] = mapped_column(default=False, server_default=false())
    """Came in with an archive: it is shown, and verifies nothing here."""
