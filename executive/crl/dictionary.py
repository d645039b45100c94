"""Types of the command and telemetry dictionaries; their content belongs to a rover."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum


class ValueType(StrEnum):
    NUMBER = "number"
    STRING = "string"
    BOOLEAN = "boolean"


@dataclass(frozen=True, slots=True)
class ValueSpec:
    """One named value: a parameter of an action, one of its results, or what a telemetry key holds.

    `minimum` and `maximum` are inclusive and in `unit`; `choices` lists the strings allowed, empty = any.
    """

    name: str
    type: ValueType
    unit: str = ""
    required: bool = False
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()
    doc: str = ""


@dataclass(frozen=True, slots=True)
class ActionSpec:
    """One action of the rover; `one_of` lists groups of parameters of which one whole group must be given."""

    name: str
    parameters: tuple[ValueSpec, ...] = ()
    results: tuple[ValueSpec, ...] = ()
    one_of: tuple[tuple[str, ...], ...] = ()
    doc: str = ""


@dataclass(frozen=True, slots=True)
class CommandDictionary:
    name: str
    version: str
    actions: dict[str, ActionSpec] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TelemetryDictionary:
    """Keys by keyword without colon; `arguments[key]` says how many arguments a key takes."""

    name: str
    version: str
    keys: dict[str, ValueSpec] = field(default_factory=dict)
    arguments: dict[str, int] = field(default_factory=dict)
