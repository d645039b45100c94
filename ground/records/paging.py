"""Pages of a list, the order they are in, and the opaque cursor between them."""

from __future__ import annotations

import base64
import binascii
import json
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import ColumnElement, Select, and_, literal, or_
from sqlalchemy.sql.elements import KeyedColumnElement

from ground.errors import InvalidInputError
from ground.gdr.base import Utc

Value = str | int | float | bool | datetime | None
"""What a column by which a list is sorted holds."""


@dataclass(frozen=True, slots=True)
class Page:
    """One page of a list; `next_cursor` is null on the last. `total` is counted where that was asked for."""

    items: list[Any]
    next_cursor: str | None
    total: int | None = None


@dataclass(frozen=True, slots=True)
class Order:
    """How a list is sorted: by a column and then by the ids, those without a value last."""

    name: str
    column: KeyedColumnElement[Any]
    id: KeyedColumnElement[Any]
    descending: bool = False

    @property
    def plain(self) -> bool:
        """Return whether it is the order in which resources were made, which ids alone keep."""
        return self.column is self.id

    def put(self, query: Select[Any]) -> Select[Any]:
        """Return a query with its rows in this order."""
        if self.plain:
            return query.order_by(self.id.desc() if self.descending else self.id)
        by = self.column.desc() if self.descending else self.column
        return query.order_by(self.column.is_(None), by, self.id)

    def behind(self, cursor: str) -> ColumnElement[bool]:
        """Return the condition for what comes behind a row.

        Raises
        ------
        InvalidInputError
            If the cursor was made for another order, or not here.
        """
        name, value, last = _decoded(cursor)
        if name != self._told:
            raise InvalidInputError(
                f"the cursor is of a list sorted by {name or 'id'}, not by {self._told or 'id'}",
                pointer="cursor",
            )
        if self.plain:
            behind: ColumnElement[bool] = self.id < last if self.descending else self.id > last
            return behind
        if value is None:
            return and_(self.column.is_(None), self.id > last)
        held = literal(_held(self.column, value), self.column.type)
        further = self.column < held if self.descending else self.column > held
        return or_(further, and_(self.column == held, self.id > last), self.column.is_(None))

    def cursor(self, row: Any) -> str:
        """Return the opaque cursor that goes on behind a row."""
        value = None if self.plain else getattr(row, self.column.key)
        value = value.isoformat() if isinstance(value, datetime) else getattr(value, "value", value)
        text = json.dumps([self._told, value, row.id], ensure_ascii=False, separators=(",", ":"))
        return base64.urlsafe_b64encode(text.encode()).decode().rstrip("=")

    @property
    def _told(self) -> str:
        if self.plain and not self.descending:
            return ""
        return f"-{self.name}" if self.descending else self.name


def _strange() -> InvalidInputError:
    return InvalidInputError("the cursor was not made here", pointer="cursor")


def _decoded(cursor: str) -> tuple[str, str | int | float | bool | None, str]:
    """Return the order, the value and the id in a cursor."""
    try:
        text = base64.urlsafe_b64decode(cursor.encode("ascii") + b"=" * (-len(cursor) % 4)).decode()
        found = json.loads(text)
    except (binascii.Error, ValueError, RecursionError) as err:
        raise _strange() from err
    if not isinstance(found, list) or len(found) != 3:
        raise _strange()
    name, value, last = found
    if not isinstance(name, str) or not isinstance(last, str) or isinstance(value, (list, dict)):
        raise _strange()
    if not last or not all(c.isascii() and (c.isalnum() or c in "-_") for c in last):
        raise _strange()
    return name, value, last


def _held(column: ColumnElement[Any], value: str | float | bool) -> Value:
    """Return a value of a cursor as its column holds it."""
    try:
        if isinstance(column.type, Utc):
            return datetime.fromisoformat(str(value)).astimezone(UTC)
        wanted = column.type.python_type
        if wanted is float and type(value) in {int, float}:
            return float(value)
        if type(value) is wanted and not (wanted is int and abs(int(value)) >= 2**63):
            str(value).encode()
            if "\x00" not in str(value):
                return value
    except (ValueError, OverflowError) as err:
        raise _strange() from err
    raise _strange()
