"""Read one resource."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from sqlalchemy import Select, bindparam
from sqlalchemy.orm import Session

from ground.errors import NotFoundError
from ground.gdr import models as m
from ground.gdr.repository import Repository
from ground.services.actor import Action, Actor
from ground.services.kinds import KINDS, Kind


def mission_of(row: m.Row) -> str | None:
    """Return the id of the mission a row belongs to."""
    return row.id if isinstance(row, m.MissionRow) else getattr(row, "mission_id", None)


@lru_cache(maxsize=64)
def _one_of(kind_name: str) -> Select[Any]:
    kind = KINDS[kind_name]
    return kind.shown().where(kind.row.__table__.c.id == bindparam("wanted"))


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
    """Return the value of one resource.

    Raises
    ------
    NotFoundError
        If there is none.
    """
    kind = KINDS[kind_name]
    with repo.database.read() if kind.related else repo.database.connection() as reader:
        row: Any = reader.execute(_one_of(kind_name), {"wanted": resource_id}).first()
        if row is None:
            raise NotFoundError(f"there is no {kind.title} {resource_id}")
        actor.require(
            Action.READ, resource_id if kind_name == "mission" else getattr(row, "mission_id", None)
        )
        return kind.show(reader, [row])[0]
