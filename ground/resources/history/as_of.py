"""Look at a mission as it was when an event had been written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import and_, func, or_, select
from sqlalchemy.orm import Session

from ground.errors import NotFoundError
from ground.gdr.history import EventRow
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.edit import public
from ground.records.list_history import require_history
from ground.resources.kinds import KINDS

BESIDE = ("sign", "package", "waive")
"""Actions that give a plan something, and whose events hold none of its own columns."""
CAME_IN = ("import", "copy")
"""Actions by which a mission came with parts of which no event tells."""
PARTIAL = (*BESIDE, "import", "restore", "seal")
"""Actions whose events tell of something beside the resource that they are about."""


@dataclass(frozen=True, slots=True)
class MissionAsOf:
    """A mission and its parts as an event left them: members as they stand in the history."""

    event: int
    at_utc: datetime
    mission: dict[str, Any] | None
    """Null before it was made, and after it was deleted."""
    parts: dict[str, list[dict[str, Any]]]
    """By the name of their collection, in the order in which they were made; without jobs."""


def mission_as_of(repo: Repository, actor: Actor, mission_id: str, event: int) -> MissionAsOf:
    """Return a mission as an event left it.

    Raises
    ------
    NotFoundError
        If the mission has no such event.
    """
    with repo.database.read() as session:
        require_history(session, actor, mission_id)
        found = session.get(EventRow, (mission_id, event))
        if found is None:
            raise NotFoundError(f"there is no event {event} in mission {mission_id}", pointer="/event")
        documents = state_at(session, mission_id, event)
    parts: dict[str, list[dict[str, Any]]] = {}
    for (kind, _), document in sorted(documents.items()):
        if kind not in {"mission", "job", "merge_base"}:
            parts.setdefault(KINDS[kind].collection.replace("-", "_"), []).append(document)
    return MissionAsOf(event, found.at_utc, documents.get(("mission", mission_id)), parts)


def state_at(session: Session, mission_id: str, event: int) -> Mapping[tuple[str, str], dict[str, object]]:
    """Return what there was of a mission behind an event, by kind and id.

    The last event of a resource up to then says it. What came another way (with an archive or a copy) is what
    it was before its first event since, or what it is now.
    """
    said = _nearest(session, mission_id, event, before=True)
    found = {key: row.after for key, row in said.items()}
    for key, row in _nearest(session, mission_id, event, before=False).items():
        found.setdefault(key, row.before)
    if _came_in(session, mission_id, event):
        for kind in KINDS.values():
            rows: Any = kind.row
            key = rows.__table__.c.get(rows.mission_key)
            if key is not None:
                for row in session.scalars(select(rows).where(key == mission_id).order_by(rows.id)):
                    found.setdefault((kind.name, row.id), public(row))
    return {key: document for key, document in found.items() if document is not None}


def _came_in(session: Session, mission_id: str, event: int) -> bool:
    e = EventRow
    query = select(e.seq).where(e.chain_id == mission_id, e.seq <= event, e.action.in_(CAME_IN))
    return session.scalars(query.limit(1)).first() is not None


def _nearest(
    session: Session, mission_id: str, event: int, *, before: bool
) -> Mapping[tuple[str, str], EventRow]:
    """Return the last event of each resource up to an event, or the first behind it."""
    e = EventRow
    side = e.seq <= event if before else e.seq > event
    pick = func.max(e.seq) if before else func.min(e.seq)
    whole = or_(e.before.is_not(None), e.after.is_not(None))
    told = and_(e.chain_id == mission_id, side, e.kind.in_(list(KINDS)), e.action.not_in(PARTIAL), whole)
    chosen = select(pick).where(told).group_by(e.kind, e.subject_id)
    query = select(e).where(e.chain_id == mission_id, e.seq.in_(chosen))
    return {(row.kind, row.subject_id): row for row in session.scalars(query)}
