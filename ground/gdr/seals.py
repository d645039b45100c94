"""Seals: the digest of each row that a transaction left behind, written into the history.

Events say what people changed, without the bulk of computed results; a seal covers every column of a row, and
every table whose rows are to stay as they are. It is taken of whatever a session writes, by whichever code.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from datetime import UTC
from functools import cache
from typing import Any

import orjson
from sqlalchemy import JSON, Boolean, Column, Float, Integer, Table, event, select
from sqlalchemy.orm import Session
from sqlalchemy.sql.schema import ScalarElementColumnDefault

from ground.gdr.base import Base, Utc, table_of

UNSEALED = frozenset(
    {
        "jobs",
        "credentials",
        "login_failures",
        "invitations",
        "idempotency_keys",
        "events",
        "event_chains",
        "webhook_states",
        "webhook_deliveries",
    }
)
"""Tables of what comes and goes, and of the history, which holds itself together."""
SECRET = frozenset({"password_hash"})
"""Columns that a backup leaves out."""
SYSTEM = "system"

Seals = dict[str, str | None]
"""SHA-256 of rows by `table/key`; null for a row that went."""


Values = Mapping[Any, Any]
"""The columns of a row by name."""


def key_of(table: Table, values: Values) -> str:
    """Return what a row is known by in seals."""
    return "/".join([table.name, *(str(values[column.name]) for column in table.primary_key.columns)])


def row_digest(table: Table, values: Values) -> str:
    """Return the SHA-256 of a row, by the names of its columns.

    What is null or the column's default does not count: a column of a later version changes no digest.
    """
    content = {}
    for name, plain, usual in sealed_columns(table):
        value = values[name]
        if value is not None and plain is not None:
            value = plain(value)
        if value is not None and value != usual:
            content[name] = value
    return content_digest(content)


def content_digest(content: Mapping[str, object]) -> str:
    """Return the SHA-256 of what a seal covers of a row, by the names of its columns."""
    options = orjson.OPT_SORT_KEYS | orjson.OPT_NON_STR_KEYS
    try:
        text = orjson.dumps(content, default=_number, option=options)
    except TypeError:  # half of a surrogate pair, say
        text = json.dumps(content, sort_keys=True, default=_number).encode()
    return hashlib.sha256(text).hexdigest()


Plain = Callable[[Any], Any]


@cache
def sealed_columns(table: Table) -> tuple[tuple[str, Plain | None, object], ...]:
    """Return the name, the plain form and the usual value of each column that a seal covers."""
    return tuple((c.name, plain_of(c.type), _usual(c)) for c in table.columns if c.name not in SECRET)


def _usual(column: Column[Any]) -> object:
    """Return what older rows got when a column came: its default, of the database's own kind if need be."""
    if isinstance(column.default, ScalarElementColumnDefault):
        return column.default.arg
    kind = column.type.python_type if column.server_default is not None else None
    return kind() if kind in {str, bool, int, float} else None


def plain_of(kind: object) -> Plain | None:
    """Return what makes of a value what it is after a way through the database; None where it is the same."""
    if isinstance(kind, JSON):
        return None
    if isinstance(kind, Utc):
        return lambda value: value.astimezone(UTC).isoformat(timespec="microseconds")
    if isinstance(kind, Boolean):
        return bool
    if isinstance(kind, Integer):
        return int
    if isinstance(kind, Float):
        return lambda value: float(value) + 0.0  # SQLite keeps no -0.0
    return str


def _number(value: Any) -> Any:
    return value.item()  # of numpy


def values_of(row: Base) -> dict[str, object]:
    """Return the values of a row by the names of its columns."""
    return {
        attribute.columns[0].name: getattr(row, attribute.key) for attribute in row.__mapper__.column_attrs
    }


def sealed_tables() -> list[Table]:
    """Return the tables whose rows are sealed."""
    return [table for table in Base.metadata.sorted_tables if table.name not in UNSEALED]


def chain_of(row: Any) -> str:
    """Return the chain of events that a row's seals belong to."""
    name = getattr(type(row), "mission_key", "mission_id")
    return getattr(row, name, None) or SYSTEM


_Pending = dict[str, dict[str, Base | str | None]]
"""Rows that were written and are not sealed yet, or their seals, by chain and key."""


def pending_of(session: Session) -> _Pending:
    """Return what a session has written and not sealed."""
    found: _Pending = session.info.setdefault("unsealed", {})
    return found


def drain(session: Session, chain_id: str) -> Seals | None:
    """Return the seals of what was written of a chain since the last time; None without any."""
    rows = pending_of(session).pop(chain_id, {})
    return {
        key: row if row is None or isinstance(row, str) else row_digest(table_of(row), values_of(row))
        for key, row in rows.items()
    } or None


def seal_digests(
    session: Session, chain_id: str, table: Table, ids: Iterable[str], digests: Iterable[str]
) -> None:
    """Seal rows of a chain by their ids and digests."""
    pending = pending_of(session).setdefault(chain_id, {})
    pending |= zip(map(f"{table.name}/".__add__, ids), digests, strict=True)


def seal_values(session: Session, chain_id: str, table: Table, rows: list[dict[str, object]]) -> None:
    """Seal rows of a chain that are written by their columns, and not through the session."""
    pending = pending_of(session).setdefault(chain_id, {})
    for values in rows:
        pending[key_of(table, values)] = row_digest(table, values)


def seal(session: Session, row: Base) -> None:
    """Have a row sealed by the next event of its chain, or at the end of the transaction."""
    table = table_of(row)
    if table.name not in UNSEALED:
        pending_of(session).setdefault(chain_of(row), {})[key_of(table, values_of(row))] = row


def seal_mission(session: Session, mission_id: str) -> None:
    """Have every row of a mission sealed: they came by another way than through the session."""
    for mapper in Base.registry.mappers:
        rows: Any = mapper.class_
        key = rows.__table__.c.get(getattr(rows, "mission_key", "mission_id"))
        if key is not None and rows.__tablename__ not in UNSEALED:
            for row in session.scalars(select(rows).where(key == mission_id)):
                seal(session, row)


@event.listens_for(Session, "before_flush")
def _note_what_falls(session: Session, _context: object, _objects: object) -> None:
    """Note what goes with a row by `ON DELETE CASCADE`; what goes with a mission need not be named."""
    for row in session.deleted:
        table = row.__table__
        if table.name not in UNSEALED and table.name != "missions":
            noted = pending_of(session).setdefault(chain_of(row), {})
            noted |= dict.fromkeys(_falling(session, table, values_of(row)))
            noted[key_of(table, values_of(row))] = None


def _falling(session: Session, table: Table, values: Values) -> Iterator[str]:
    for child in sealed_tables():
        for key in child.foreign_keys:
            if key.column.table is table and key.ondelete == "CASCADE":
                query = select(child).where(key.parent == values[key.column.name])
                with session.no_autoflush:
                    for row in session.execute(query).mappings().all():
                        yield key_of(child, row)
                        yield from _falling(session, child, row)


@event.listens_for(Session, "after_flush")
def _note_what_was_written(session: Session, _context: object) -> None:
    for row in session.new:
        seal(session, row)
    for row in session.dirty:
        if session.is_modified(row):
            seal(session, row)
    for row in session.deleted:
        if row.__table__.name == "missions":
            pending_of(session).setdefault(row.id, {})[key_of(row.__table__, values_of(row))] = None


@event.listens_for(Session, "after_soft_rollback")
def _forget(session: Session, _transaction: object) -> None:
    pending_of(session).clear()
