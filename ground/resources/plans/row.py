"""Tables of plans."""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    JSON,
    BigInteger,
    ForeignKey,
    String,
    Text,
    UniqueConstraint,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Row, mission_column


class PlanRow(Row):
    __tablename__ = "plans"
    __table_args__ = (UniqueConstraint("mission_id", "number"),)

    mission_id: Mapped[str] = mission_column()
    sol_id: Mapped[str] = mapped_column(ForeignKey("sols.id"))
    parent_id: Mapped[str | None] = mapped_column(String(40))
    number: Mapped[int]
    name: Mapped[str] = mapped_column(String(200))
    notes: Mapped[str] = mapped_column(Text, default="")
    state: Mapped[str] = mapped_column(String(20), index=True)
    status: Mapped[str] = mapped_column(String(40), default="")
    strategy: Mapped[str] = mapped_column(String(40))
    max_branches: Mapped[int]
    time_limit_s: Mapped[float]
    iterations: Mapped[int | None]
    seed: Mapped[int] = mapped_column(BigInteger)
    job_id: Mapped[str] = mapped_column(String(40))
    problem_id: Mapped[str | None] = mapped_column(String(40))
    network_id: Mapped[str | None] = mapped_column(String(40))
    expected_utility: Mapped[float | None]
    standard_error: Mapped[float | None]
    lower: Mapped[float | None]
    upper: Mapped[float | None]
    branches: Mapped[int | None]
    crl_text: Mapped[str | None] = mapped_column(Text)
    crl_sha256: Mapped[str | None] = mapped_column(String(64))
    problem_sha256: Mapped[str | None] = mapped_column(String(64))
    inputs_sha256: Mapped[str] = mapped_column(String(64))
    terrain_sha256: Mapped[str] = mapped_column(String(64))
    dictionary: Mapped[str] = mapped_column(String(80))
    rover_profile: Mapped[str] = mapped_column(String(80))
    tree: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    summary: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    findings: Mapped[list[Any]]
    request_ids: Mapped[list[Any]]
    """Requests asked for; empty = all open ones."""
    planned_request_ids: Mapped[list[Any]]
    left_out: Mapped[dict[str, Any]]
    approved_by: Mapped[str | None] = mapped_column(String(80))
