"""Take back and do again: each is a new act in the history, nothing is ever removed from it."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from ground.errors import StateError
from ground.gdr.base import utc_now
from ground.gdr.history import Change, EventRow, record
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.edit import public
from ground.records.get_resource import require_mission
from ground.records.list_history import Event, show_event
from ground.resources.kinds import KINDS

LOOK_BACK = 2000
"""How many events back an act is looked for."""


def undo(repo: Repository, actor: Actor, mission_id: str, *, anyone: bool = False) -> list[Event]:
    """Return the events that took back the last act of the actor (or of anybody).

    Raises
    ------
    StateError
        If there is nothing to take back, or somebody changed the same things since.
    """
    return _turn_back(repo, actor, mission_id, anyone, word="undo")


def redo(repo: Repository, actor: Actor, mission_id: str, *, anyone: bool = False) -> list[Event]:
    """Return the events that did again what was last taken back."""
    return _turn_back(repo, actor, mission_id, anyone, word="redo")


def _turn_back(repo: Repository, actor: Actor, mission_id: str, anyone: bool, word: str) -> list[Event]:
    try:
        with repo.database.write() as session:
            require_mission(session, mission_id)
            act = _last_act(session, actor, mission_id, anyone, word)
            group = new_id("act")
            done = [_reverse(session, actor, event, group, word) for event in act]
            return [show_event(event) for event in done]
    except IntegrityError as err:
        raise StateError(f"cannot {word}: something else rests on it or took its place since") from err


def _last_act(session: Session, actor: Actor, mission_id: str, anyone: bool, word: str) -> list[EventRow]:
    """Return the events of the act to turn back, newest first.

    Undo looks for the newest act of people that was not taken back yet; redo for the newest undo that was
    not done again, and finds none once another act came behind it.
    """
    query = (
        select(EventRow).where(EventRow.chain_id == mission_id).order_by(EventRow.seq.desc()).limit(LOOK_BACK)
    )
    events = [e for e in session.scalars(query) if KINDS.get(e.kind) is not None and KINDS[e.kind].undoable]
    events = [e for e in events if e.actor != "system" and (anyone or e.actor == actor.name)]
    turned = {e.undoes for e in events if e.undoes is not None}
    for event in events:
        if event.seq in turned:
            continue
        if word == "undo":
            if event.action == "undo":
                continue
        elif event.action != "undo":
            if event.action == "redo":
                continue
            break
        if event.kind == "mission" and event.action == "create":
            break
        return [e for e in events if e.group == event.group]
    raise StateError(f"there is nothing to {word}")


def _reverse(session: Session, actor: Actor, event: EventRow, group: str, word: str) -> EventRow:
    kind = KINDS[event.kind]
    actor.require(kind.edit, event.chain_id)
    row: Any = session.get(kind.row, event.subject_id, with_for_update=True)
    before = None if row is None else public(row)
    if _meaning(before) != _meaning(event.after):
        raise StateError(f"cannot {word}: {kind.title} {event.subject_id} was changed since by somebody else")
    if event.before is None:
        session.delete(row)
    elif row is None:
        row = kind.row(**_columns(kind.row, event.before))
        row.revision = int(event.before["revision"]) + 1
        row.modified_utc = utc_now()
        session.add(row)
    else:
        for name, value in _columns(kind.row, event.before).items():
            if name not in {"id", "revision", "modified_utc", "created_utc"}:
                setattr(row, name, value)
        row.revision += 1
        row.modified_utc = utc_now()
    session.flush()
    after = None if event.before is None else public(row)
    change = Change(
        actor.name, word, kind.name, event.subject_id, before, after, undoes=event.seq, group=group
    )
    return record(session, event.chain_id, change)


def _meaning(document: dict[str, Any] | None) -> dict[str, Any] | None:
    """Leave away what changes with every edit."""
    if document is None:
        return None
    ignored = {"revision", "modified_utc", "state", "state_reason", "observation_point"}
    return {k: value for k, value in document.items() if k not in ignored}


def _columns(row: Any, document: dict[str, Any]) -> dict[str, Any]:
    """Return the columns of a row from its JSON form."""
    out = {}
    for column in row.__mapper__.column_attrs:
        if column.key in document:
            value = document[column.key]
            if column.key.endswith("_utc") and isinstance(value, str):
                value = datetime.fromisoformat(value)
            out[column.key] = value
    return out
