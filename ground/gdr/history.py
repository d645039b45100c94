"""The append-only history of a mission: undo, audit and live sync all read it.

Each mission has its own chain of events, numbered without gaps; the hash of an event covers its content and
the hash of the one before, and the head stands apart, so that an altered, removed or cut-off event shows.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import orjson
from sqlalchemy import (
    JSON,
    BigInteger,
    String,
    Text,
    select,
    update,
)
from sqlalchemy.orm import Mapped, Session, mapped_column

from ground.gdr.base import Base, Columns, utc_now
from ground.gdr.ids import new_id

SYSTEM = "system"
GENESIS = "0" * 64


@dataclass(frozen=True, slots=True)
class Change:
    """One change about to be written down."""

    actor: str
    action: str
    kind: str
    subject_id: str
    before: dict[str, Any] | None
    after: dict[str, Any] | None
    reason: str = ""
    undoes: int | None = None


def dump_row(row: Base) -> Columns:
    """Return the columns of a row as JSON values."""
    out: dict[str, Any] = {}
    for column in row.__mapper__.column_attrs:
        value = getattr(row, column.key)
        out[column.key] = value.isoformat() if isinstance(value, datetime) else value
    return out


def event_digest(event: EventRow, previous: str) -> str:
    """Return the hash of an event behind the hash `previous`."""
    content = {
        "chain": event.chain_id,
        "seq": event.seq,
        "at": event.at_utc.astimezone(UTC).isoformat(timespec="microseconds"),
        "actor": event.actor,
        "action": event.action,
        "kind": event.kind,
        "subject": event.subject_id,
        "reason": event.reason,
        "undoes": event.undoes,
        "group": event.group,
        "before": event.before,
        "after": event.after,
        "previous": previous,
    }
    return hashlib.sha256(orjson.dumps(content, option=orjson.OPT_SORT_KEYS)).hexdigest()


def open_chain(session: Session, chain_id: str) -> None:
    """Begin a chain that has no events yet."""
    session.add(ChainRow(id=chain_id, seq=0, sha256=GENESIS))
    session.flush()


def hold_chain(session: Session, chain_id: str) -> None:
    """Lock the head of a chain until the end of the transaction.

    Whoever changes something takes the chain first and the rows behind it, as undo must: so no two wait for
    each other. The embedded database has one writer, and needs no lock.
    """
    held = session.info.setdefault("held", set())
    if chain_id not in held and session.get_bind().dialect.name != "sqlite":
        session.execute(select(ChainRow.seq).where(ChainRow.id == chain_id).with_for_update())
        held.add(chain_id)


def record(session: Session, chain_id: str, change: Change) -> EventRow:
    """Append an event to a chain, in the caller's transaction: all events of one are one act for undo.

    The head is counted up first: that locks it, so events of one chain are written one after the other.
    """
    head = session.execute(
        update(ChainRow)
        .where(ChainRow.id == chain_id)
        .values(seq=ChainRow.seq + 1)
        .returning(ChainRow.seq, ChainRow.sha256)
        .execution_options(synchronize_session=False)
    ).one()
    event = EventRow(
        chain_id=chain_id,
        seq=head.seq,
        at_utc=utc_now(),
        actor=change.actor,
        action=change.action,
        kind=change.kind,
        subject_id=change.subject_id,
        reason=change.reason,
        undoes=change.undoes,
        group=session.info.setdefault("act", new_id("act")),
        before=change.before,
        after=change.after,
        sha256="",
    )
    event.sha256 = event_digest(event, head.sha256)
    session.add(event)
    session.execute(
        update(ChainRow)
        .where(ChainRow.id == chain_id)
        .values(sha256=event.sha256)
        .execution_options(synchronize_session=False)
    )
    return event


@dataclass(frozen=True, slots=True)
class ChainFault:
    """A place where a chain does not hold together."""

    chain_id: str
    seq: int
    reason: str


Heads = dict[str, tuple[int, str]]
"""Number and SHA-256 of the newest event of each chain."""


def heads_of(session: Session) -> Heads:
    """Return the heads of all chains: what is to be kept where who owns the database cannot reach it."""
    query = select(ChainRow.id, ChainRow.seq, ChainRow.sha256).order_by(ChainRow.id)
    return {row.id: (row.seq, row.sha256) for row in session.execute(query)}


def verify_against(session: Session, heads: Heads) -> list[ChainFault]:
    """Return every chain that does not go on from a head that was kept: rewritten, cut off or gone."""
    faults = []
    for chain_id, (seq, sha256) in heads.items():
        if seq == 0:
            continue
        event = session.get(EventRow, (chain_id, seq))
        if event is None:
            faults.append(ChainFault(chain_id, seq, "the event that was the head is not there any more"))
        elif event.sha256 != sha256:
            faults.append(ChainFault(chain_id, seq, "the event is not the one that was the head"))
    return faults


def verify_chains(session: Session) -> tuple[int, list[ChainFault]]:
    """Return how many events were checked, and every place where a chain is broken."""
    faults: list[ChainFault] = []
    count = 0
    chains = session.execute(select(ChainRow.id, ChainRow.seq, ChainRow.sha256).order_by(ChainRow.id)).all()
    known = {c.id for c in chains}
    for chain in chains:
        previous, seq = GENESIS, 0
        query = select(EventRow).where(EventRow.chain_id == chain.id).order_by(EventRow.seq)
        for event in session.scalars(query.execution_options(yield_per=500)):
            count += 1
            if event.seq != seq + 1:
                faults.append(ChainFault(chain.id, event.seq, f"event {seq + 1} is missing"))
            if event_digest(event, previous) != event.sha256:
                faults.append(ChainFault(chain.id, event.seq, "content does not match its hash"))
            previous, seq = event.sha256, event.seq
        if (seq, previous) != (chain.seq, chain.sha256):
            faults.append(
                ChainFault(
                    chain.id, chain.seq, f"the head is at event {chain.seq}, the last one here is {seq}"
                )
            )
    faults += (
        ChainFault(stray, 0, "events without a chain head")
        for stray in session.scalars(select(EventRow.chain_id).distinct())
        if stray not in known
    )
    return count, faults


class ChainRow(Base):
    """Head of one hash chain of events: that of a mission, or `system`."""

    __tablename__ = "event_chains"

    id: Mapped[str] = mapped_column(String(40), primary_key=True)
    seq: Mapped[int] = mapped_column(BigInteger)
    sha256: Mapped[str] = mapped_column(String(64))


class EventRow(Base):
    """One change, never altered: `sha256` covers its content and the hash of the one before."""

    __tablename__ = "events"

    chain_id: Mapped[str] = mapped_column(String(40), primary_key=True)
    seq: Mapped[int] = mapped_column(BigInteger, primary_key=True)
    at_utc: Mapped[datetime]
    actor: Mapped[str] = mapped_column(String(80))
    action: Mapped[str] = mapped_column(String(40))
    kind: Mapped[str] = mapped_column(String(40))
    subject_id: Mapped[str] = mapped_column(String(40))
    reason: Mapped[str] = mapped_column(Text, default="")
    undoes: Mapped[int | None] = mapped_column(BigInteger)
    group: Mapped[str] = mapped_column("group_id", String(40))
    """Changes made by one act, that is in one transaction; undo takes them back together."""
    before: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    after: Mapped[dict[str, Any] | None] = mapped_column(JSON(none_as_null=True))
    sha256: Mapped[str] = mapped_column(String(64))
