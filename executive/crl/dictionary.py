"""Command and telemetry dictionaries: their types, and the reader of `dictionary/1` files (TOML or JSON).

The names, parameters and costs of actions are content, and belong to a rover.
The reader stands on the standard library alone, so that an executive on board reads the same file. `SCHEMA`
is both what is published and what the reader holds a file to.
"""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from executive.crl.errors import DictionaryError

FORMAT = "dictionary/1"


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
    """One action of a rover.

    Attributes
    ----------
    one_of
        Groups of parameters of which one whole group must be given.
    needs
        Parts of the rover that it occupies: mobility, mast, arm, cameras.
    activity
        Activity of the rover profile that gives its time and energy; empty for none.
    instrument
        Its parameter that names an instrument of the profile, which gives its time and energy; empty for
        none.
    duration
        Its parameter that gives its time where it is present; empty for none.
    """

    name: str
    parameters: tuple[ValueSpec, ...] = ()
    results: tuple[ValueSpec, ...] = ()
    one_of: tuple[tuple[str, ...], ...] = ()
    doc: str = ""
    needs: tuple[str, ...] = ()
    activity: str = ""
    instrument: str = ""
    duration: str = ""

    def parameter(self, name: str) -> ValueSpec | None:
        """Return the parameter of that name, None if there is none."""
        return next((p for p in self.parameters if p.name == name), None)


@dataclass(frozen=True, slots=True)
class CommandDictionary:
    name: str
    version: str
    actions: Mapping[str, ActionSpec] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TelemetryDictionary:
    """Keys by keyword without colon; `arguments[key]` says how many arguments a key takes."""

    name: str
    version: str
    keys: Mapping[str, ValueSpec] = field(default_factory=dict)
    arguments: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Dictionary:
    """What a rover can be told and what it tells (`dictionary/1`)."""

    commands: CommandDictionary
    telemetry: TelemetryDictionary
    doc: str = ""

    @property
    def name(self) -> str:
        """Return its name, which plans and packages are made for."""
        return self.commands.name

    @property
    def version(self) -> str:
        """Return its version."""
        return self.commands.version

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the content: comments and the order of a file do not change it."""
        text = json.dumps(dictionary_document(self), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()

    def __hash__(self) -> int:
        return hash(self.sha256)


_TEXT = {"type": "string"}
_NAME = {"type": "string", "minLength": 1}
_NAMES = {"type": "array", "items": _NAME}
_VALUE: dict[str, Any] = {
    "type": "object",
    "required": ["type"],
    "additionalProperties": False,
    "properties": {
        "type": {"enum": [kind.value for kind in ValueType]},
        "unit": _TEXT,
        "required": {"type": "boolean"},
        "minimum": {"type": "number"},
        "maximum": {"type": "number"},
        "choices": _NAMES,
        "doc": _TEXT,
    },
}
_KEY: dict[str, Any] = {
    **_VALUE,
    "properties": {
        **{name: rule for name, rule in _VALUE["properties"].items() if name != "required"},
        "arguments": {"type": "integer", "minimum": 0, "description": "how many arguments the key takes"},
    },
}
_ACTION: dict[str, Any] = {
    "type": "object",
    "additionalProperties": False,
    "properties": {
        "doc": _TEXT,
        "parameters": {"type": "object", "additionalProperties": _VALUE},
        "results": {"type": "object", "additionalProperties": _VALUE},
        "one_of": {
            "type": "array",
            "items": _NAMES,
            "description": "groups of parameters of which one whole group must be given",
        },
        "needs": {**_NAMES, "description": "parts of the rover that the action occupies"},
        "activity": {**_NAME, "description": "activity of the profile that gives time and energy"},
        "instrument": {
            **_NAME,
            "description": "parameter that names the instrument which gives time and energy",
        },
        "duration": {**_NAME, "description": "parameter that gives the time where it is present"},
    },
}
SCHEMA: Mapping[str, Any] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": "dictionary of a rover: its actions and telemetry keys",
    "type": "object",
    "required": ["format", "name", "version", "actions"],
    "additionalProperties": False,
    "properties": {
        "format": {"const": FORMAT},
        "name": _NAME,
        "version": _NAME,
        "doc": _TEXT,
        "actions": {"type": "object", "additionalProperties": _ACTION},
        "telemetry": {"type": "object", "additionalProperties": _KEY},
    },
}
"""JSON Schema of `dictionary/1`; `_hold` knows the words that stand in it."""


def load_dictionary(path: Path) -> Dictionary:
    """Return the dictionary in a file; one that ends in `.json` is JSON, any other TOML.

    Raises
    ------
    DictionaryError
        If it cannot be read, or a member is missing, unknown, of the wrong kind or contradicts another. The
        message names the file, the member, its value and what is allowed.
    """
    try:
        raw = path.read_bytes()
    except OSError as err:
        raise DictionaryError(f"dictionary {path}: {err.strerror or err}") from err
    return _parsed(raw, path)


@lru_cache(maxsize=32)
def _parsed(raw: bytes, path: Path) -> Dictionary:
    try:
        text = raw.decode("utf-8")
        document = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    except (ValueError, RecursionError) as err:
        kind = "JSON" if path.suffix == ".json" else "TOML"
        raise DictionaryError(f"dictionary {path}: is not {kind}: {err}") from err
    return read_dictionary(document, str(path))


def read_dictionary(document: object, where: str = "") -> Dictionary:
    """Return the dictionary in a document that was parsed already; raises as `load_dictionary` does."""
    start = f"dictionary {where}".rstrip()
    found = document.get("format") if isinstance(document, Mapping) else None
    if isinstance(found, str) and found != FORMAT:
        version = found.removeprefix("dictionary/")
        newer = version != found and version.isdecimal() and int(version) > 1
        raise DictionaryError(
            f'{start}: has the format "{found}"'
            + (f", newer than this program; it reads {FORMAT}" if newer else f'; it must be "{FORMAT}"')
        )
    try:
        _hold(SCHEMA, document, "")
        return _made(document)
    except _WrongError as err:
        raise DictionaryError(f"{start}: {err}") from None


def dictionary_document(dictionary: Dictionary) -> Mapping[str, object]:
    """Return a dictionary as the document that `read_dictionary` takes, members of default value left out."""
    telemetry = dictionary.telemetry
    return {
        "format": FORMAT,
        "name": dictionary.name,
        "version": dictionary.version,
        **({"doc": dictionary.doc} if dictionary.doc else {}),
        "actions": {action.name: _action_document(action) for action in dictionary.commands.actions.values()},
        "telemetry": {
            name: {
                **_value_document(spec),
                **({"arguments": telemetry.arguments[name]} if telemetry.arguments.get(name) else {}),
            }
            for name, spec in telemetry.keys.items()
        },
    }


def _action_document(action: ActionSpec) -> dict[str, Any]:
    plain = {
        "doc": action.doc,
        "parameters": {p.name: _value_document(p) for p in action.parameters},
        "results": {r.name: _value_document(r) for r in action.results},
        "one_of": [list(group) for group in action.one_of],
        "needs": list(action.needs),
        "activity": action.activity,
        "instrument": action.instrument,
        "duration": action.duration,
    }
    return {name: value for name, value in plain.items() if value}


def _value_document(spec: ValueSpec) -> dict[str, Any]:
    plain = {
        "type": spec.type.value,
        "unit": spec.unit or None,
        "required": spec.required or None,
        "minimum": spec.minimum,
        "maximum": spec.maximum,
        "choices": list(spec.choices) or None,
        "doc": spec.doc or None,
    }
    return {name: value for name, value in plain.items() if value is not None}


class _WrongError(Exception):
    """What is wrong with a document, with the way to the member."""


_KINDS: Mapping[str, tuple[tuple[type, ...], str]] = {
    "object": ((dict,), "a table"),
    "array": ((list,), "an array"),
    "string": ((str,), "a string"),
    "boolean": ((bool,), "true or false"),
    "number": ((int, float), "a number"),
    "integer": ((int,), "a whole number"),
}


def _hold(rule: Mapping[str, Any], value: Any, way: str) -> None:
    """Raise unless a value keeps to a rule of `SCHEMA`."""
    at = way or "it"
    if "const" in rule and value != rule["const"]:
        raise _WrongError(f"{at} is {_shown(value)}; it must be {_shown(rule['const'])}")
    if "enum" in rule and value not in rule["enum"]:
        raise _WrongError(f"{at} is {_shown(value)}; it must be one of {', '.join(rule['enum'])}")
    if "type" in rule:
        types, words = _KINDS[rule["type"]]
        if not isinstance(value, types) or (isinstance(value, bool) and bool not in types):
            raise _WrongError(f"{at} must be {words}, found {_shown(value)}")
    if isinstance(value, float) and not math.isfinite(value):
        raise _WrongError(f"{at} is {value}; it must be finite")
    if "minimum" in rule and value < rule["minimum"]:
        raise _WrongError(f"{at} is {_shown(value)}; it must be at least {rule['minimum']}")
    if "minLength" in rule and len(value) < rule["minLength"]:
        raise _WrongError(f"{at} is empty")
    if rule.get("type") == "array":
        for index, item in enumerate(value):
            _hold(rule["items"], item, f"{way}[{index}]")
    if rule.get("type") == "object":
        known, more = rule.get("properties", {}), rule["additionalProperties"]
        for name in rule.get("required", ()):
            if name not in value:
                raise _WrongError(f"{_below(way, name)} is missing")
        for name, item in value.items():
            if name not in known and more is False:
                raise _WrongError(f"{_below(way, name)} is not a known member; known are {', '.join(known)}")
            _hold(known.get(name, more), item, _below(way, name))


def _below(way: str, name: str) -> str:
    return f"{way}.{name}" if way else name


def _shown(value: object) -> str:
    text = json.dumps(value, default=str, ensure_ascii=False)
    return text if len(text) <= 60 else text[:57] + "..."


def _made(document: Any) -> Dictionary:
    name, version = document["name"], document["version"]
    actions = {n: _action(n, table) for n, table in document["actions"].items()}
    telemetry = document.get("telemetry", {})
    keys = {n: _value(n, table, f"telemetry.{n}") for n, table in telemetry.items()}
    arguments = {n: table.get("arguments", 0) for n, table in telemetry.items()}
    return Dictionary(
        CommandDictionary(name, version, actions),
        TelemetryDictionary(name, version, keys, arguments),
        document.get("doc", ""),
    )


def _action(name: str, table: Mapping[str, Any]) -> ActionSpec:
    way = f"actions.{name}"
    parameters = table.get("parameters", {})
    action = ActionSpec(
        name,
        parameters=tuple(_value(n, t, f"{way}.parameters.{n}") for n, t in parameters.items()),
        results=tuple(_value(n, t, f"{way}.results.{n}") for n, t in table.get("results", {}).items()),
        one_of=tuple(tuple(group) for group in table.get("one_of", ())),
        doc=table.get("doc", ""),
        needs=tuple(table.get("needs", ())),
        activity=table.get("activity", ""),
        instrument=table.get("instrument", ""),
        duration=table.get("duration", ""),
    )
    known = ", ".join(parameters) or "none"
    for index, group in enumerate(action.one_of):
        for wanted in group:
            if wanted not in parameters:
                raise _WrongError(
                    f'{way}.one_of[{index}] names the unknown parameter "{wanted}"; it has {known}'
                )
    for member, kind in (("instrument", ValueType.STRING), ("duration", ValueType.NUMBER)):
        wanted = getattr(action, member)
        if not wanted:
            continue
        spec = action.parameter(wanted)
        if spec is None:
            raise _WrongError(f'{way}.{member} names the unknown parameter "{wanted}"; it has {known}')
        if spec.type is not kind:
            raise _WrongError(f'{way}.{member} names "{wanted}", a {spec.type}; it must be a {kind}')
    return action


def _value(name: str, table: Mapping[str, Any], way: str) -> ValueSpec:
    kind = ValueType(table["type"])
    low, high = table.get("minimum"), table.get("maximum")
    for member in ("minimum", "maximum"):
        if member in table and kind is not ValueType.NUMBER:
            raise _WrongError(f"{way}.{member} is {_shown(table[member])}, but a {kind} has no {member}")
    if low is not None and high is not None and low > high:
        raise _WrongError(f"{way}.minimum is {low}; it must be at most its maximum {high}")
    if "choices" in table and kind is not ValueType.STRING:
        raise _WrongError(f"{way}.choices is {_shown(table['choices'])}, but a {kind} has no choices")
    return ValueSpec(
        name,
        kind,
        table.get("unit", ""),
        table.get("required", False),
        low,
        high,
        tuple(table.get("choices", ())),
        table.get("doc", ""),
    )
