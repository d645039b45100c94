"""The append-only history of a mission: undo, audit and live sync all read it.

Each mission has its own chain of events, numbered without gaps; the hash of an event covers its content and
the hash of the one before, and the head stands apart, so that an altered, removed or cut-off event shows.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import orjson
from sqlalchemy import (
    BigInteger,
    String,
    Text,
    event,
    select,
    update,
)
from sqlalchemy.orm import Mapped, Session, mapped_column

from ground.errors import DamagedDataError
from ground.gdr.as_stored import stored_rows
from ground.gdr.base import Base, table_of, utc_now
from ground.gdr.ids import new_id
from ground.gdr.seals import SYSTEM as SYSTEM
from ground.gdr.seals import drain, pending_of

GENESIS = "0" * 64


Heads = dict[str, tuple[int, str]]
"""Number and SHA-256 of the newest event of each chain."""


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


def dump_row(row: Base) -> dict[str, object]:
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
    if event.rows is not None:
        content["rows"] = event.rows
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
    if chain_id not in _held(session) and session.get_bind().dialect.name != "sqlite":
        _lock_head(session, chain_id)


def _held(session: Session) -> Heads:
    """Return the heads that this transaction has locked: nobody else changes them until its end."""
    held: Heads = session.info.setdefault("held", {})
    return held


@event.listens_for(Session, "after_soft_rollback")
def _let_go(session: Session, _previous: object) -> None:
    """Forget the heads: what a savepoint locked and wrote is undone with it."""
    session.info.pop("held", None)


def _lock_head(session: Session, chain_id: str) -> tuple[int, str] | None:
    """Return the head of a chain, now locked; None if there is no such chain."""
    query = select(ChainRow.seq, ChainRow.sha256).where(ChainRow.id == chain_id).with_for_update()
    head = session.execute(query).one_or_none()
    if head is None:
        return None
    _held(session)[chain_id] = (head.seq, head.sha256)
    return head.seq, head.sha256


def record(session: Session, chain_id: str, change: Change) -> EventRow:
    """Append an event to a chain, in the caller's transaction: all events of one are one act for undo.

    The head is locked first, so events of one chain are written one after the other.
    """
    head = _held(session).get(chain_id) or _lock_head(session, chain_id)
    if head is None and chain_id == SYSTEM:  # no server was here yet
        open_chain(session, SYSTEM)
        head = _lock_head(session, SYSTEM)
    if head is None:
        raise DamagedDataError(f"the history {chain_id} is not there")
    number, previous = head[0] + 1, head[1]
    written = EventRow(
        chain_id=chain_id,
        seq=number,
        at_utc=utc_now(),
        actor=change.actor,
        action=change.action,
        kind=change.kind,
        subject_id=change.subject_id,
        reason=change.reason or session.info.get("reason", ""),
        undoes=change.undoes,
        group=session.info.setdefault("act", new_id("act")),
        before=change.before,
        after=change.after,
        rows=drain(session, chain_id),
        sha256="",
    )
    written.sha256 = event_digest(written, previous)
    session.add(written)
    _held(session)[chain_id] = (number, written.sha256)
    unwritten: set[str] | None = session.info.get("unwritten")
    if unwritten is None:
        _set_head(session, chain_id, number, written.sha256)
    else:
        unwritten.add(chain_id)
    return written


def _set_head(session: Session, chain_id: str, seq: int, sha256: str) -> None:
    session.execute(
        update(ChainRow)
        .where(ChainRow.id == chain_id)
        .values(seq=seq, sha256=sha256)
        .execution_options(synchronize_session=False)
    )


@contextmanager
def batched(session: Session, reason: str = "") -> Iterator[None]:
    """Keep the heads of chains in memory while much is written in one transaction, and write them once.

    The first event of a chain still locks its head. Rows that are made need not be written one by one.
    `reason` is said by all events that have none of their own.
    """
    unwritten: set[str] = set()
    session.info["unwritten"], session.info["batch"], session.info["reason"] = unwritten, {}, reason
    try:
        yield
        for chain_id in unwritten:
            _set_head(session, chain_id, *_held(session)[chain_id])
    finally:
        del session.info["unwritten"], session.info["batch"], session.info["reason"]


def batch_of(session: Session) -> dict[str, set[str]] | None:
    """Return what is remembered while much is written in one transaction; None where it is not so."""
    batch: dict[str, set[str]] | None = session.info.get("batch")
    return batch


@event.listens_for(Session, "before_commit")
def _seal_the_rest(session: Session) -> None:
    """Write an event of its own for what was written and stands in no event: no row is without a seal."""
    session.flush()
    for chain_id in list(pending_of(session)):
        if pending_of(session)[chain_id]:
            record(session, chain_id, Change(SYSTEM, "seal", "rows", chain_id, None, None))


@dataclass(frozen=True, slots=True)
class ChainFault:
    """A place where a chain does not hold together."""

    chain_id: str
    seq: int
    reason: str


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
    heads: dict[str, tuple[int, str]] = {}
    for head in stored_rows(session, table_of(ChainRow)):
        chain_id, seq = str(head.values["id"]), head.values["seq"]
        heads[chain_id] = (seq, str(head.values["sha256"]))
        faults += [ChainFault(chain_id, seq, f"the head's {name} cannot be read") for name in head.damaged]
    ends = dict.fromkeys(heads, (0, GENESIS))
    count = 0
    for found in stored_rows(session, table_of(EventRow)):
        count += 1
        stored = event_of(found.values)
        chain_id, seq = stored.chain_id, stored.seq
        if chain_id not in ends:
            faults.append(ChainFault(chain_id, seq, "events without a chain head"))
        last, previous = ends.get(chain_id, (0, GENESIS))
        if seq != last + 1:
            faults.append(ChainFault(chain_id, seq, f"event {last + 1} is missing"))
        if found.damaged:
            faults.append(ChainFault(chain_id, seq, f"its {found.damaged[0]} is not as it was written"))
        elif event_digest(stored, previous) != stored.sha256:
            faults.append(ChainFault(chain_id, seq, "content does not match its hash"))
        ends[chain_id] = (seq, stored.sha256)
    for chain_id, (seq, sha256) in heads.items():
        if ends[chain_id] != (seq, sha256):
            told = f"the head is at event {seq}, the last one here is {ends[chain_id][0]}"
            faults.append(ChainFault(chain_id, seq, told))
    return count, faults


def event_of(values: Mapping[str, object]) -> EventRow:
    """Return an event from the columns of its row."""
    return EventRow(**{"group" if name == "group_id" else name: value for name, value in values.items()})


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
    before: Mapped[dict[str, Any] | None]
    after: Mapped[dict[str, Any] | None]
    rows: Mapped[dict[str, Any] | None]
    """Seals of the rows that the transaction had written by then, by `table/key`; null for one that went."""
    sha256: Mapped[str] = mapped_column(String(64))

    @property
    def topic(self) -> str:
        """Return what those follow to whom it is told."""
        return self.chain_id
