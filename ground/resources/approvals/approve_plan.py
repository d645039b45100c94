"""Approve a plan: a second person's word for exactly these digests."""

from __future__ import annotations

import hashlib
from dataclasses import asdict
from importlib.metadata import version

import orjson
from sqlalchemy.orm import Session

from ground.day.rovers import profile_of
from ground.errors import ForbiddenError, InvalidInputError, StateError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, update
from ground.records.get_resource import find_row
from ground.resources.approvals.check_flight_rules import flight_rules, hold_rules
from ground.resources.approvals.kind import APPROVAL, show_approvals
from ground.resources.approvals.row import ApprovalRow
from ground.resources.approvals.value import Approval
from ground.resources.plans.kind import PLAN
from ground.resources.plans.read_plan import computed_plan
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.resources.problems.inputs_digest import inputs_digest


def models_digest(rover_profile: str) -> str:
    """Return the SHA-256 over what turned inputs into the plan: program, rover profile, flight rules."""
    content = {
        "outcrop": version("outcrop"),
        "profile": profile_of(rover_profile).sha256,
        "rules": [asdict(rule) for rule in flight_rules()],
    }
    return hashlib.sha256(orjson.dumps(content, option=orjson.OPT_SORT_KEYS)).hexdigest()


def approve_plan(repo: Repository, actor: Actor, plan_id: str, crl_sha256: str, note: str = "") -> Approval:
    """Return the approval of a verified plan.

    Raises
    ------
    ForbiddenError
        If the approver made the plan, whatever their role.
    StateError
        If the plan is not verified, is stale, or a flight rule neither holds nor is waived.
    InvalidInputError
        If the digest is not that of the plan.
    """
    with repo.database.write() as session:
        plan: PlanRow = find_row(session, PLAN, plan_id, lock=True)
        actor.require(Action.APPROVE, plan.mission_id)
        computed_plan(session, actor, plan_id)
        if plan.author == actor.name:
            raise ForbiddenError(f"{actor.name} made plan {plan.number}; somebody else has to approve it")
        if plan.state != PlanState.VERIFIED.value:
            raise StateError(f"plan {plan.number} is {plan.state}; only a verified plan is approved")
        if plan.crl_sha256 != crl_sha256:
            raise InvalidInputError(
                f"plan {plan.number} has the digest {plan.crl_sha256}; what was read is another text",
                pointer="/crl_sha256",
            )
        require_fresh(session, plan)
        broken = [r for r in hold_rules(repo, session, plan) if not r.holds and r.waived_by is None]
        if broken:
            raise StateError(
                f"plan {plan.number} breaks "
                + "; ".join(
                    f"{r.rule} ({r.value:g} {r.unit}, limit {r.limit:g}: {r.detail})" for r in broken
                ),
                rules=[r.rule for r in broken],
            )
        row = ApprovalRow(
            id=new_id("apv"),
            author=actor.name,
            mission_id=plan.mission_id,
            plan_id=plan.id,
            note=note,
            crl_sha256=crl_sha256,
            terrain_sha256=plan.terrain_sha256,
            dictionary_sha256=profile_of(plan.rover_profile).language.sha256,
            models_sha256=models_digest(plan.rover_profile),
        )
        insert(session, actor, APPROVAL, row)
        changes = {"state": PlanState.APPROVED.value, "approved_by": actor.name}
        update(session, actor, PLAN, plan, changes, action="approve", reason=note)
        session.flush()
        return show_approvals(session, [row])[0]


def require_fresh(session: Session, plan: PlanRow) -> None:
    """Raise `StateError` if the mission was edited since the plan was asked for."""
    if inputs_digest(session, plan.mission_id) != plan.inputs_sha256:
        raise StateError(
            f"the mission was edited since plan {plan.number} was computed; plan anew "
            "(any edit voids an approval)"
        )
