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
    listed = ",".join(map(quoted, arguments))
    return f'{{"n":{number},"k":"trace","t":{t_ms},"e":{quoted(event)},"a":[{listed}]'


def _input(number: int, entry: Input) -> str:
    kind, t_ms, events = entry
    if kind != "step" or type(t_ms) is not int:
        return _slowly(number, entry)
    listed = _event(events[0]) if len(events) == 1 else ",".join(map(_event, events))
    return f'{{"n":{number},"k":"step","t":{t_ms},"events":[{listed}]'


def _send(number: int, command: Command) -> str:
    if type(command.issue) is not int:
        return _slowly(number, command)
    return (
        f'{{"n":{number},"k":"send","id":{_id(command.id)},"action":{quoted(command.action)},'
        f'"parameters":{_values(command.parameters)},"metadata":{_values(command.metadata)},'
        f'"issue":{command.issue}'
    )


_BODIES: dict[type, Callable[[int, Any], str]] = {TraceRecord: _trace, Command: _send, Input: _input}
"""What writes a record of a type, without its closing brace."""


def _event(event: Event) -> str:
    if type(event) is Result:
        return _result(event)
    return encode(event_to_json(event))


def _result(event: Result) -> str:
    if type(event.t_ms) is not int or type(event.number) is not int or type(event.reason) is not str:
        return encode(event_to_json(event))
    success = encode(event.success) if type(event.success) is not bool else SAID[event.success]
    number = f',"number":{event.number}' if event.number else ""
    return (
        f'{{"e":"result","t":{event.t_ms},"command":{_id(event.command)},"success":{success},'
        f'"reason":{quoted(event.reason)},"values":{_values(event.values)},'
        f'"updates":{_values(event.updates)}{number}}}'
    )


SAID = ("false", "true")


def _id(command: CommandId) -> str:
    run, task, attempt = command
    if type(run) is str and type(task) is str and type(attempt) is int:
        return f"[{quoted(run)},{quoted(task)},{attempt}]"
    return encode([run, task, attempt])


def _values(values: Mapping[str, Value]) -> str:
    return encode(dict(values)) if values else "{}"
