"""How plans are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy.orm import Session

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.plans.bodies import PlanChange, PlanCreate
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import Plan, PlanState
from ground.resources.problems.inputs_digest import inputs_digest


def show_plans(session: Session, rows: Sequence[PlanRow]) -> list[Plan]:
    now = {i: inputs_digest(session, i) for i in {r.mission_id for r in rows}}
    return [
        value_of(Plan, r, state=PlanState(r.state), stale=now[r.mission_id] != r.inputs_sha256) for r in rows
    ]


PLAN = Kind(
    "plan",
    "plan",
    "pln",
    "plans",
    PlanRow,
    show_plans,
    Action.PLAN,
    make=PlanCreate,
    change=PlanChange,
    related=True,
    unseen=frozenset({"tree", "summary", "crl_text", "findings"}),
)
