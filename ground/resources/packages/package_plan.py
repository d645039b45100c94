"""Make the uplink package of an approved plan from what people signed; the server signs nothing."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import StateError
from ground.gdr.history import Change, record
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import update
from ground.records.get_resource import find_row
from ground.resources.packages.row import PackageRow, SignatureRow, StatementRow
from ground.resources.packages.statement import current_statement, plan_text
from ground.resources.people.row import SigningKeyRow
from ground.resources.people.signing_keys import stored_key
from ground.resources.plans.kind import PLAN
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.uplink.package import Signature, write_package
from ground.uplink.verify import (
    PACKAGE,
    SIGNERS,
    RefusedError,
    message,
    read_package,
    signed_by,
)


@dataclass(frozen=True, slots=True)
class MadePackage:
    """A package as it goes out."""

    file_name: str
    sequence: int
    sha256: str
    content: bytes


def package_plan(repo: Repository, actor: Actor, plan_id: str) -> MadePackage:
    """Return the package of an approved plan; with it the plan is uplinked.

    A plan that was packaged before gives the very same package again.

    Raises
    ------
    StateError
        If the plan is not approved, a signature lacks, or what was signed is void because something it rests
        on was changed.
    """
    with repo.database.write() as session:
        plan: PlanRow = find_row(session, PLAN, plan_id, lock=True)
        actor.require(Action.UPLINK, plan.mission_id)
        made = session.scalars(select(PackageRow).where(PackageRow.plan_id == plan.id)).first()
        if made is not None:
            return _made_before(repo, plan, made)
        if plan.state != PlanState.APPROVED.value:
            raise StateError(f"plan {plan.number} is {plan.state}; only an approved plan is uplinked")
        statement = current_statement(session, plan)
        if statement is None:
            raise StateError(
                f"what was signed of plan {plan.number} is void: it expired, or what it names was changed"
            )
        signatures = _signatures(session, plan, statement)
        content = write_package(statement.manifest, plan_text(plan), statement.landmarks, signatures)
        stored = repo.files.put_bytes(content)
        row = PackageRow(
            id=new_id("pkg"),
            author=actor.name,
            mission_id=plan.mission_id,
            plan_id=plan.id,
            sequence=statement.counter,
            sha256=stored.sha256,
            key_id=next(s.key for s in signatures if s.role == "approver"),
        )
        session.add(row)
        session.flush()
        after = {"sequence": row.sequence, "sha256": stored.sha256, "key": row.key_id}
        record(session, plan.mission_id, Change(actor.name, "package", "plan", plan.id, None, after))
        update(session, actor, PLAN, plan, {"state": PlanState.UPLINKED.value}, action="uplink")
        return MadePackage(_name(plan, row.sequence), row.sequence, stored.sha256, content)


def _made_before(repo: Repository, plan: PlanRow, made: PackageRow) -> MadePackage:
    """Return a package that went out before; raise `StateError` if it is not in the store as it was."""
    damaged = StateError(
        f"the package of plan {plan.number} is gone or damaged in the store; restore it from a backup"
    )
    try:
        if not repo.files.is_sound(made.sha256):
            raise damaged
        content = repo.files.read(made.sha256)
        counter = read_package(content).counter
    except (ValueError, OSError, RefusedError) as err:
        raise damaged from err
    return MadePackage(_name(plan, counter), counter, made.sha256, content)


def _name(plan: PlanRow, sequence: int) -> str:
    return f"outcrop-{plan.mission_id}-{sequence:04d}.zip"


def _signatures(session: Session, plan: PlanRow, statement: StatementRow) -> list[Signature]:
    """Return the signatures of a statement that hold; raise if one of the three roles has none."""
    query = (
        select(SignatureRow, SigningKeyRow.public)
        .join(SigningKeyRow, SigningKeyRow.id == SignatureRow.key_id)
        .where(SignatureRow.statement_id == statement.id)
        .order_by(SignatureRow.id)
    )
    found = [
        Signature(row.role, row.key_id, row.signature)
        for row, public in session.execute(query)
        if signed_by(
            stored_key(row.key_id, public),
            row.signature,
            message(PACKAGE, row.role, statement.manifest.encode()),
        )
    ]
    lacking = [role for role in SIGNERS if all(s.role != role for s in found)]
    if lacking:
        raise StateError(f"plan {plan.number} lacks the signature of its {' and '.join(lacking)}")
    return found
