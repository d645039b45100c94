"""How approvals, waivers and flight rules are stored and shown."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.approvals.row import ApprovalRow
from ground.resources.approvals.value import Approval
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.resources.problems.inputs_digest import inputs_digest


def _standing(session: Session, rows: Sequence[ApprovalRow]) -> Callable[[ApprovalRow], Mapping[str, object]]:
    p = PlanRow
    query = select(p.id, p.state, p.inputs_sha256).where(p.id.in_({row.plan_id for row in rows}))
    plans = {plan.id: plan for plan in session.execute(query)}
    now = {i: inputs_digest(session, i) for i in {row.mission_id for row in rows}}

    def standing(row: ApprovalRow) -> Mapping[str, object]:
        plan = plans[row.plan_id]
        in_hand = plan.state not in {PlanState.UPLINKED, PlanState.EXECUTED}
        changed = plan.state != PlanState.APPROVED or plan.inputs_sha256 != now[row.mission_id]
        return {"approver": row.author, "void": in_hand and changed}

    return standing


APPROVAL = Kind("approval", "apv", "approvals", ApprovalRow, Approval, Action.APPROVE, related=_standing)
