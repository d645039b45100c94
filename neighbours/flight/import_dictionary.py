"""A `ForeignDictionary` as `dictionary/1`, with what that form cannot say told by name.

Each argument becomes one parameter; of arrays and structs each value does (`v.0`, `p.x`). The actions and
telemetry keys of the base profile's dictionary stay: Outcrop plans with them. Commands of instruments get the
parameters `target` and `instrument` where they lack them: those are the ground's and are not sent.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import assert_never

from executive.crl.dictionary import (
    ActionSpec,
    CommandDictionary,
    Dictionary,
    TelemetryDictionary,
    ValueSpec,
    ValueType,
)
from neighbours.flight.errors import ForeignDictionaryError
from neighbours.flight.flight_map import Constant, FlightMap, MappedCommand
from neighbours.flight.foreign import (
    Choice,
    Flag,
    ForeignCommand,
    ForeignDictionary,
    Leaf,
    Number,
    Text,
    Unsaid,
    leaves,
)

GROUND = "the ground's own, not sent: "
"""Begins the doc of a parameter that the command itself does not have."""

_NO_NAME = re.compile(r"[^A-Za-z0-9_.:*?+-]")


@dataclass(frozen=True, slots=True)
class Remark:
    """Something that `dictionary/1` does not say as the other file does, and where it stands."""

    text: str
    where: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ImportedDictionary:
    """A dictionary that was made of another program's, and what became of the parts.

    `without_cost` are the commands that have the map's default for lack of their own.
    """

    dictionary: Dictionary
    commands: tuple[str, ...]
    channels: tuple[str, ...]
    without_cost: tuple[str, ...]
    left_out: tuple[str, ...]
    remarks: tuple[Remark, ...]


def import_dictionary(
    foreign: ForeignDictionary, mapped: FlightMap, base: Dictionary, name: str
) -> ImportedDictionary:
    """Return another program's dictionary as Outcrop's, named `name`.

    Raises
    ------
    ForeignDictionaryError
        If parts of it contradict each other, the map or the base: every one is named with its value.
    """
    return _Importer(foreign, mapped, base).imported(name)


def action_name(command: str) -> str:
    """Return the name of a command as a plan writes it: characters that CRL does not know become `_`."""
    return _NO_NAME.sub("_", command)


class _Importer:
    def __init__(self, foreign: ForeignDictionary, mapped: FlightMap, base: Dictionary) -> None:
        self.foreign, self.mapped, self.base = foreign, mapped, base
        self.wrong: list[str] = []
        self.remarks: dict[str, list[str]] = defaultdict(list)
        self.left_out: list[str] = []
        self.without_cost: list[str] = []
        self.users = {figures.used_by for figures in mapped.instruments.values()}

    def imported(self, name: str) -> ImportedDictionary:
        actions = dict(self.base.commands.actions)
        made: list[str] = []
        known = {c.name for c in self.foreign.commands}
        named = {f"commands.{n}": n for n in self.mapped.commands}
        named |= {f"sent.{n}.command": sent.command for n, sent in self.mapped.sent.items()}
        for where, wanted in named.items():
            if wanted not in known:
                self.wrong.append(
                    f'{where} of the map names the command "{wanted}", which the dictionary lacks'
                )
        for wanted in self.mapped.sent:
            if wanted not in actions:
                self.wrong.append(f'sent.{wanted} of the map is not an action of "{self.base.name}"')
        for command in self.foreign.commands:
            action = self.action(command)
            if action is None:
                continue
            if action.name in actions:
                whose = "another command" if action.name in made else f'an action of "{self.base.name}"'
                self.wrong.append(f'command "{command.name}" becomes "{action.name}", the name of {whose}')
            actions[action.name] = action
            made.append(action.name)
        keys, arguments = dict(self.base.telemetry.keys), dict(self.base.telemetry.arguments)
        channels = self.channels(keys, arguments)
        if self.wrong:
            raise ForeignDictionaryError(
                f"{self.foreign.source} dictionary {self.foreign.name}", tuple(dict.fromkeys(self.wrong))
            )
        version = self.foreign.version
        doc = f"Made of the {self.foreign.source} dictionary {self.foreign.name} {version}."
        return ImportedDictionary(
            Dictionary(
                CommandDictionary(name, version, actions),
                TelemetryDictionary(name, version, keys, arguments),
                doc,
            ),
            tuple(made),
            tuple(channels),
            tuple(self.without_cost),
            tuple(self.left_out),
            tuple(Remark(text, tuple(where)) for text, where in self.remarks.items()),
        )

    def action(self, command: ForeignCommand) -> ActionSpec | None:
        """Return a command as an action; None where an argument has no form and no constant."""
        name = action_name(command.name)
        mapped = self.mapped.commands.get(command.name, MappedCommand())
        given = dict(mapped.arguments)
        for remark in command.remarks:
            self.remarks[remark].append(command.name)
        parameters: list[ValueSpec] = []
        for argument in command.arguments:
            for remark in argument.remarks:
                self.remarks[remark].append(f"{command.name} {argument.name}")
            for label, leaf in leaves(argument.name, argument.type):
                where = f"{command.name} {label}"
                constant = given.pop(label, None)
                spec = self.parameter(label, leaf, argument.doc, constant, where)
                if isinstance(leaf, Unsaid):
                    self.left_out.append(f"command {command.name}: its argument {label} is a {leaf.reason}")
                    return None
                parameters.append(spec)
                if label != argument.name:
                    self.remarks["arrays and structs, whose values are parameters one by one"].append(where)
        for unknown in given:
            self.wrong.append(
                f'command "{command.name}" has no argument "{unknown}", to which the map gives a value'
            )
        instrument = command.name in self.users or name in self.users
        if not instrument and mapped.time_s is None:
            self.without_cost.append(name)
        if instrument:
            parameters = self.of_instrument(command.name, parameters)
        return ActionSpec(
            name,
            parameters=tuple(parameters),
            doc=command.doc,
            needs=mapped.needs,
            activity="" if instrument else name,
            instrument="instrument" if instrument else "",
        )

    def of_instrument(self, command: str, parameters: list[ValueSpec]) -> list[ValueSpec]:
        """Return the parameters of an instrument's command: a plan gives it target and instrument."""
        by_name = {p.name: p for p in parameters}
        for spec in parameters:
            if spec.required and spec.name not in ("target", "instrument"):
                self.wrong.append(
                    f'command "{command}" is an instrument\'s and has the argument "{spec.name}", for which '
                    f'a plan has no value: say one in commands."{command}".arguments of the map'
                )
        users = tuple(
            n for n, f in self.mapped.instruments.items() if f.used_by in (command, action_name(command))
        )
        extra = {
            "target": ValueSpec("target", ValueType.STRING, required=True, doc=f"{GROUND}id of the target"),
            "instrument": ValueSpec(
                "instrument", ValueType.STRING, choices=users, doc=f"{GROUND}name of the instrument"
            ),
        }
        for name in extra.keys() & by_name.keys():
            if by_name[name].type is not ValueType.STRING:
                self.wrong.append(
                    f'argument "{name}" of command "{command}" is a {by_name[name].type}, not a string'
                )
        return [*(spec for name, spec in extra.items() if name not in by_name), *parameters]

    def parameter(self, name: str, leaf: Leaf, doc: str, constant: Constant | None, where: str) -> ValueSpec:
        """Return a leaf as a parameter, one without a need to be given where the map has a constant."""
        plain = self.value(name, leaf, where)
        if constant is None:
            return replace(plain, doc=doc, required=True)
        self.check_constant(plain, constant, where)
        return replace(plain, doc=f"{doc} (sent as {constant} where a plan says nothing)".strip())

    def check_constant(self, spec: ValueSpec, constant: Constant, where: str) -> None:
        kinds: Mapping[ValueType, tuple[type, ...]] = {
            ValueType.NUMBER: (int, float),
            ValueType.STRING: (str,),
            ValueType.BOOLEAN: (bool,),
        }
        if not isinstance(constant, kinds[spec.type]) or (
            isinstance(constant, bool) and spec.type is not ValueType.BOOLEAN
        ):
            self.wrong.append(f"{where} is given {constant!r} by the map; it must be a {spec.type}")
        elif spec.choices and constant not in spec.choices:
            self.wrong.append(
                f"{where} is given {constant!r} by the map; it must be one of {', '.join(spec.choices)}"
            )
        elif isinstance(constant, int | float) and not isinstance(constant, bool):
            if spec.minimum is not None and constant < spec.minimum:
                self.wrong.append(
                    f"{where} is given {constant} by the map; it must be at least {spec.minimum:g}"
                )
            if spec.maximum is not None and constant > spec.maximum:
                self.wrong.append(
                    f"{where} is given {constant} by the map; it must be at most {spec.maximum:g}"
                )

    def value(self, name: str, leaf: Leaf, where: str) -> ValueSpec:
        match leaf:
            case Number(minimum, maximum, unit, whole):
                if whole:
                    self.remarks["whole numbers, which are numbers here"].append(where)
                return ValueSpec(name, ValueType.NUMBER, unit, minimum=minimum, maximum=maximum)
            case Text(longest):
                if longest is not None:
                    self.remarks["longest length of strings"].append(f"{where} ({longest})")
                return ValueSpec(name, ValueType.STRING)
            case Choice(labels):
                return ValueSpec(name, ValueType.STRING, choices=labels)
            case Flag():
                return ValueSpec(name, ValueType.BOOLEAN)
            case Unsaid():
                return ValueSpec(name, ValueType.STRING)
            case _:
                assert_never(leaf)

    def channels(self, keys: dict[str, ValueSpec], arguments: dict[str, int]) -> list[str]:
        """Put the channels among the telemetry keys; return their names."""
        made: list[str] = []
        for channel in self.foreign.channels:
            for remark in channel.remarks:
                self.remarks[remark].append(channel.name)
            for label, leaf in leaves(channel.name, channel.type):
                if isinstance(leaf, Unsaid):
                    self.left_out.append(f"channel {label}: it is a {leaf.reason}")
                    continue
                key = action_name(label)
                if key in keys:
                    self.wrong.append(
                        f'channel "{channel.name}" becomes the telemetry key "{key}", which there is already'
                    )
                keys[key] = replace(self.value(key, leaf, label), doc=channel.doc)
                arguments[key] = 0
                made.append(key)
        return made
