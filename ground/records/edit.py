"""What all changes have in common: the lock, the rights, the revision, the event."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from ground.errors import (
    StaleRevisionError,
)
from ground.gdr.base import Row, fill_defaults, utc_now
from ground.gdr.history import Change, batch_of, dump_row, hold_chain, record
from ground.gdr.ids import new_id
from ground.records.actor import Actor
from ground.records.forms import Body
from ground.records.get_resource import chain_of, find_row, mission_of
from ground.records.kind import Kind, plain


def new_row(kind: Kind[Any], actor: Actor, mission_id: str, given: Body, /, **columns: object) -> Any:
    """Return a row of a mission from what a person gave, and from columns that take its place."""
    names = set(kind.row.__table__.c.keys())
    members = {n: plain(getattr(given, n)) for n in type(given).model_fields if n in names}
    head = {"id": new_id(kind.prefix), "author": actor.name, "mission_id": mission_id}
    return kind.row(**{**head, **members, **columns})


def insert(session: Session, actor: Actor, kind: Kind[Any], row: Row, *, reason: str = "") -> None:
    """Add a row and write the event; in a batch the row is written later, with others."""
    hold_chain(session, chain_of(row))
    session.add(row)
    if batch_of(session) is not None:
        fill_defaults(row)
    else:
        session.flush()
    change = Change(actor.name, "create", kind.name, row.id, None, public(row), reason)
    record(session, chain_of(row), change)


def open_for_change(
    session: Session, actor: Actor, kind: Kind[Any], resource_id: str, revision: int | None
) -> Any:
    """Return a row locked for change.

    Raises
    ------
    StaleRevisionError
        If `revision` is given and is not the present one.
    """
    row = find_row(session, kind, resource_id, lock=True)
    actor.require(kind.edit, mission_of(row))
    if revision is not None and row.revision != revision:
        raise StaleRevisionError(
            f"{kind.title} {resource_id} is at revision {row.revision}; the change was meant for {revision}",
            current=kind.show_one(session, row),
        )
    return row


def update(
    session: Session,
    actor: Actor,
    kind: Kind[Any],
    row: Row,
    changes: Mapping[str, object],
    *,
    action: str = "change",
    reason: str = "",
) -> None:
    """Set columns, count the revision up and write the event; nothing happens if nothing is new."""
    if all(getattr(row, name) == value for name, value in changes.items()):
        return
    hold_chain(session, chain_of(row))
    before = public(row)
    for name, value in changes.items():
        setattr(row, name, value)
    row.revision += 1
    row.modified_utc = utc_now()
    session.flush()
    record(
        session,
        chain_of(row),
        Change(actor.name, action, kind.name, row.id, before, public(row), reason),
    )


def remove(session: Session, actor: Actor, kind: Kind[Any], row: Row, *, reason: str = "") -> None:
    """Delete a row and write the event, which keeps the whole row."""
    before, chain = public(row), chain_of(row)
    hold_chain(session, chain)
    session.delete(row)
    session.flush()
    record(session, chain, Change(actor.name, "delete", kind.name, row.id, before, None, reason))


SECRET = frozenset({"password_hash", "external_sha256"})
BULKY = SECRET | {"tree", "summary", "crl_text", "document", "geometry", "payload", "log"}
"""Columns of computed results and secrets: the history has their digest, not their content."""


def public(row: Row) -> dict[str, object]:
    """Return a row as it stands in the history: without secrets and without the bulk of computed results."""
    return {name: value for name, value in dump_row(row).items() if name not in BULKY}


def next_number(session: Session, row: Any, mission_id: str) -> int:
    """Return one more than the largest `number` in the mission."""
    return int(session.scalar(select(func.max(row.number)).where(row.mission_id == mission_id)) or 0) + 1
