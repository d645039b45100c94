"""Read the history of a mission."""

from __future__ import annotations

from sqlalchemy import select

from ground.errors import NotFoundError
from ground.gdr import values as v
from ground.gdr.models import ChainRow, EventRow
from ground.gdr.repository import Repository
from ground.services.actor import Action, Actor
from ground.services.paging import Page


def show_event(row: EventRow) -> v.Event:
    """Return the value of an event's row."""
    return v.Event(
        seq=row.seq,
        at_utc=row.at_utc,
        actor=row.actor,
        action=row.action,
        kind=row.kind,
        subject_id=row.subject_id,
        reason=row.reason,
        undoes=row.undoes,
        before=row.before,
        after=row.after,
        sha256=row.sha256,
    )


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
