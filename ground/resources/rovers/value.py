"""What is told of a rover by name: its instruments, actions and telemetry keys, as its profile has them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from mission.instrument import Amount


@dataclass(frozen=True, slots=True)
class RoverSummary:
    """A rover that a mission may have. `problem` says why one cannot be used; the rest is empty then."""

    name: str
    version: str
    doc: str
    instruments: list[str]
    problem: str


@dataclass(frozen=True, slots=True)
class RoverInstrument:
    """An instrument: how it is used, and what one observation costs without the hotel load.

    `name` is what requests hold, `profile_name` what the profile, plans and products call it. `action` is
    the action of the dictionary that uses it. `tracked` is whether its target must be tracked.
    """

    name: str
    profile_name: str
    doc: str
    use: Literal["contact", "remote"]
    action: str
    tracked: bool
    time_s: Amount
    energy_j: Amount
    data_mbit: float
    p_success: float
    standoff_m: float
    field_of_view_rad: float
    camera: str


@dataclass(frozen=True, slots=True)
class RoverValue:
    """A parameter or result of an action, or what a telemetry key holds; `choices` empty = any string."""

    name: str
    type: Literal["number", "string", "boolean"]
    unit: str
    required: bool
    minimum: float | None
    maximum: float | None
    choices: list[str]
    doc: str


@dataclass(frozen=True, slots=True)
class RoverAction:
    """An action. Of the groups of `one_of` one whole group must be given.

    `activity` is the profile's that gives its time and energy, `instrument` the parameter that names the
    instrument which does, `duration` the parameter that gives its time; empty where there is none.
    """

    name: str
    doc: str
    parameters: list[RoverValue]
    results: list[RoverValue]
    one_of: list[list[str]]
    needs: list[str]
    activity: str
    instrument: str
    duration: str


@dataclass(frozen=True, slots=True)
class RoverTelemetry:
    """A telemetry key, and how many arguments it takes."""

    key: str
    arguments: int
    value: RoverValue


@dataclass(frozen=True, slots=True)
class ConstraintKind:
    """A kind of constraint that requests may carry, with the JSON Schema of its document."""

    kind: str
    doc: str
    form: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Rover:
    """A rover by its profile: what requests, plans and forms may name."""

    name: str
    version: str
    doc: str
    profile_sha256: str
    dictionary: str
    dictionary_version: str
    dictionary_sha256: str
    instruments: list[RoverInstrument]
    actions: list[RoverAction]
    telemetry: list[RoverTelemetry]
    constraints: list[ConstraintKind]
    trackers: list[str]
    handoffs: list[str]
