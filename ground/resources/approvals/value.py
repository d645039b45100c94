"""An approval, and what the flight rules say."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True, slots=True)
class FlightRuleResult:
    """One flight rule checked against a plan; `waived_by` where somebody with the right accepted the
    violation.
    """

    rule: str
    title: str
    holds: bool
    value: float | None
    limit: float | None
    unit: str
    detail: str
    waived_by: str | None


@dataclass(frozen=True, slots=True)
class Approval:
    """A second person's word for exactly these digests; void when the plan is no longer what it was."""

    id: str
    mission_id: str
    plan_id: str
    approver: str
    note: str
    crl_sha256: str
    terrain_sha256: str
    dictionary_sha256: str
    models_sha256: str
    void: bool
    created_utc: datetime
