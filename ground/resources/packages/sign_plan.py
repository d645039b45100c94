"""Take in what a person signed of a plan; an approval is the signature of a second person."""

from __future__ import annotations

import json
from dataclasses import dataclass

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.day.rovers import profile_of
from ground.errors import ConflictError, ForbiddenError, InvalidInputError, StateError
from ground.gdr.history import Change, record
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, update
from ground.records.get_resource import find_row
from ground.resources.approvals.check_flight_rules import hold_rules
from ground.resources.approvals.kind import APPROVAL
from ground.resources.approvals.row import ApprovalRow
from ground.resources.packages.row import SignatureRow, StatementRow
from ground.resources.packages.statement import (
    current_statement,
    models_digest,
    show_statement,
)
from ground.resources.packages.value import Statement
from ground.resources.people.row import PersonRow, SigningKeyRow
from ground.resources.people.signing_keys import stored_key
from ground.resources.plans.kind import PLAN
from ground.resources.plans.read_plan import computed_plan
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.uplink.verify import PACKAGE, message, signed_by


@dataclass(frozen=True, slots=True)
class Given:
    """A signature as it came: in which role, over which manifest, by which key."""

    role: str
    sha256: str
    key: str
    signature: str
    note: str = ""


def sign_plan(repo: Repository, actor: Actor, plan_id: str, given: Given) -> Statement:
    """Return the statement of a plan with the actor's signature; the approver's makes the plan approved.

    Raises
    ------
    ForbiddenError
        If the actor is not who may sign in that role: the plan's author, the author of its verifying run, or
        somebody with the right to approve who made neither the plan nor the author's signature.
    StateError
        If there is nothing current to sign, or a flight rule neither holds nor is waived.
    InvalidInputError
        If another text was signed, or the signature is not that of a key of the actor's.
    """
    with repo.database.write() as session:
        plan: PlanRow = find_row(session, PLAN, plan_id, lock=True)
        actor.require(Action.APPROVE if given.role == "approver" else Action.PLAN, plan.mission_id)
        computed_plan(session, actor, plan_id)
        if given.role == "approver" and plan.author == actor.name:
            raise ForbiddenError(f"{actor.name} made plan {plan.number}; somebody else has to approve it")
        statement = current_statement(session, plan)
        if statement is None:
            raise StateError(f"there is nothing current to sign of plan {plan.number}; ask for it first")
        if statement.sha256 != given.sha256:
            raise InvalidInputError(
                f"what is to be signed of plan {plan.number} has the digest {statement.sha256}; what was "
                "signed is another text",
                pointer="/sha256",
            )
        _check_signature(session, actor, statement, given)
        _check_role(session, actor, plan, statement, given)
        if given.role == "approver":
            _require_rules(repo, session, plan)
            _approve(session, actor, plan, given.note)
        row = SignatureRow(
            id=new_id("sgn"),
            author=actor.name,
            mission_id=plan.mission_id,
            statement_id=statement.id,
            role=given.role,
            key_id=given.key,
            signature=given.signature,
        )
        session.add(row)
        session.flush()
        after = {"role": given.role, "key": given.key, "sha256": given.sha256, "signature": given.signature}
        record(session, plan.mission_id, Change(actor.name, "sign", "plan", plan.id, None, after, given.note))
        return show_statement(session, statement, current=True)


def _check_signature(session: Session, actor: Actor, statement: StatementRow, given: Given) -> None:
    key = session.scalars(
        select(SigningKeyRow)
        .join(PersonRow, PersonRow.id == SigningKeyRow.person_id)
        .where(SigningKeyRow.id == given.key, PersonRow.name == actor.name)
    ).first()
    if key is None or key.revoked_utc is not None:
        raise InvalidInputError(
            f"{actor.name} has no key {given.key} here that is in use; register its public half first",
            pointer="/key",
        )
    content = message(PACKAGE, given.role, statement.manifest.encode())
    if not signed_by(stored_key(key.id, key.public), given.signature, content):
        raise InvalidInputError(
            f"the signature is not that of the key {given.key} over this manifest as {given.role}",
            pointer="/signature",
        )


def _check_role(session: Session, actor: Actor, plan: PlanRow, statement: StatementRow, given: Given) -> None:
    signed = session.scalars(select(SignatureRow).where(SignatureRow.statement_id == statement.id)).all()
    if any((s.role, s.author) == (given.role, actor.name) for s in signed):
        raise ConflictError(f"{actor.name} signed plan {plan.number} as {given.role} before")
    if any((s.role, s.key_id) == (given.role, given.key) for s in signed):
        raise ConflictError(f"the key {given.key} signed plan {plan.number} as {given.role} before")
    verifier = json.loads(statement.manifest)["verification"]["verifier"]
    wanted = {"author": plan.author, "verifier": verifier}.get(given.role, actor.name)
    if wanted != actor.name:
        raise ForbiddenError(f"{wanted} signs plan {plan.number} as its {given.role}, not {actor.name}")
    apart = {"author": "approver", "approver": "author"}.get(given.role)
    if any(s.role == apart and given.key == s.key_id for s in signed):
        raise ForbiddenError(f"one key cannot sign plan {plan.number} as author and as approver")


def _require_rules(repo: Repository, session: Session, plan: PlanRow) -> None:
    broken = [r for r in hold_rules(repo, session, plan) if not r.holds and r.waived_by is None]
    if broken:
        raise StateError(
            f"plan {plan.number} breaks "
            + "; ".join(f"{r.rule} ({r.value:g} {r.unit}, limit {r.limit:g}: {r.detail})" for r in broken),
            rules=[r.rule for r in broken],
        )


def _approve(session: Session, actor: Actor, plan: PlanRow, note: str) -> None:
    row = ApprovalRow(
        id=new_id("apv"),
        author=actor.name,
        mission_id=plan.mission_id,
        plan_id=plan.id,
        note=note,
        crl_sha256=plan.crl_sha256 or "",
        terrain_sha256=plan.terrain_sha256,
        dictionary_sha256=profile_of(plan.rover_profile).language.sha256,
        models_sha256=models_digest(plan.rover_profile),
    )
    insert(session, actor, APPROVAL, row)
    changes = {"state": PlanState.APPROVED.value, "approved_by": actor.name}
    update(session, actor, PLAN, plan, changes, action="approve", reason=note)
