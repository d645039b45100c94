"""A filter as a tree of values."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Literal, TypeAlias

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Form = Literal["text", "number", "flag", "time", "geometry"]
"""What a property or literal is."""


@dataclass(frozen=True, slots=True)
class Name:
    """A property by its name."""

    name: str


@dataclass(frozen=True, slots=True)
class Constant:
    """A text, number or flag."""

    value: str | float | bool


@dataclass(frozen=True, slots=True)
class Instant:
    """A moment in UTC; of a `day` only the date counts."""

    at: datetime
    day: bool = False


@dataclass(frozen=True, slots=True)
class Interval:
    """A time between two moments; None is open. An end of one may be a property."""

    start: Instant | Name | None
    end: Instant | Name | None


@dataclass(frozen=True, slots=True)
class Shape:
    """A geometry, x before y."""

    geometry: BaseGeometry


@dataclass(frozen=True, slots=True)
class Call:
    """An operation on its arguments; `name` is in lower case: `and`, `=`, `like`, `s_intersects` ..."""

    name: str
    arguments: tuple[Expression, ...]


Expression: TypeAlias = Name | Constant | Instant | Interval | Shape | Call
Scalar: TypeAlias = str | float | bool | datetime | None
"""What a property of a feature holds."""
