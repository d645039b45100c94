"""Read the history of a mission."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select

from ground.errors import NotFoundError
from ground.gdr.history import ChainRow, EventRow
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
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


def last_event(repo: Repository, actor: Actor, mission_id: str) -> int:
    """Return the number of the newest event."""
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        seq = session.scalar(select(ChainRow.seq).where(ChainRow.id == mission_id))
    if seq is None:
        raise NotFoundError(f"there is no mission {mission_id}")
    return seq


def list_history(
    repo: Repository, actor: Actor, mission_id: str, *, after: int, limit: int, newest_first: bool
) -> Page:
    """Return changes behind the event `after` (newest first: before it, 0 = from the newest on)."""
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        if session.get(ChainRow, mission_id) is None:
            raise NotFoundError(f"there is no mission {mission_id}")
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
