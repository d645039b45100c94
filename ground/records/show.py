"""Rows as the values that people and programs see."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar, cast

T = TypeVar("T")


@cache
def _members(value: Callable[..., Any]) -> tuple[str, ...]:
    return tuple(field.name for field in dataclasses.fields(cast("Any", value)))


def value_of(value: Callable[..., T], row: Any, /, **given: Any) -> T:
    """Return a value whose members are the row's columns of the same name, but for those given."""
    columns = {name: getattr(row, name) for name in _members(value) if name not in given}
    return value(**columns, **given)
