"""Tables of runs."""

from __future__ import annotations

from typing import Any

from sqlalchemy import ForeignKey, false
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Large, Notes, Row, Sha256, Text20, Text40, Text80, mission_column


class RunRow(Row):
    __tablename__ = "runs"

    mission_id: Mapped[str] = mission_column()
    plan_id: Mapped[str] = mapped_column(ForeignKey("plans.id"), index=True)
    kind: Mapped[Text20]
    rover: Mapped[Text80]
    seed: Mapped[Large]
    faults: Mapped[list[Any]]
    job_id: Mapped[Text40 | None]
    state: Mapped[Text20]
    outcome: Mapped[Text40] = mapped_column(default="")
    utility: Mapped[float | None]
    duration_s: Mapped[float | None]
    energy_used_j: Mapped[float | None]
    options_taken: Mapped[list[Any]]
    achieved_request_ids: Mapped[list[Any]]
    crl_sha256: Mapped[Sha256]
    package_sha256: Mapped[Sha256 | None] = mapped_column(unique=True)
    trace_sha256: Mapped[Sha256 | None]
    telemetry_sha256: Mapped[Sha256 | None]
    notes: Mapped[Notes]
    elsewhere: Mapped[bool] = mapped_column(default=False, server_default=false())
    """Came in with an archive: it is shown, and verifies nothing here."""

    @property
    def topic(self) -> str:
        """Return what those follow to whom a change is told."""
        return self.id
