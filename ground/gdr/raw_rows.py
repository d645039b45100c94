"""Rows as the driver gives and takes them, for acts on so many that decoding what stays would be the cost.

JSON stays the text that the database holds; it is read for the seal alone, and not written again.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import suppress
from datetime import datetime
from functools import partial
from hashlib import sha256
from itertools import repeat
from operator import itemgetter
from types import NoneType
from typing import Any, NamedTuple

import orjson
from sqlalchemy import JSON, Boolean, Connection, Dialect, Table

from ground.errors import DamagedDataError
from ground.gdr.base import Utc
from ground.gdr.seals import content_digest, plain_of, sealed_columns

RawRow = Sequence[Any]
"""Values in the order of the table's columns."""

Read = Callable[[Any], Any]


class RawRows:
    """How rows of a table go from a connection and into one; `place` is where a column stands in a row.

    Columns that are left `unread` are null in what is read.
    """

    def __init__(self, table: Table, dialect: Dialect, unread: Collection[str] = ()) -> None:
        self.table, self._dialect = table, dialect
        self.place = {column.name: index for index, column in enumerate(table.columns)}
        quoted = dialect.identifier_preparer
        mark = "?" if dialect.paramstyle == "qmark" else "%s"
        named = [quoted.format_column(column) for column in table.columns]
        # SQLite keeps an array or object as its text; a number or PostgreSQL's JSON is turned into it.
        as_text = {list, dict} if dialect.name == "sqlite" else set()
        asked = [
            "NULL"
            if column.name in unread
            else f"CAST({name} AS TEXT)"
            if isinstance(column.type, JSON) and column.type.python_type not in as_text
            else name
            for name, column in zip(named, table.columns, strict=True)
        ]
        name = quoted.format_table(table)
        self._select = f"SELECT {', '.join(asked)} FROM {name} WHERE mission_id = {mark}"
        self._insert = f"INSERT INTO {name} ({', '.join(named)}) VALUES ({', '.join([mark] * len(named))})"
        self._sealed = [
            _sealed(table, name, self.place[name], usual, dialect)
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
        return sorted(rows, key=itemgetter(self.place["id"]))

    def write(self, connection: Connection, rows: list[tuple[Any, ...]]) -> None:
        """Insert rows."""
        connection.exec_driver_sql(self._insert, rows)

    def digests(self, columns: Sequence[Sequence[Any]]) -> list[str]:
        """Return the digest of each row as `row_digest` has it, of rows given by their columns.

        The text that a digest is of is written a column at a time, and once where all rows hold the same.

        Raises
        ------
        DamagedDataError
            If one holds what the column's type does not.
        """
        count = len(columns[0])
        try:
            pieces = _joined(piece for s in self._sealed for piece in self._pieces(s, columns[s.place]))
        except TypeError:  # half of a surrogate pair, say
            names = [s.name for s in self._sealed]
            read = ([_unusual(s, value) for value in self._read(s, columns[s.place])] for s in self._sealed)
            named = (zip(names, row, strict=True) for row in zip(*read, strict=True))
            return [content_digest({name: v for name, v in row if v is not None}) for row in named]
        rows = zip(*(repeat(p, count) if isinstance(p, bytes) else p for p in pieces), strict=True)
        return [sha256(b"{%b}" % text[1:]).hexdigest() for text in map(b"".join, rows)]

    def _pieces(self, sealed: _Sealed, column: Sequence[Any]) -> list[bytes | list[bytes]]:
        """Return what a column adds to the JSON text of its rows: pieces of all rows, and such of each row.

        A value that is null or the usual one adds nothing.
        """
        head = b',"%b":' % sealed.name.encode()
        if column[0] == column[-1] and column.count(column[0]) == len(column):
            value = _unusual(sealed, self._read(sealed, column[:1])[0])
            return [] if value is None else [head + _text(value)]
        if sealed.kind is list and sealed.usual is None and (texts := _as_written(column)) is not None:
            return [head, texts]
        values = self._read(sealed, column)
        if None in values or sealed.usual in values:
            some = (_unusual(sealed, value) for value in values)
            return [[b"" if value is None else head + _text(value) for value in some]]
        if sealed.kind in {int, float, bool}:
            return [head, _text(values)[1:-1].split(b",")]
        if sealed.kind is str and b"\\" not in (whole := _text(values)):
            return [head + b'"', whole[2:-2].split(b'","'), b'"']
        return [head, [*map(_text, values)]]

    def _read(self, sealed: _Sealed, column: Sequence[Any]) -> list[Any]:
        """Return what a seal is taken of, of the values of a column."""
        values = [*column] if sealed.read is None else _all_read(column, sealed.read)
        if not {*map(type, values)} <= {sealed.kind, NoneType}:
            for held, value in zip(column, values, strict=True):
                if value is not None and type(value) is not sealed.kind:
                    where = f"the table {self.table.name} holds in {sealed.name}"
                    raise DamagedDataError(f"{where} {str(held)[:80]!r}")
        if sealed.kind is float:  # SQLite keeps no -0.0
            return [value if value is None else value + 0.0 for value in values]
        return values


class _Sealed(NamedTuple):
    """A column that seals cover."""

    name: str
    place: int
    usual: object
    read: Read | None
    """Makes of a driver's value what a seal is taken of, if it is another."""
    kind: type
    """Of what a seal is taken of."""


def _sealed(table: Table, name: str, place: int, usual: object, dialect: Dialect) -> _Sealed:
    kind = table.columns[name].type
    if isinstance(kind, JSON):
        return _Sealed(name, place, usual, orjson.loads, kind.python_type)
    if not isinstance(kind, (Utc, Boolean)):
        return _Sealed(name, place, usual, None, kind.python_type)
    decode, plain = kind.dialect_impl(dialect).result_processor(dialect, None), plain_of(kind)
    assert plain is not None

    def read(value: Any) -> Any:
        return plain(value if decode is None else decode(value))

    return _Sealed(name, place, usual, read, bool if isinstance(kind, Boolean) else str)


_UNREADABLE = object()


def _all_read(column: Sequence[Any], read: Read) -> list[Any]:
    """Return what a reader makes of values; something of no type where it cannot."""
    if read is orjson.loads and None not in column:
        with suppress(ValueError, TypeError):
            values = [*map(read, column)]
            if None not in values:
                return values
    found: dict[Any, Any] = {None: None}
    for value in {*column} - {None}:
        try:
            made = read(value)
        except (ValueError, TypeError, AttributeError):
            made = None
        found[value] = _UNREADABLE if made is None else made
    return [found[value] for value in column]


def _unusual(sealed: _Sealed, value: Any) -> Any:
    return None if value == sealed.usual else value


def _as_written(column: Sequence[Any]) -> list[bytes] | None:
    """Return the texts of lists if they are as this program writes them; None if one is not.

    All are read and written as one list: two calls, where each of ten thousand would cost two.
    """
    if None in column or not all(text[:1] == "[" and text[-1:] == "]" for text in column):
        return None
    whole = b"[%b]" % ",".join(column).encode()
    try:
        values = orjson.loads(whole)
    except ValueError:
        return None
    if len(values) != len(column) or {*map(type, values)} != {list} or _text(values) != whole:
        return None
    return [text.encode() for text in column]


def _joined(pieces: Iterable[bytes | list[bytes]]) -> list[bytes | list[bytes]]:
    """Return pieces of which those of all rows that follow each other are one."""
    found: list[bytes | list[bytes]] = []
    for piece in pieces:
        if found and isinstance(piece, bytes) and isinstance(found[-1], bytes):
            found[-1] += piece
        else:
            found.append(piece)
    return found


_text = partial(orjson.dumps, option=orjson.OPT_SORT_KEYS)
