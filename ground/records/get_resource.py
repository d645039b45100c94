"""Read one resource."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from sqlalchemy import Connection, Select, bindparam, column, select, table
from sqlalchemy.orm import Session

from ground.errors import NotFoundError
from ground.gdr.base import Row
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.kind import Kind

_MISSIONS = table("missions", column("id"))


def mission_of(row: Row) -> str | None:
    """Return the id of the mission a row belongs to."""
    return getattr(row, row.mission_key, None)


@lru_cache(maxsize=64)
def _one_of(kind: Kind) -> Select[Any]:
    return kind.shown().where(kind.row.__table__.c.id == bindparam("wanted"))


def require_mission(session: Session | Connection, mission_id: str) -> None:
    """Raise unless there is the mission.

    Raises
    ------
    NotFoundError
        If there is none.
    """
    if session.execute(select(_MISSIONS.c.id).where(_MISSIONS.c.id == mission_id)).first() is None:
        raise NotFoundError(f"there is no mission {mission_id}")


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


def get_resource(repo: Repository, actor: Actor, kind: Kind, resource_id: str) -> Any:
    """Return the value of one resource.

    Raises
    ------
    NotFoundError
        If there is none.
    """
    with repo.database.read() if kind.related else repo.database.connection() as reader:
        row: Any = reader.execute(_one_of(kind), {"wanted": resource_id}).first()
        if row is None:
            raise NotFoundError(f"there is no {kind.title} {resource_id}")
        actor.require(Action.READ, getattr(row, kind.row.mission_key, None))
        return kind.show(reader, [row])[0]
