"""How plans are stored and shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from sqlalchemy.orm import Session

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.plans.bodies import PlanChange, PlanCreate
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import Plan
from ground.resources.problems.inputs_digest import inputs_digest


def _staleness(session: Session, rows: Sequence[PlanRow]) -> Callable[[PlanRow], Mapping[str, object]]:
    now = {i: inputs_digest(session, i) for i in {row.mission_id for row in rows}}
    return lambda row: {"stale": now[row.mission_id] != row.inputs_sha256}


PLAN = Kind(
    "plan",
    "pln",
    "plans",
    PlanRow,
    Plan,
    Action.PLAN,
    make=PlanCreate,
    change=PlanChange,
    related=_staleness,
    unseen=frozenset({"tree", "summary", "crl_text", "findings"}),
)
