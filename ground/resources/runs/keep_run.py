"""What may not be deleted: plans that have runs."""

from __future__ import annotations

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import StateError
from ground.records.actor import Actor
from ground.resources.plans.row import PlanRow
from ground.resources.runs.row import RunRow


def keep_run_plan(session: Session, _actor: Actor, row: PlanRow, _reason: str) -> None:
    """Raise if a plan that is about to go has runs."""
    if session.scalars(select(RunRow.id).where(RunRow.plan_id == row.id).limit(1)).first():
        raise StateError(f"plan {row.number} has runs and stays")
