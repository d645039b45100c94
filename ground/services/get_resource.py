"""Read one resource."""

from __future__ import annotations

from typing import Any

from sqlalchemy import bindparam, select
from sqlalchemy.orm import Session

from ground.errors import NotFoundError
from ground.gdr import models as m
from ground.gdr.repository import Repository
from ground.services.actor import Action, Actor
from ground.services.kinds import KINDS, Kind, show_targets

_TARGET_COLUMNS = m.TargetRow.__table__
_TARGET_QUERY = select(_TARGET_COLUMNS).where(_TARGET_COLUMNS.c.id == bindparam("wanted"))


def mission_of(row: m.Row) -> str | None:
    """Return the id of the mission a row belongs to."""
    return row.id if isinstance(row, m.MissionRow) else getattr(row, "mission_id", None)


def find_row(session: Session, kind: Kind, resource_id: str, *, lock: bool = False) -> Any:
    """Return a row, locked until the end of the transaction where it is about to change.

    Raises
    ------
    NotFoundError
        If there is none.
    """
    row = session.get(kind.row, resource_id, with_for_update=True if lock else None)
    if row is None:
        raise NotFoundError(f"there is no {kind.title} {resource_id}")
    return row


def get_resource(repo: Repository, actor: Actor, kind_name: str, resource_id: str) -> Any:
    """Return the value of one resource."""
    kind = KINDS[kind_name]
    if kind_name == "target":
        with repo.database.connection() as connection:
            record = connection.execute(_TARGET_QUERY, {"wanted": resource_id}).first()
        if record is None:
            raise NotFoundError(f"there is no target {resource_id}")
        actor.require(Action.READ, record.mission_id)
        return show_targets(None, [record])[0]
    with repo.database.read() as session:
        row = find_row(session, kind, resource_id)
        actor.require(Action.READ, mission_of(row))
        return kind.show(session, [row])[0]
