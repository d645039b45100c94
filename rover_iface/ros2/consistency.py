"""What a mapping must agree on with its dictionary."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from executive.crl.dictionary import ActionSpec, Dictionary, ValueSpec, ValueType
from rover_iface.errors import MappingError
from rover_iface.ros2.field_paths import AbsentError, steps_of
from rover_iface.ros2.mapping import ActionCall, Reading, Ros2Mapping, ServiceCall, Source, TimerCall
from rover_iface.ros2.readings import held_to
from rover_iface.ros2.units import factor

_NAME = re.compile(r"~?/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
_NODE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_TYPE = re.compile(r"[a-z][a-z0-9_]*/(msg|srv|action)/[A-Z][A-Za-z0-9]*")


def contradictions(mapping: Ros2Mapping, language: Dictionary) -> Iterator[str]:
    """Yield what is wrong, a sentence each; the names stand as they do in the file."""
    if not _NODE.fullmatch(mapping.name):
        yield f"name is {mapping.name!r}; a ROS node takes letters, digits and _, a letter first"
    for action, call in mapping.actions.items():
        way, spec = f"actions.{action}", language.commands.actions.get(action)
        if spec is None:
            known = ", ".join(language.commands.actions)
            yield f"{way}: the dictionary {language.name} has no such action; it has {known}"
        elif isinstance(call, TimerCall):
            yield from _parameter(spec, call.duration, ValueType.NUMBER, f"{way}.duration")
        else:
            yield from _names(call.name, call.type, call.via, way)
            if isinstance(call, ActionCall | ServiceCall):
                yield from _call(call, spec, language, way)
    for name, topic in mapping.telemetry.items():
        way = f"telemetry.{name}"
        yield from _names(topic.topic, topic.type, "topic", way)
        yield from _keys(topic.keys, language, way)
    if mapping.tf is not None:
        yield from _keys({key: Reading("pose", of) for key, of in mapping.tf.keys.items()}, language, "tf")
    for key, found in mapping.start.items():
        spec_of_key = key_spec(language, key)
        if spec_of_key is None:
            yield _unknown_key(language, key, "start")
            continue
        try:
            held_to(spec_of_key, found)
        except AbsentError as err:
            yield f"start.{key}: {err}"


def key_spec(language: Dictionary, key: str) -> ValueSpec | None:
    """Return what the dictionary says of a telemetry key with its arguments, None if it has none such."""
    name, *arguments = key.split(" ")
    if language.telemetry.arguments.get(name, 0) != len(arguments):
        return None
    spec = language.telemetry.keys.get(name)
    if spec is not None and "," in spec.unit:  # the arguments have a unit each: that of `pose`
        units = [part.strip() for part in spec.unit.split(",")]
        place = {"x": 0, "y": 1, "heading": 2}.get(arguments[0] if arguments else "", -1)
        unit = units[place] if 0 <= place < len(units) else ""
        return ValueSpec(key, spec.type, unit, False, spec.minimum, spec.maximum, spec.choices)
    return spec


def _unknown_key(language: Dictionary, key: str, way: str) -> str:
    known = ", ".join(language.telemetry.keys) or "none"
    return (
        f"{way}.{key}: the dictionary {language.name} has no such key with so many arguments; it has {known}"
    )


def _names(name: str, kind: str, via: str, way: str) -> Iterator[str]:
    if not _NAME.fullmatch(name):
        yield f"{way}: {name!r} is not a name of ROS"
    wanted = {"action": "action", "service": "srv"}.get(via, "msg")
    if not _TYPE.fullmatch(kind) or kind.split("/")[1] != wanted:
        yield f"{way}.type is {kind!r}; it must have the form package/{wanted}/Name"


def _call(call: ActionCall | ServiceCall, spec: ActionSpec, language: Dictionary, way: str) -> Iterator[str]:
    for path, source in call.fields.items():
        yield from _path(path, f"{way}.fields")
        yield from _source(source, spec, f"{way}.fields.{path}")
    results = {result.name: result for result in spec.results}
    for name, reading in call.results.items():
        if name not in results:
            known = ", ".join(results) or "none"
            yield f"{way}.results.{name}: the action has no such result; it has {known}"
            continue
        yield from _reading(reading, results[name], f"{way}.results.{name}")
    for told in filter(None, (call.success, call.reason)):
        yield from _path(told, way)
    if isinstance(call, ActionCall):
        yield from _keys(call.feedback, language, f"{way}.feedback")


def _source(source: Source, spec: ActionSpec, way: str) -> Iterator[str]:
    if source.parameter is not None:
        yield from _parameter(spec, source.parameter, None, way)
        known = spec.parameter(source.parameter)
        if known is not None:
            yield from _units(known.unit, source.unit, way)
    if source.pose is not None:
        for name in (source.pose.x, source.pose.y, source.pose.heading):
            yield from _parameter(spec, name, ValueType.NUMBER, way) if name is not None else ()
    if source.route is not None:
        yield from _parameter(spec, source.route, ValueType.STRING, way)


def _parameter(spec: ActionSpec, name: str, kind: ValueType | None, way: str) -> Iterator[str]:
    known = spec.parameter(name)
    if known is None:
        names = ", ".join(p.name for p in spec.parameters) or "none"
        yield f"{way}: the action {spec.name} has no parameter {name!r}; it has {names}"
    elif kind is not None and known.type is not kind:
        yield f"{way}: the parameter {name} is a {known.type}; a {kind} is needed"


def _keys(keys: Mapping[str, Reading], language: Dictionary, way: str) -> Iterator[str]:
    for key, reading in keys.items():
        spec = key_spec(language, key)
        if spec is None:
            yield _unknown_key(language, key, way)
        else:
            yield from _reading(reading, spec, f"{way}.{key}")


def _reading(reading: Reading, spec: ValueSpec, way: str) -> Iterator[str]:
    yield from _path(reading.field, way)
    yield from _units(reading.unit, spec.unit, way)
    if reading.of is not None and spec.type is not ValueType.NUMBER:
        yield f"{way}: {reading.of} of a pose is a number, the dictionary wants a {spec.type}"
    for word in reading.words.values():
        try:
            held_to(spec, word)
        except AbsentError as err:
            yield f"{way}.words: {err}"


def _path(path: str, way: str) -> Iterator[str]:
    try:
        steps_of(path)
    except MappingError as err:
        yield f"{way}: {err}"


def _units(one: str, other: str, way: str) -> Iterator[str]:
    try:
        factor(one, other)
    except MappingError as err:
        yield f"{way}: {err}"
