"""Rows as the driver gives and takes them, for acts on so many that decoding what stays would be the cost.

JSON stays the text that the database holds; it is read for the seal alone, and not written again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime
from functools import lru_cache
from typing import Any

import orjson
from sqlalchemy import JSON, Boolean, Connection, Dialect, Table

from ground.errors import DamagedDataError
from ground.gdr.base import Utc
from ground.gdr.decoding import loads
from ground.gdr.seals import content_digest, plain_of, sealed_columns

RawRow = Sequence[Any]
"""Values in the order of the table's columns."""

Read = Callable[[Any], Any]


class RawRows:
    """How rows of a table go from a connection and into one; `place` is where a column stands in a row."""

    def __init__(self, table: Table, dialect: Dialect) -> None:
        self.table, self._dialect = table, dialect
        self.place = {column.name: index for index, column in enumerate(table.columns)}
        quoted = dialect.identifier_preparer
        mark = "?" if dialect.paramstyle == "qmark" else "%s"
        named = [quoted.format_column(column) for column in table.columns]
        asked = [
            f"CAST({name} AS TEXT)" if isinstance(column.type, JSON) else name
            for name, column in zip(named, table.columns, strict=True)
        ]
        name = quoted.format_table(table)
        self._select = f"SELECT {', '.join(asked)} FROM {name} WHERE mission_id = {mark} ORDER BY id"
        self._insert = f"INSERT INTO {name} ({', '.join(named)}) VALUES ({', '.join([mark] * len(named))})"
        self._sealed = [
            (name, self.place[name], *_reader(table, name, dialect), usual)
            for name, usual in sorted((name, usual) for name, _plain, usual in sealed_columns(table))
        ]

    def time(self, value: datetime) -> Any:
        """Return a time as the driver takes it."""
        kind = self.table.columns["created_utc"].type.dialect_impl(self._dialect)
        bind = kind.bind_processor(self._dialect)
        return value if bind is None else bind(value)

    def read(self, connection: Connection, mission_id: str) -> list[RawRow]:
        """Return the rows of a mission by their ids."""
        with connection.exec_driver_sql(self._select, (mission_id,)) as found:
            rows: list[RawRow] = [] if found.cursor is None else list(found.cursor.fetchall())
            return rows

    def write(self, connection: Connection, rows: list[tuple[Any, ...]]) -> None:
        """Insert rows."""
        connection.exec_driver_sql(self._insert, rows)

    def digest(self, row: RawRow) -> str:
        """Return the digest of a row as `row_digest` has it.

        Raises
        ------
        DamagedDataError
            If it holds what the column's type does not.
        """
        content = {}
        for name, place, read, wanted, usual in self._sealed:
            value = row[place]
            if value is None:
                continue
            try:
                if read is not None:
                    value = read(value)
                elif wanted is float:
                    value += 0.0  # SQLite keeps no -0.0
            except (ValueError, TypeError, AttributeError):
                value = _UNREADABLE
            if wanted is not None and value.__class__ is not wanted:
                raise DamagedDataError(
                    f"the table {self.table.name} holds in {name} {str(row[place])[:80]!r}"
                )
            if value != usual:
                content[name] = value
        return content_digest(content)


_UNREADABLE = object()


def _reader(table: Table, name: str, dialect: Dialect) -> tuple[Read | None, type | None]:
    """Return what makes of a driver's value what a seal is taken of, if it is another, and its type."""
    kind = table.columns[name].type
    if isinstance(kind, JSON):
        return orjson.loads if kind.python_type in {dict, list} else loads, kind.python_type
    if not isinstance(kind, (Utc, Boolean)):
        return None, kind.python_type
    decode, plain = kind.dialect_impl(dialect).result_processor(dialect, None), plain_of(kind)
    assert plain is not None
    # Few values: the rows of one act have their times in common.
    return lru_cache(64)(lambda value: plain(value if decode is None else decode(value))), None
