"""Which members of a kind of resource a list can be narrowed and sorted by: those that are plain columns."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from enum import Enum
from functools import lru_cache
from typing import Any, get_args, get_type_hints

from sqlalchemy import JSON, BigInteger, LargeBinary, Text
from sqlalchemy.sql.elements import KeyedColumnElement

from ground.records.kind import Kind


@lru_cache(maxsize=64)
def sortable(kind: Kind[Any]) -> Mapping[str, KeyedColumnElement[Any]]:
    """Return the columns by which a list can be sorted, by the name of the member."""
    members = {field.name for field in dataclasses.fields(kind.value)} - kind.computed.keys()
    return {
        column.key: column
        for column in kind.row.__table__.c
        if column.key in members - {"mission_id"} and not isinstance(column.type, (JSON, Text, LargeBinary))
    }


@lru_cache(maxsize=64)
def narrowing(kind: Kind[Any]) -> Mapping[str, type]:
    """Return the members by whose value a list can be narrowed, each with its type: texts, counts, flags.

    Numbers with a fraction and times are left out: nobody asks for exactly one of those. A mission is named
    by the path.
    """
    hints = get_type_hints(kind.value)
    found: dict[str, type] = {}
    for name in sortable(kind):
        options = [part for part in (*get_args(hints[name]), hints[name]) if isinstance(part, type)]
        form = next((part for part in options if issubclass(part, (Enum, str, bool, int))), None)
        if form is not None and name not in {"id", "mission_id", "revision"}:
            found[name] = form
    return found


def largest(column: KeyedColumnElement[Any]) -> int:
    """Return the largest number that a column of whole numbers holds (what JSON holds, for large ones)."""
    return 2**53 if isinstance(column.type, BigInteger) else 2**31 - 1
