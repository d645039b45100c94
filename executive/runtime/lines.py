"""The text of journal records. What nearly all records are is put together by hand: a tenth of the cost.

The text is what `json` makes of `entry_to_json`, byte for byte; whatever is not of the plainest form is left
to it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from json.encoder import encode_basestring as quoted
from typing import Any
from zlib import crc32

from executive.ports import Command, CommandId, Event, Result, TraceRecord, Value
from executive.runtime.codec import Entry, Input, entry_to_json, event_to_json

encode = json.JSONEncoder(separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode


def line_of(number: int, entry: Entry) -> str:
    """Return the line of a record, checksum included, without the line break."""
    return lines_of(number, [entry])[:-1].decode()


def lines_of(number: int, entries: Sequence[Entry]) -> bytes:
    """Return the lines of records that follow each other, each with its line break, in UTF-8."""
    lines = []
    for n, entry in enumerate(entries, number):
        body = _BODIES.get(type(entry), _slowly)(n, entry).encode()
        lines.append(b'%b,"crc":"%08x"}\n' % (body, crc32(body)))
    return b"".join(lines)


def documents_of(number: int, entries: Sequence[Entry]) -> list[str]:
    """Return the records as JSON objects, without checksums."""
    return [_BODIES.get(type(entry), _slowly)(n, entry) + "}" for n, entry in enumerate(entries, number)]


def _slowly(number: int, entry: Entry) -> str:
    return encode({"n": number, **entry_to_json(entry)})[:-1]


def _trace(number: int, record: TraceRecord) -> str:
    t_ms, event, arguments = record
    if type(t_ms) is not int:
        return _slowly(number, record)
    if len(arguments) == 1:
        listed = quoted(arguments[0])
    elif len(arguments) == 2:
        listed = f"{quoted(arguments[0])},{quoted(arguments[1])}"
    else:
        listed = ",".join(map(quoted, arguments))
    return f'{{"n":{number},"k":"trace","t":{t_ms},"e":{quoted(event)},"a":[{listed}]'


def _input(number: int, entry: Input) -> str:
    kind, t_ms, events = entry
    if kind != "step" or type(t_ms) is not int:
        return _slowly(number, entry)
    listed = _event(events[0]) if len(events) == 1 else ",".join(map(_event, events))
    return f'{{"n":{number},"k":"step","t":{t_ms},"events":[{listed}]'


def _send(number: int, command: Command) -> str:
    identity, action, parameters, metadata, issue = command
    if type(issue) is not int:
        return _slowly(number, command)
    return (
        f'{{"n":{number},"k":"send","id":{_id(identity)},"action":{quoted(action)},'
        f'"parameters":{_values(parameters) if parameters else "{}"},'
        f'"metadata":{_values(metadata) if metadata else "{}"},"issue":{issue}'
    )


_BODIES: dict[type, Callable[[int, Any], str]] = {TraceRecord: _trace, Command: _send, Input: _input}
"""What writes a record of a type, without its closing brace."""


def _event(event: Event) -> str:
    if type(event) is Result:
        return _result(event)
    return encode(event_to_json(event))


def _result(event: Result) -> str:
    t_ms, command, success, reason, values, updates, number = event
    if type(t_ms) is not int or type(number) is not int or type(reason) is not str:
        return encode(event_to_json(event))
    said = SAID[success] if type(success) is bool else encode(success)
    numbered = f',"number":{number}' if number else ""
    return (
        f'{{"e":"result","t":{t_ms},"command":{_id(command)},"success":{said},"reason":{quoted(reason)},'
        f'"values":{_values(values) if values else "{}"},'
        f'"updates":{_values(updates) if updates else "{}"}{numbered}}}'
    )


SAID = ("false", "true")


def _id(command: CommandId) -> str:
    run, task, attempt = command
    if type(run) is str and type(task) is str and type(attempt) is int:
        return f"[{quoted(run)},{quoted(task)},{attempt}]"
    return encode([run, task, attempt])


def _values(values: Mapping[str, Value]) -> str:
    return encode(dict(values))
