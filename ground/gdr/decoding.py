"""Values as the database gives them, held to the type of their column: what does not fit has a name.

Who owns the database can write anything into it. SQLite keeps any value in any column, and of a text that is
neither JSON nor a time a decoder says neither table nor column. Here both are said, once for all tables; a
value that fits costs one comparison, and what reads rows on purpose as they are stored is `gdr/as_stored.py`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from datetime import datetime
from typing import TYPE_CHECKING, Any

import orjson
from sqlalchemy import Engine, event

from ground.errors import DamagedDataError
from ground.gdr.base import Base

if TYPE_CHECKING:
    import psycopg
    from sqlalchemy.engine import ExceptionContext
    from sqlalchemy.types import TypeEngine

Decode = Callable[[Any], Any]
"""Takes what the driver gives."""

_NAMES: dict[type, str] = {
    int: "whole number",
    float: "number",
    str: "text",
    bool: "yes or no",
    bytes: "bytes",
    datetime: "time",
    dict: "JSON object",
    list: "JSON list",
}
_TRUTH = {None: None, 0: False, 1: True}
_UNREADABLE = object()
"""Stands for a JSON text or time that cannot be read, until its column is known."""


def loads(text: str | bytes) -> Any:
    """Return a JSON value; the quick reader refuses NaN and infinity, which older rows may hold.

    What is nothing is written as a null of SQL, so a null of JSON is none of ours.
    """
    try:
        found = orjson.loads(text)
    except orjson.JSONDecodeError:
        try:
            found = json.loads(text)
        except (ValueError, TypeError, RecursionError):
            return _UNREADABLE
    return _UNREADABLE if found is None else found


_OPTIONS = orjson.OPT_NON_STR_KEYS | orjson.OPT_PASSTHROUGH_DATETIME | orjson.OPT_PASSTHROUGH_DATACLASS


def dumps(value: Any) -> str:
    """Return the JSON text of a value, as short as it goes.

    The quick writer makes a null of NaN and refuses half of a surrogate pair and very large whole numbers: of
    what may hold one the library's own writer makes the text.
    """
    try:
        text = orjson.dumps(value, option=_OPTIONS)
    except TypeError:
        return json.dumps(value)
    return json.dumps(value) if b"null" in text else text.decode()


def name_damage(engine: Engine) -> None:
    """Let whatever is read through an engine and does not fit its column end with a `DamagedDataError`."""
    dialect = engine.dialect

    class Context(dialect.execution_ctx_cls):  # type: ignore[misc,name-defined] # the dialect's own
        def get_result_processor(self, type_: TypeEngine[Any], colname: str, coltype: Any) -> Decode | None:
            decode = super().get_result_processor(type_, colname, coltype)
            return _checked(type_, decode, _place(colname, self.unicode_statement or ""), dialect.name)

    dialect.execution_ctx_cls = Context
    event.listen(engine, "handle_error", _on_error)


def _checked(kind: TypeEngine[Any], decode: Decode | None, place: str, dialect: str) -> Decode | None:
    """Return what decodes a column and refuses what is of another type."""
    try:
        python = kind.python_type
    except NotImplementedError:  # of an expression
        return decode
    if python not in _NAMES or (dialect != "sqlite" and python not in {dict, list, datetime}):
        return decode  # PostgreSQL keeps these itself
    refusal = f"{place} a value of another kind than {_NAMES[python]}"
    if python is bool:

        def process(value: Any) -> Any:
            try:
                return _TRUTH[value]
            except (KeyError, TypeError):
                raise DamagedDataError(refusal) from None
    elif decode is None:

        def process(value: Any) -> Any:
            if value.__class__ is python or value is None or (python is float and value.__class__ is int):
                return value
            raise DamagedDataError(refusal)
    else:
        inner = decode

        def process(value: Any) -> Any:
            if value is None:
                return None
            try:
                found = inner(value)
            except (ValueError, TypeError, AttributeError, OverflowError) as err:
                raise DamagedDataError(refusal) from err
            if found.__class__ is not python:
                raise DamagedDataError(refusal)
            return found

    return process


def _place(label: str, statement: str) -> str:
    """Return table and column of a column of a result; its label begins with the table, or does not."""
    for name, table in Base.metadata.tables.items():
        if label.startswith(name + "_") and label[len(name) + 1 :] in table.c:
            return f"the table {name} holds in {label[len(name) + 1 :]}"
    found = re.search(r"\bFROM (\w+)", statement)
    return f"{f'the table {found[1]}' if found else 'a table'} holds in {label}"


_NO_TEXT = re.compile(r"Could not decode to UTF-8 column '(\w+)'")
"""What the driver of SQLite says of a text that it cannot give."""


def _on_error(context: ExceptionContext) -> None:
    found = _NO_TEXT.search(str(context.original_exception))
    if found:
        raise DamagedDataError(f"{_place(found[1], context.statement or '')} bytes that are not text")


def keep_odd_times(connection: psycopg.Connection[Any]) -> None:
    """Let a connection give a time outside the years 1 to 9999 as it came, until its column is known."""
    import psycopg
    from psycopg.adapt import Loader

    oid = psycopg.adapters.types["timestamptz"].oid
    usual: Any = psycopg.adapters.get_loader(oid, psycopg.pq.Format.TEXT)

    class Times(Loader):
        def __init__(self, oid: int, context: Any = None) -> None:
            super().__init__(oid, context)
            self._load = usual(oid, context).load

        def load(self, data: Any) -> object:
            try:
                return self._load(data)
            except psycopg.DataError:
                return _UNREADABLE

    connection.adapters.register_loader(oid, Times)
