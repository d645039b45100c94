"""Delete a resource."""

from __future__ import annotations

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import StateError
from ground.gdr import models as m
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.services.actor import Action, Actor
from ground.services.edit import open_for_change, remove, update
from ground.services.kinds import KINDS


def delete_resource(
    repo: Repository,
    actor: Actor,
    kind_name: str,
    resource_id: str,
    revision: int | None,
    *,
    reason: str = "",
) -> None:
    """Delete a resource; a target goes with its requests, all in one undoable act.

    Raises
    ------
    StateError
        If something rests on it: a sol with plans, a plan that was approved or has runs.
    """
    if kind_name == "mission":
        actor.require(Action.ADMINISTER, resource_id)
    with repo.database.write() as session:
        kind, row = open_for_change(session, actor, kind_name, resource_id, revision)
        group = new_id("act")
        match row:
            case m.SolRow():
                if session.scalars(select(m.PlanRow.id).where(m.PlanRow.sol_id == row.id).limit(1)).first():
                    raise StateError(f"sol {row.number} has plans and stays")
            case m.PlanRow():
                if row.state in {"approved", "uplinked", "executed"}:
                    raise StateError(f"plan {row.number} is {row.state} and stays")
                if session.scalars(select(m.RunRow.id).where(m.RunRow.plan_id == row.id).limit(1)).first():
                    raise StateError(f"plan {row.number} has runs and stays")
            case m.TargetRow():
                requests = m.ObservationRequestRow
                for request in session.scalars(select(requests).where(requests.target_id == row.id)):
                    _forget_precedence(session, actor, request, group)
                    remove(session, actor, KINDS["observation_request"], request, reason=reason, group=group)
                _forget_drives(session, actor, row, group)
            case m.ObservationRequestRow():
                _forget_precedence(session, actor, row, group)
            case _:
                pass
        remove(session, actor, kind, row, reason=reason, group=group)


def _forget_precedence(session: Session, actor: Actor, request: m.ObservationRequestRow, group: str) -> None:

    rows = m.ObservationRequestRow
    for other in session.scalars(select(rows).where(rows.mission_id == request.mission_id)):
        if request.id in other.after:
            after = [i for i in other.after if i != request.id]
            update(session, actor, KINDS["observation_request"], other, {"after": after}, group=group)


def _forget_drives(session: Session, actor: Actor, target: m.TargetRow, group: str) -> None:
    mission = session.get_one(m.MissionRow, target.mission_id)
    rules = mission.drive_rules or []
    kept = [r for r in rules if target.id not in {r["from_target_id"], r["to_target_id"]}]
    if len(kept) < len(rules):
        update(session, actor, KINDS["mission"], mission, {"drive_rules": kept}, group=group)
