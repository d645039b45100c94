"""F Prime's dictionary JSON, as `fpp-to-dict` writes it, read as a `ForeignDictionary`.

The form is that of the FPP JSON Dictionary Specification 1.0 of nasa/fpp: `typeDefinitions`, `commands` and
`telemetryChannels`; constants, events, parameters, records and packets are not asked for.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from neighbours.flight.errors import ForeignDictionaryError
from neighbours.flight.foreign import (
    Argument,
    Channel,
    Choice,
    Flag,
    ForeignCommand,
    ForeignDictionary,
    ForeignType,
    Group,
    Number,
    Series,
    Text,
    Unsaid,
)

_DEEPEST = 20
"""Types within types that are followed; FPP's compiler refuses circles, a file made by hand may hold one."""

_SIDES = (
    ("low", "red"),
    ("low", "yellow"),
    ("low", "orange"),
    ("high", "orange"),
    ("high", "yellow"),
    ("high", "red"),
)


def read_fprime(path: Path) -> ForeignDictionary:
    """Return the dictionary in a file of F Prime.

    Raises
    ------
    ForeignDictionaryError
        If the file cannot be read, or parts of it contradict each other: every one is named with its value.
    """
    try:
        document = json.loads(path.read_bytes())
    except OSError as err:
        raise ForeignDictionaryError(str(path), (err.strerror or str(err),)) from err
    except (ValueError, RecursionError) as err:
        raise ForeignDictionaryError(str(path), (f"is not JSON: {err}",)) from err
    return _Reader(document, str(path)).dictionary()


class _Reader:
    """Reads one document and gathers what is wrong with it."""

    def __init__(self, document: Any, where: str) -> None:
        self.wrong: list[str] = []
        self.where = where
        self.document = document if isinstance(document, dict) else {}
        if not {"commands", "typeDefinitions"} <= set(self.document):
            raise ForeignDictionaryError(
                where,
                (
                    "is not a dictionary of F Prime: it must have the members "
                    '"commands" and "typeDefinitions"',
                ),
            )
        self.structs: dict[tuple[str, int], ForeignType] = {}
        self.types: dict[str, Mapping[str, Any]] = {}
        for item in self.items("typeDefinitions"):
            name = str(item.get("qualifiedName"))
            if name in self.types:
                self.wrong.append(f'type "{name}" is defined twice')
            self.types[name] = item

    def dictionary(self) -> ForeignDictionary:
        metadata = self.document.get("metadata")
        metadata = metadata if isinstance(metadata, dict) else {}
        for name, item in self.types.items():
            self.check_type(name, item)
        commands = tuple(self.command(item) for item in self.items("commands"))
        channels = tuple(self.channel(item) for item in self.items("telemetryChannels"))
        self.unique("command", [c.name for c in commands])
        self.unique("opcode", [f"{c.get('opcode')}" for c in self.items("commands")])
        self.unique("telemetry channel", [c.name for c in channels])
        if self.wrong:
            raise ForeignDictionaryError(self.where, tuple(dict.fromkeys(self.wrong)))
        version = metadata.get("projectVersion") or metadata.get("frameworkVersion") or "1"
        name = str(metadata.get("deploymentName") or Path(self.where).stem)
        return ForeignDictionary(name, str(version), "F Prime", commands, channels)

    def items(self, member: str) -> list[Mapping[str, Any]]:
        """Return the tables of a list; what is none is told."""
        found = self.document.get(member, [])
        if not isinstance(found, list):
            self.wrong.append(f"{member} must be a list, found {_shown(found)}")
            return []
        for index, item in enumerate(found):
            if not isinstance(item, dict):
                self.wrong.append(f"{member}[{index}] must be a table, found {_shown(item)}")
        return [item for item in found if isinstance(item, dict)]

    def unique(self, what: str, names: list[str]) -> None:
        self.wrong += [f'{what} "{name}" is given {n} times' for name, n in Counter(names).items() if n > 1]

    def check_type(self, name: str, item: Mapping[str, Any]) -> None:
        """Tell what is wrong with a definition by itself."""
        if item.get("kind") != "enum":
            return
        labels = _constants(item)
        if not labels:
            self.wrong.append(f'enum "{name}" has no constants')
        twice = [label for label, n in Counter(labels).items() if n > 1]
        self.wrong += [f'enum "{name}" has the constant "{label}" twice' for label in twice]
        default = item.get("default")
        if isinstance(default, str) and default.removeprefix(f"{name}.") not in labels:
            self.wrong.append(f'enum "{name}" has the default "{default}", none of {", ".join(labels)}')

    def command(self, item: Mapping[str, Any]) -> ForeignCommand:
        name = str(item.get("name"))
        arguments = []
        parameters = item.get("formalParams", [])
        for param in parameters if isinstance(parameters, list) else []:
            label = str(param.get("name")) if isinstance(param, dict) else _shown(param)
            kind = self.type_of(param.get("type") if isinstance(param, dict) else None, f"{name}.{label}")
            doc = str(param.get("annotation", "")) if isinstance(param, dict) else ""
            arguments.append(Argument(label, kind, doc))
        self.unique(f"argument of command {name}", [a.name for a in arguments])
        remarks = (
            (f"command kind {item['commandKind']}",) if item.get("commandKind") in ("set", "save") else ()
        )
        return ForeignCommand(name, tuple(arguments), str(item.get("annotation", "")), remarks)

    def channel(self, item: Mapping[str, Any]) -> Channel:
        name = str(item.get("name"))
        kind = self.type_of(item.get("type"), name)
        limits = item.get("limits")
        remarks: tuple[str, ...] = ()
        if isinstance(limits, dict):
            found = [
                (f"{side} {colour}", limits[side][colour])
                for side, colour in _SIDES
                if isinstance(limits.get(side), dict) and colour in limits[side]
            ]
            for (lower, low), (upper, high) in pairwise(found):
                if isinstance(low, int | float) and isinstance(high, int | float) and low > high:
                    self.wrong.append(
                        f'channel "{name}" has the limit {lower} {low}, above its limit {upper} {high}'
                    )
            remarks = ("limits of alarms",)
        return Channel(name, kind, str(item.get("annotation", "")), remarks)

    def type_of(self, found: Any, where: str, depth: int = 0) -> ForeignType:
        """Return a type by its descriptor; one that is wrong is told and stands for nothing."""
        table = found if isinstance(found, dict) else {}
        name, kind = str(table.get("name")), table.get("kind")
        if depth > _DEEPEST:
            self.wrong.append(f'{where}: type "{name}" lies more than {_DEEPEST} types deep')
            return Unsaid("a type within itself")
        if kind == "integer":
            return self.integer(table, where)
        if kind == "float":
            return Number()
        if kind == "bool":
            return Flag()
        if kind == "string":
            size = table.get("size")
            return Text(size if isinstance(size, int) else None)
        if kind == "qualifiedIdentifier" and name in self.types:
            return self.defined(name, self.types[name], where, depth + 1)
        if kind == "qualifiedIdentifier":
            self.wrong.append(f'{where} has the type "{name}", which is not defined')
        else:
            self.wrong.append(f"{where} has the type {_shown(found)}, which is not a type of F Prime")
        return Unsaid("no type")

    def integer(self, table: Mapping[str, Any], where: str) -> ForeignType:
        size, signed = table.get("size"), bool(table.get("signed"))
        if size not in (8, 16, 32, 64):
            self.wrong.append(f"{where} is a whole number of {_shown(size)} bits; there are 8, 16, 32, 64")
            return Unsaid("no whole number")
        if signed:
            return Number(-(2.0 ** (size - 1)), 2.0 ** (size - 1) - 1, whole=True)
        return Number(0.0, 2.0**size - 1, whole=True)

    def defined(self, name: str, item: Mapping[str, Any], where: str, depth: int) -> ForeignType:
        match item.get("kind"):
            case "enum":
                return Choice(tuple(_constants(item)))
            case "alias":
                return self.type_of(item.get("underlyingType"), where, depth)
            case "array":
                size = item.get("size")
                if not isinstance(size, int) or size < 1:
                    self.wrong.append(f'array "{name}" has the size {_shown(size)}; it must be at least 1')
                    return Unsaid("an array without size")
                return Series(self.type_of(item.get("elementType"), where, depth), size)
            case "struct":
                if (name, depth) not in self.structs:  # once at each depth: structs of structs would be many
                    self.structs[name, depth] = self.struct(name, item, where, depth)
                return self.structs[name, depth]
            case other:
                self.wrong.append(f'type "{name}" is of the kind {_shown(other)}, none of F Prime')
                return Unsaid("no type")

    def struct(self, name: str, item: Mapping[str, Any], where: str, depth: int) -> ForeignType:
        members = item.get("members")
        if not isinstance(members, dict) or not members:
            self.wrong.append(f'struct "{name}" has no members')
            return Unsaid("a struct without members")
        made: list[tuple[str, ForeignType]] = []
        ordered = sorted(members.items(), key=lambda entry: _index(entry[1]))
        for member, table in ordered:
            table = table if isinstance(table, dict) else {}
            kind = self.type_of(table.get("type"), f"{where}.{member}", depth)
            size = table.get("size")
            made.append((member, Series(kind, size) if isinstance(size, int) and size > 0 else kind))
        return Group(tuple(made))


def _constants(item: Mapping[str, Any]) -> list[str]:
    found = item.get("enumeratedConstants")
    return [str(c.get("name")) for c in found if isinstance(c, dict)] if isinstance(found, list) else []


def _index(table: Any) -> int:
    index = table.get("index") if isinstance(table, dict) else 0
    return index if isinstance(index, int) else 0


def _shown(value: object) -> str:
    text = json.dumps(value, default=str)
    return text if len(text) <= 60 else text[:57] + "..."
