"""The sols that plans are for, and times with a zone, for catalogue and labels."""

from __future__ import annotations

from datetime import UTC, datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.resources.plans.row import PlanRow
from ground.resources.sols.row import SolRow


def planned_sols(session: Session, mission_id: str, plan_id: str | None = None) -> dict[str, SolRow]:
    """Return the sol of each plan of a mission, or of one, by the plan's id."""
    query = select(PlanRow.id, SolRow).join(SolRow, SolRow.id == PlanRow.sol_id)
    query = query.where(PlanRow.mission_id == mission_id)
    if plan_id is not None:
        query = query.where(PlanRow.id == plan_id)
    return {row[0]: row[1] for row in session.execute(query)}


def aware(time: datetime) -> datetime:
    """Return a time with a zone: without one it is in UTC."""
    return time if time.tzinfo else time.replace(tzinfo=UTC)
