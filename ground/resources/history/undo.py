"""Take back and do again: each is a new act in the history, nothing is ever removed from it."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from ground.errors import GroundError, NotFoundError, StateError
from ground.gdr.base import utc_now
from ground.gdr.history import ChainRow, Change, EventRow, batched, hold_chain, record
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.edit import public
from ground.records.get_resource import require_mission
from ground.records.list_history import Event, show_event
from ground.resources.history.acts import (
    Acts,
    Line,
    cells,
    newest_touching,
    refuse,
    require_free,
    require_there,
    require_unique,
    require_unused,
)
from ground.resources.kinds import KINDS

LOOK_BACK = 2000
"""How many events back the last act is looked for at first; then eight times as many, and so on."""


def undo(
    repo: Repository, actor: Actor, mission_id: str, *, anyone: bool = False, event: int | None = None
) -> list[Event]:
    """Return the events that took back an act: that of `event`, else the last of the actor (or of anybody).

    Raises
    ------
    NotFoundError
        If there is no such event.
    StateError
        If there is nothing to take back, or a later act rests on it: its number is the member `event`.
    """
    return _turn_back(repo, actor, mission_id, anyone, event, "undo")


def redo(
    repo: Repository, actor: Actor, mission_id: str, *, anyone: bool = False, event: int | None = None
) -> list[Event]:
    """Return the events that did again the act of `event`, else what was last taken back."""
    return _turn_back(repo, actor, mission_id, anyone, event, "redo")


def _turn_back(
    repo: Repository, actor: Actor, mission_id: str, anyone: bool, event: int | None, word: str
) -> list[Event]:
    try:
        with repo.database.write() as session:
            require_mission(session, mission_id)
            hold_chain(session, mission_id)  # nobody acts between look and change
            if event is None:
                event = _event_of_last_act(session, actor, mission_id, anyone, word)
            acts = Acts(session, mission_id, _first_of_act(session, mission_id, event))
            chosen = _named_act(acts, actor, anyone, event, word)
            for original in chosen:
                require_free(acts, original, word)
            if word == "redo":
                chosen.reverse()
            with batched(session):
                done = [_reverse(acts, actor, original, word) for original in chosen]
            _require_sound(acts, chosen, word)
            return [show_event(row) for row in done]
    except IntegrityError as err:
        raise StateError(f"cannot {word}: something else rests on it or took its place since") from err


def _first_of_act(session: Session, mission_id: str, event: int) -> int:
    """Return the number of the first event of the act that an event belongs to, or is about."""
    e = EventRow
    row = session.get(EventRow, (mission_id, event))
    if row is None:
        raise NotFoundError(f"there is no event {event} in mission {mission_id}", pointer="/event")
    while row.undoes is not None:
        row = session.get_one(EventRow, (mission_id, row.undoes))
    query = select(e.seq).where(e.chain_id == mission_id, e.group == row.group).order_by(e.seq).limit(1)
    return session.scalars(query).one()


def _named_act(acts: Acts, actor: Actor, anyone: bool, event: int, word: str) -> list[Line]:
    original = acts.lines[acts.lines[event].root]
    act = acts.act_of(original)
    if not act or not all(_may_turn(line) for line in act):
        raise StateError(f"{original} cannot be undone; only people's changes of a mission's parts can")
    if not anyone and any(line.actor != actor.name for line in act):
        raise StateError(f"{original} is not {actor.name}'s; say that it may be anybody's")
    if acts.is_done(act[0].seq) != (word == "undo"):
        raise StateError(f"{original} {'was taken back before' if word == 'undo' else 'stands'}")
    return act


def _may_turn(line: Line) -> bool:
    """Return whether an original can be taken back: a mission itself is made and deleted for good."""
    return line.counts and not (
        line.kind == "mission" and (line.action in {"create", "import", "copy"} or line.gone)
    )


def _event_of_last_act(session: Session, actor: Actor, mission_id: str, anyone: bool, word: str) -> int:
    """Return the number of an event of the act to turn back, looked for further and further back."""
    head = session.scalar(select(ChainRow.seq).where(ChainRow.id == mission_id)) or 0
    reach = LOOK_BACK
    while True:
        first = max(1, head - reach + 1)
        found = _last_act(Acts(session, mission_id, first), actor, anyone, word)
        if found is not None:
            return found
        if first == 1:
            raise StateError(f"there is nothing to {word}")
        reach *= 8


def _last_act(acts: Acts, actor: Actor, anyone: bool, word: str) -> int | None:
    """Return the number of an original of the act to turn back; None if it is not among these events.

    Undo looks for what was done last, for the first time or again; redo for what was last taken back, and
    finds nothing once another act came behind it.

    Raises
    ------
    StateError
        If there is none, however far back one looks.
    """
    for line in reversed(acts.lines.values()):
        if not line.counts or not (anyone or line.actor == actor.name):
            continue
        if acts.last(line.root) != line:
            continue
        root = acts.lines.get(line.root)
        if root is None:
            return None  # the act began further back
        if word == "undo" and line.action != "undo":
            if not _may_turn(root):
                break
            return line.root
        if word == "redo" and line.action == "undo":
            return line.root
        if word == "redo" and line.action != "redo":
            break
    else:
        return None
    raise StateError(f"there is nothing to {word}")


def _reverse(acts: Acts, actor: Actor, original: Line, word: str) -> EventRow:
    """Give the members that an act set the values they had before it was last done, or taken back."""
    session, kind = acts.session, KINDS[original.kind]
    actor.require(kind.edit, acts.chain_id)
    turned = acts.document(acts.last(original.seq).seq)
    names = cells(acts.document(original.seq))
    row: Any = session.get(kind.row, original.subject_id, with_for_update=True, populate_existing=True)
    before = None if row is None else public(row)
    if (row is None) != (turned.after is None):
        raise StateError(f"cannot {word} {original}: it is not what the history says")
    if turned.before is None:
        require_unused(acts, original, row, word)
        session.delete(row)
    else:
        values = _columns(kind.row, {n: turned.before[n] for n in turned.before if n in names})
        require_there(acts, original, {n: turned.before[n] for n in values}, word)
        if row is None:
            row = kind.row(**_columns(kind.row, turned.before))
            row.revision = int(turned.before["revision"])
            session.add(row)
        with session.no_autoflush:
            for name, value in values.items():
                setattr(row, name, value)
            row.revision += 1
            row.modified_utc = utc_now()
            require_unique(acts, original, row, values, word)
    session.flush()
    after = None if turned.before is None else public(row)
    change = Change(actor.name, word, kind.name, original.subject_id, before, after, undoes=turned.seq)
    return record(session, acts.chain_id, change)


def _require_sound(acts: Acts, chosen: list[Line], word: str) -> None:
    """Raise if what came back does not fit with what was done since: a circle of requests, say."""
    for original in chosen:
        kind = KINDS[original.kind]
        row = acts.session.get(kind.row, original.subject_id)
        if kind.hold is None or row is None:
            continue
        try:
            kind.hold(acts.session, row)
        except GroundError as err:
            by = newest_touching(acts, original, cells(acts.document(original.seq)))
            if by is not None:
                refuse(word, original, by)
            raise StateError(f"cannot {word} {original}: {err.message}") from err


def _columns(row: Any, document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns of a row from its JSON form."""
    out = {}
    for column in row.__mapper__.column_attrs:
        if column.key in document:
            value = document[column.key]
            if column.key.endswith("_utc") and isinstance(value, str):
                value = datetime.fromisoformat(value)
            out[column.key] = value
    return out
