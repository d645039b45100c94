"""Rows as they are stored, read so that no damage stops the reading and none goes unseen.

A driver raises on a text that is not UTF-8, and a reader of times or JSON passes over a damaged digit or
letter that leaves the meaning as it was. Here each column is checked against what this program would have
written for the value that was read.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import (
    JSON,
    Boolean,
    Float,
    Integer,
    LargeBinary,
    String,
    Table,
    Text,
    cast,
    select,
    type_coerce,
)
from sqlalchemy.orm import Session
from sqlalchemy.types import NULLTYPE

from ground.gdr.base import Columns, Utc
from ground.gdr.decoding import dumps

_TEXTS = (JSON, Utc, String)


@dataclass(frozen=True, slots=True)
class StoredRow:
    """The readable columns of a row by name, and the names of those that are not as they were written."""

    values: Columns
    damaged: tuple[str, ...]


def stored_rows(session: Session, table: Table) -> Iterator[StoredRow]:
    """Yield every row of a table in the order of its key."""
    sqlite = session.get_bind().dialect.name == "sqlite"
    query = select(*(_raw(column, sqlite) for column in table.columns)).order_by(*table.primary_key.columns)
    for row in session.execute(query.execution_options(yield_per=200)):
        values, damaged = {}, []
        for column, raw in zip(table.columns, row, strict=True):
            try:
                values[column.name] = None if raw is None else _read(column.type, raw)
            except (ValueError, RecursionError):
                damaged.append(column.name)
                values[column.name] = raw.decode(errors="replace") if isinstance(raw, bytes) else raw
        yield StoredRow(values, tuple(damaged))


def _raw(column: Any, sqlite: bool) -> Any:
    if sqlite:
        if isinstance(column.type, _TEXTS):
            return cast(column, LargeBinary).label(column.name)
        return type_coerce(column, NULLTYPE).label(column.name)
    return cast(column, Text).label(column.name) if isinstance(column.type, JSON) else column


def _read(kind: object, raw: Any) -> Any:
    """Return the value that was written.

    Raises
    ------
    ValueError
        If it is not what would be written for any value.
    """
    text = raw.decode() if isinstance(raw, bytes) else raw
    if isinstance(kind, JSON):
        value = json.loads(text)
        if text not in {dumps(value), json.dumps(value)}:  # older rows have spaces
            raise ValueError("not as JSON is written here")
        return value
    if isinstance(kind, Utc) and isinstance(text, str):
        value = datetime.fromisoformat(text)
        if value.isoformat(sep=" ", timespec="microseconds") != text:
            raise ValueError("not as times are written here")
        return value.replace(tzinfo=UTC)
    if isinstance(kind, Boolean) and text not in (0, 1):
        raise ValueError("neither true nor false")
    wanted = (
        bool | int
        if isinstance(kind, Boolean)
        else (
            float | int if isinstance(kind, Float) else int if isinstance(kind, Integer) else str | datetime
        )
    )
    if not isinstance(text, wanted):
        raise ValueError("of another type")
    return bool(text) if isinstance(kind, Boolean) else text
