"""A dictionary of another program as frozen values, whatever file it came from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias


@dataclass(frozen=True, slots=True)
class Number:
    """A number between two limits, both inclusive and in `unit`; None is not a limit."""

    minimum: float | None = None
    maximum: float | None = None
    unit: str = ""
    whole: bool = False


@dataclass(frozen=True, slots=True)
class Text:
    """A string of at most `longest` bytes; None: no limit was told."""

    longest: int | None = None


@dataclass(frozen=True, slots=True)
class Choice:
    """One of a few words."""

    labels: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Flag:
    """True or false."""


@dataclass(frozen=True, slots=True)
class Series:
    """So many values of one type."""

    item: ForeignType
    length: int


@dataclass(frozen=True, slots=True)
class Group:
    """Values of several types, each with its name."""

    members: tuple[tuple[str, ForeignType], ...]


@dataclass(frozen=True, slots=True)
class Unsaid:
    """A type that `dictionary/1` has no form for: `reason` says what it is."""

    reason: str


Leaf: TypeAlias = Number | Text | Choice | Flag | Unsaid
ForeignType: TypeAlias = Leaf | Series | Group


@dataclass(frozen=True, slots=True)
class Argument:
    """An argument of a command; `remarks` are what the file says of it and `dictionary/1` cannot."""

    name: str
    type: ForeignType
    doc: str = ""
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ForeignCommand:
    """A command, its arguments in the order in which they are sent."""

    name: str
    arguments: tuple[Argument, ...] = ()
    doc: str = ""
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Channel:
    """A value that the rover tells."""

    name: str
    type: ForeignType
    doc: str = ""
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ForeignDictionary:
    """What a file says that a rover can be told and tells; names are unique in each."""

    name: str
    version: str
    source: str
    commands: tuple[ForeignCommand, ...]
    channels: tuple[Channel, ...]


LONGEST_SERIES = 64
"""Longest array that becomes parameters one by one: a form with more is none that a person fills in."""


MOST_LEAVES = 1000
"""Plain values of one argument in all; the largest structs of flight dictionaries have some dozens."""


def _size(kind: ForeignType) -> int:
    """Return the number of plain values of a type, one more than the limit where there are more."""
    match kind:
        case Series(item, length):
            return min(length * _size(item), MOST_LEAVES + 1)
        case Group(members):
            total = 0
            for _, inner in members:
                total += _size(inner)
                if total > MOST_LEAVES:
                    return MOST_LEAVES + 1
            return total
        case _:
            return 1


def leaves(name: str, kind: ForeignType) -> list[tuple[str, Leaf]]:
    """Return the plain values of a type with their names: `v.0`, `v.1` of an array, `p.x` of a struct."""
    too_long = isinstance(kind, Series) and kind.length > LONGEST_SERIES  # has a reason of its own
    if not too_long and _size(kind) > MOST_LEAVES:
        return [(name, Unsaid(f"type of more than {MOST_LEAVES} values"))]
    match kind:
        case Series(item, length):
            if length > LONGEST_SERIES:
                return [(name, Unsaid(f"array of {length} values; at most {LONGEST_SERIES} become values"))]
            return [leaf for k in range(length) for leaf in leaves(f"{name}.{k}", item)]
        case Group(members):
            return [leaf for member, inner in members for leaf in leaves(f"{name}.{member}", inner)]
        case _:
            return [(name, kind)]
