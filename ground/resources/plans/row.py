"""Tables of plans."""

from __future__ import annotations

from typing import Any

from sqlalchemy import ForeignKey, UniqueConstraint, false
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import (
    JsonObject,
    Large,
    Long,
    Notes,
    Row,
    Sha256,
    Text20,
    Text40,
    Text80,
    Text200,
    mission_column,
)
from planner.plan_tree_document import TreeDocument


class PlanRow(Row):
    __tablename__ = "plans"
    __table_args__ = (UniqueConstraint("mission_id", "number"),)

    mission_id: Mapped[str] = mission_column()
    sol_id: Mapped[str] = mapped_column(ForeignKey("sols.id"))
    parent_id: Mapped[Text40 | None]
    number: Mapped[int]
    name: Mapped[Text200]
    notes: Mapped[Notes]
    state: Mapped[Text20] = mapped_column(index=True)
    status: Mapped[Text40] = mapped_column(default="")
    strategy: Mapped[Text40]
    max_branches: Mapped[int]
    time_limit_s: Mapped[float]
    iterations: Mapped[int | None]
    seed: Mapped[Large]
    job_id: Mapped[Text40]
    problem_id: Mapped[Text40 | None]
    network_id: Mapped[Text40 | None]
    expected_utility: Mapped[float | None]
    standard_error: Mapped[float | None]
    lower: Mapped[float | None]
    upper: Mapped[float | None]
    branches: Mapped[int | None]
    crl_text: Mapped[Long | None]
    crl_sha256: Mapped[Sha256 | None]
    problem_sha256: Mapped[Sha256 | None]
    inputs_sha256: Mapped[Sha256]
    terrain_sha256: Mapped[Sha256]
    dictionary: Mapped[Text80]
    rover_profile: Mapped[Text80]
    tree: Mapped[TreeDocument | None] = mapped_column(JsonObject(none_as_null=True))
    summary: Mapped[dict[str, Any] | None]
    findings: Mapped[list[Any]]
    request_ids: Mapped[list[Any]]
    """Requests asked for; empty = all open ones."""
    planned_request_ids: Mapped[list[Any]]
    left_out: Mapped[dict[str, Any]]
    approved_by: Mapped[Text80 | None]
    elsewhere: Mapped[bool] = mapped_column(default=False, server_default=false())
    """Came in with an archive: what its planner predicted counts for no rule here."""
