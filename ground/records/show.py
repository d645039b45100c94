"""Rows, and values of other rooms, as the values that people and programs see."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from enum import Enum
from functools import cache
from typing import Any, TypeVar, cast, get_args, get_origin, get_type_hints

from ground.errors import DamagedDataError

T = TypeVar("T")
Reader = Callable[[Any], Any]


@cache
def _members(value: Callable[..., Any]) -> Mapping[str, Reader | None]:
    hints = get_type_hints(value)
    return {field.name: _reader(hints[field.name]) for field in dataclasses.fields(cast("Any", value))}


def _reader(hint: Any) -> Reader | None:
    """Return what makes a member of what stands in a column; None where it is the same."""
    empty = get_origin(hint) is list
    if not _has_parts(hint):
        return (lambda found: [] if found is None else found) if empty else None
    from pydantic import TypeAdapter

    read = TypeAdapter(hint).validate_python
    return (lambda found: read(found or [])) if empty else read


def _has_parts(hint: Any) -> bool:
    """Return whether there is a value or an enumeration in a type."""
    if isinstance(hint, type) and (dataclasses.is_dataclass(hint) or issubclass(hint, Enum)):
        return True
    return any(_has_parts(part) for part in get_args(hint))


def value_of(value: Callable[..., T], row: Any, /, **given: Any) -> T:
    """Return a value whose members are the row's columns of the same name, but for those given.

    Documents become the values and enumerations that the member's type names; a list that is null is an empty
    one.

    Raises
    ------
    DamagedDataError
        If a column holds what the member's type does not name.
    """
    found = {}
    for name, read in _members(value).items():
        part = given[name] if name in given else getattr(row, name)
        try:
            found[name] = part if read is None else read(part)
        except ValueError as err:
            what = f"{getattr(value, '__name__', 'row')} {getattr(row, 'id', '')}".strip()
            raise DamagedDataError(
                f"the {what} holds in {name} {str(part)[:80]!r}, which is no such value"
            ) from err
    return value(**found)
