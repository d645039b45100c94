"""How approvals, waivers and flight rules are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.approvals.row import ApprovalRow
from ground.resources.approvals.value import Approval
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.resources.problems.inputs_digest import inputs_digest


def show_approvals(session: Session, rows: Sequence[ApprovalRow]) -> list[Approval]:
    p = PlanRow
    query = select(p.id, p.state, p.inputs_sha256).where(p.id.in_({r.plan_id for r in rows}))
    plans = {plan.id: plan for plan in session.execute(query)}
    now = {i: inputs_digest(session, i) for i in {r.mission_id for r in rows}}
    out_of_hand = {PlanState.UPLINKED, PlanState.EXECUTED}
    return [
        value_of(
            Approval,
            r,
            approver=r.author,
            void=plans[r.plan_id].state not in out_of_hand
            and (
                plans[r.plan_id].state != PlanState.APPROVED
                or plans[r.plan_id].inputs_sha256 != now[r.mission_id]
            ),
        )
        for r in rows
    ]


APPROVAL = Kind(
    "approval",
    "approval",
    "apv",
    "approvals",
    ApprovalRow,
    show_approvals,
    Action.APPROVE,
    related=True,
)
