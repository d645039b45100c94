"""Make the signed uplink package of an approved plan."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from ground.day.rovers import profile_of
from ground.errors import StateError
from ground.gdr.history import Change, record
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import update
from ground.records.get_resource import find_row
from ground.resources.approvals.approve_plan import models_digest, require_fresh
from ground.resources.approvals.row import ApprovalRow
from ground.resources.missions.row import MissionRow
from ground.resources.packages.row import PackageRow
from ground.resources.plans.kind import PLAN
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.resources.sols.row import SolRow
from ground.resources.targets.row import TargetRow
from ground.uplink.keys import key_id, load_private
from ground.uplink.package import write_package


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
        If the plan is not approved, or its approval is void because something it rests on was changed.
    UnavailableError
        If there is no signing key.
    """
    from executive.crl import canonical_text, parse

    with repo.database.write() as session:
        plan: PlanRow = find_row(session, PLAN, plan_id, lock=True)
        actor.require(Action.UPLINK, plan.mission_id)
        made = session.scalars(select(PackageRow).where(PackageRow.plan_id == plan.id)).first()
        if made is not None:
            content = repo.files.read(made.sha256)
            return MadePackage(_name(plan, made.sequence), made.sequence, made.sha256, content)
        if plan.state != PlanState.APPROVED.value:
            raise StateError(f"plan {plan.number} is {plan.state}; only an approved plan is uplinked")
        require_fresh(session, plan)
        approval = _valid_approval(session, plan)
        key = load_private(repo.data_dir / "keys")
        sequence = (
            int(
                session.scalar(
                    select(func.max(PackageRow.sequence)).where(PackageRow.mission_id == plan.mission_id)
                )
                or 0
            )
            + 1
        )
        profile = profile_of(plan.rover_profile)
        sol = session.get_one(SolRow, plan.sol_id)
        targets = session.scalars(
            select(TargetRow).where(TargetRow.mission_id == plan.mission_id).order_by(TargetRow.id)
        )
        manifest = {
            "mission": plan.mission_id,
            "mission_name": session.get_one(MissionRow, plan.mission_id).name,
            "plan": plan.id,
            "plan_number": plan.number,
            "sol": sol.number,
            "sequence": sequence,
            "crl_sha256": plan.crl_sha256,
            "terrain_sha256": plan.terrain_sha256,
            "dictionary": {
                "name": profile.language.name,
                "version": profile.language.version,
                "sha256": approval.dictionary_sha256,
            },
            "profile": {"name": profile.name, "version": profile.version, "sha256": profile.sha256},
            "models_sha256": approval.models_sha256,
            "author": plan.author,
            "approver": approval.author,
            "approved_utc": approval.created_utc.isoformat(),
        }
        landmarks = {
            "format": "landmarks/1",
            "frame": "site",
            "axes": "east, north, up; metres",
            "start": sol.start_pose,
            "targets": [
                {
                    "id": t.id,
                    "name": t.name,
                    "point_m": [t.east_m, t.north_m, t.up_m],
                    "normal": t.normal,
                    "covariance_m2": t.covariance_m2,
                }
                for t in targets
            ],
        }
        content = write_package(manifest, canonical_text(parse(plan.crl_text or "")), landmarks, key)
        stored = repo.files.put_bytes(content)
        row = PackageRow(
            id=new_id("pkg"),
            author=actor.name,
            mission_id=plan.mission_id,
            plan_id=plan.id,
            sequence=sequence,
            sha256=stored.sha256,
            key_id=key_id(key.public_key()),
        )
        session.add(row)
        session.flush()
        after = {"sequence": sequence, "sha256": stored.sha256, "key": row.key_id}
        record(session, plan.mission_id, Change(actor.name, "package", "plan", plan.id, None, after))
        update(session, actor, PLAN, plan, {"state": PlanState.UPLINKED.value}, action="uplink")
        return MadePackage(_name(plan, sequence), sequence, stored.sha256, content)


def _name(plan: PlanRow, sequence: int) -> str:
    return f"outcrop-{plan.mission_id}-{sequence:04d}.zip"


def _valid_approval(session: Session, plan: PlanRow) -> ApprovalRow:
    """Return the approval of a plan if everything it names is still what it was."""
    approval = session.scalars(
        select(ApprovalRow).where(ApprovalRow.plan_id == plan.id).order_by(ApprovalRow.id.desc()).limit(1)
    ).first()
    if approval is None:
        raise StateError(f"plan {plan.number} has no approval")
    present = {
        "CRL": (approval.crl_sha256, plan.crl_sha256),
        "terrain": (approval.terrain_sha256, plan.terrain_sha256),
        "command dictionary": (approval.dictionary_sha256, profile_of(plan.rover_profile).language.sha256),
        "models": (approval.models_sha256, models_digest(plan.rover_profile)),
    }
    changed = [name for name, (then, now) in present.items() if then != now]
    if changed:
        raise StateError(f"the approval of plan {plan.number} is void: changed since: {', '.join(changed)}")
    return approval
