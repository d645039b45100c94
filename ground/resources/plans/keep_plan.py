"""What may not be deleted: plans that were approved, and sols that have plans."""

from __future__ import annotations

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import StateError
from ground.records.actor import Actor
from ground.resources.plans.row import PlanRow
from ground.resources.sols.row import SolRow


def keep_planned_sol(session: Session, _actor: Actor, row: SolRow, _reason: str) -> None:
    """Raise if a sol that is about to go has plans."""
    if session.scalars(select(PlanRow.id).where(PlanRow.sol_id == row.id).limit(1)).first():
        raise StateError(f"sol {row.number} has plans and stays")


def keep_approved_plan(_session: Session, _actor: Actor, row: PlanRow, _reason: str) -> None:
    """Raise if a plan that is about to go was approved."""
    if row.state in {"approved", "uplinked", "executed"}:
        raise StateError(f"plan {row.number} is {row.state} and stays")
