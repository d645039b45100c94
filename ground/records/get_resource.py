"""Read one resource."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, TypeVar

from sqlalchemy import Boolean, Connection, Select, bindparam, column, exists, select, table
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, NotFoundError
from ground.gdr.base import Row
from ground.gdr.history import SYSTEM, hold_chain
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.kind import Kind

V = TypeVar("V")
_MISSIONS = table("missions", column("id"), column("in_making", Boolean))


def mission_of(row: Row) -> str | None:
    """Return the id of the mission a row belongs to."""
    return getattr(row, row.mission_key, None)


def chain_of(row: Row) -> str:
    """Return the chain of events a row's changes are written to."""
    return mission_of(row) or SYSTEM


@lru_cache(maxsize=64)
def _one_of(kind: Kind[Any]) -> Select[Any]:
    return shown_whole(kind).where(kind.row.__table__.c.id == bindparam("wanted"))


def shown_whole(kind: Kind[Any]) -> Select[Any]:
    """Return the query for what `show` needs, but for what belongs to a copy that is not whole yet."""
    mission = kind.row.__table__.c.get(kind.row.mission_key)
    if mission is None or kind.absent is not None:
        return kind.shown()
    return kind.shown().where(~exists().where(_MISSIONS.c.id == mission, _MISSIONS.c.in_making))


def require_mission(session: Session | Connection, mission_id: str) -> None:
    """Raise unless there is the mission.

    Raises
    ------
    NotFoundError
        If there is none.
    """
    there = (_MISSIONS.c.id == mission_id, _MISSIONS.c.in_making.is_(False))
    if session.execute(select(_MISSIONS.c.id).where(*there)).first() is None:
        raise NotFoundError(f"there is no mission {mission_id}")


def in_making(reader: Session | Connection, mission_id: str) -> bool:
    """Return whether a mission is a copy that is not whole yet, which is there for nobody."""
    query = select(_MISSIONS.c.in_making).where(_MISSIONS.c.id == mission_id)
    return bool(reader.execute(query).scalar())


def find_row(
    session: Session, kind: Kind[Any], resource_id: str, *, lock: bool = False, pointer: str | None = None
) -> Any:
    """Return a row, locked until the end of the transaction where it is about to change.

    What can be undone is locked behind the head of its history, as undo does it.

    Raises
    ------
    NotFoundError
        If there is none; `pointer` is the member of the form that names it.
    """
    row = session.get(kind.row, resource_id)
    if lock and row is not None:
        if kind.undoable:
            hold_chain(session, chain_of(row))
        # what was read before the lock may be old by now
        row = session.get(kind.row, resource_id, with_for_update=True, populate_existing=True)
    if row is None or _absent(session, kind, row):
        raise NotFoundError(f"there is no {kind.title} {resource_id}", pointer=pointer)
    return row


def _absent(session: Session, kind: Kind[Any], row: Row) -> bool:
    """Return whether a row is there for nobody yet, by itself or as a part of a copy."""
    if kind.absent is not None:
        return bool(getattr(row, kind.absent))
    mission_id = mission_of(row)
    return mission_id is not None and in_making(session.connection(), mission_id)  # which flushes nothing


def read_row(repo: Repository, actor: Actor, kind: Kind[Any], resource_id: str) -> Any:
    """Return a row of a mission for somebody who may read it.

    Raises
    ------
    NotFoundError
        If there is none.
    """
    with repo.database.read() as session:
        row = find_row(session, kind, resource_id)
        actor.require(Action.READ, mission_of(row))
        return row


def row_in_mission(
    session: Session, kind: Kind[Any], resource_id: str | None, mission_id: str, pointer: str
) -> Any:
    """Return a row that a form about a mission names.

    Raises
    ------
    InvalidInputError
        If the mission has no such resource; `pointer` is the member of the form.
    """
    row = session.get(kind.row, resource_id)
    if row is None or mission_of(row) != mission_id:
        raise InvalidInputError(
            f"there is no {kind.title} {resource_id} in mission {mission_id}", pointer=pointer
        )
    return row


def shown_to(actor: Actor, kind: Kind[V], resource_id: str, row: Any, reader: Any = None) -> V:
    """Return the value of a row that was read, as an actor may see it; None is a row that is not there.

    Raises
    ------
    NotFoundError
        If it is not there for the actor.
    """
    if row is None or any(getattr(row, n) != value for n, value in kind.only(actor).items()):
        raise NotFoundError(f"there is no {kind.title} {resource_id}")
    actor.require(Action.READ, getattr(row, kind.row.mission_key, None))
    value: V = kind.conceal(actor, kind.show_one(reader, row))
    return value


def get_resource(
    repo: Repository, actor: Actor, kind: Kind[V], resource_id: str, *, crs: str | None = None
) -> V:
    """Return the value of one resource; where it lies in another reference too, if one is named.

    Raises
    ------
    NotFoundError
        If there is none.
    InvalidInputError
        If there is no such reference, or the mission has no place on a body.
    """
    with repo.database.read() if kind.related else repo.database.connection() as reader:
        row: Any = reader.execute(_one_of(kind), {"wanted": resource_id}).first()
        value: V = shown_to(actor, kind, resource_id, row, reader)
        if crs is not None and kind.locate is not None:
            (value,) = kind.locate(reader, getattr(row, kind.row.mission_key, None), [value], crs)
        return value
