"""Read the history of a mission."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import NotFoundError
from ground.gdr.history import SYSTEM, ChainRow, EventRow
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import require_mission
from ground.records.paging import Page
from ground.records.show import value_of


@dataclass(frozen=True, slots=True)
class Event:
    """One change of a mission; `before` and `after` are the whole resource, null where there was none."""

    seq: int
    at_utc: datetime
    actor: str
    action: str
    kind: str
    subject_id: str
    reason: str
    undoes: int | None
    before: dict[str, Any] | None
    after: dict[str, Any] | None
    sha256: str


def show_event(row: EventRow) -> Event:
    """Return the value of an event's row."""
    return value_of(Event, row)


def require_history(session: Session, actor: Actor, chain_id: str) -> None:
    """Raise unless the actor may read a history.

    A mission's is read like the mission. The system's (people, keys, log-ins, uploads) and what is left of a
    deleted mission's are there for administrators alone.

    Raises
    ------
    NotFoundError
        If it is not there for the actor.
    """
    if chain_id != SYSTEM:
        actor.require(Action.READ, chain_id)
    try:
        require_mission(session, chain_id)
    except NotFoundError:
        if not actor.may(Action.ADMINISTER) or session.get(ChainRow, chain_id) is None:
            raise


def last_event(repo: Repository, actor: Actor, mission_id: str) -> int:
    """Return the number of the newest event."""
    with repo.database.read() as session:
        require_history(session, actor, mission_id)
        return session.get_one(ChainRow, mission_id).seq


def list_history(
    repo: Repository, actor: Actor, mission_id: str, *, after: int, limit: int, newest_first: bool
) -> Page:
    """Return changes behind the event `after` (newest first: before it, 0 = from the newest on)."""
    with repo.database.read() as session:
        require_history(session, actor, mission_id)
        query = select(EventRow).where(EventRow.chain_id == mission_id).limit(limit + 1)
        if newest_first:
            query = query.order_by(EventRow.seq.desc())
            if after:
                query = query.where(EventRow.seq < after)
        else:
            query = query.order_by(EventRow.seq).where(EventRow.seq > after)
        rows = list(session.scalars(query))
    more = len(rows) > limit
    rows = rows[:limit]
    return Page([show_event(r) for r in rows], str(rows[-1].seq) if more else None)
