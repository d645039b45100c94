"""JSON forms of what a journal holds: events, commands and trace records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from executive.engine.instance import Abort, Effect, Note, UtilityUsed
from executive.ports import (
    Acknowledgement,
    Command,
    CommandId,
    Event,
    Operation,
    Operator,
    Product,
    Result,
    TraceRecord,
    Update,
)

Json = dict[str, Any]


def event_to_json(event: Event) -> Json:
    """Return an event as a JSON object; `event_from_json` returns it."""
    number = 0 if isinstance(event, Operator) else event.number
    return _members(event) | ({"number": number} if number else {})


def _members(event: Event) -> Json:
    match event:
        case Update():
            return {"e": "update", "t": event.t_ms, "values": dict(event.values)}
        case Result():
            return {
                "e": "result",
                "t": event.t_ms,
                "command": command_id_to_json(event.command),
                "success": event.success,
                "reason": event.reason,
                "values": dict(event.values),
                "updates": dict(event.updates),
            }
        case Acknowledgement():
            return {
                "e": "acknowledgement",
                "t": event.t_ms,
                "command": command_id_to_json(event.command),
                "updates": dict(event.updates),
            }
        case Product():
            return {
                "e": "product",
                "t": event.t_ms,
                "command": command_id_to_json(event.command),
                "kind": event.kind,
                "path": event.path,
                "sha256": event.sha256,
                "label": dict(event.label),
            }
        case Operator():
            return {
                "e": "operator",
                "t": event.t_ms,
                "operation": event.operation.value,
                "plan": event.plan_text,
            }


def event_from_json(document: Mapping[str, Any]) -> Event:
    """Return the event that `event_to_json` wrote."""
    t_ms = document["t"]
    number = document.get("number", 0)
    match document["e"]:
        case "update":
            return Update(t_ms, document["values"], number)
        case "result":
            return Result(
                t_ms,
                command_id_from_json(document["command"]),
                document["success"],
                document["reason"],
                document["values"],
                document["updates"],
                number,
            )
        case "acknowledgement":
            return Acknowledgement(
                t_ms, command_id_from_json(document["command"]), document["updates"], number
            )
        case "product":
            return Product(
                t_ms,
                command_id_from_json(document["command"]),
                document["kind"],
                document["path"],
                document["sha256"],
                document["label"],
                number,
            )
        case "operator":
            return Operator(t_ms, Operation(document["operation"]), document["plan"])
        case other:
            raise ValueError(f"unknown kind of event {other!r}")


def command_id_to_json(command: CommandId) -> list[Any]:
    return [command.run, command.task, command.attempt]


def command_id_from_json(document: list[Any]) -> CommandId:
    run, task, attempt = document
    return CommandId(run, task, attempt)


def command_to_json(command: Command) -> Json:
    return {
        "id": command_id_to_json(command.id),
        "action": command.action,
        "parameters": dict(command.parameters),
        "metadata": dict(command.metadata),
        "issue": command.issue,
    }


class Input(NamedTuple):
    """What determines all else in a journal: a macro step with its events, a deadline, a restart."""

    kind: str
    t_ms: int
    events: Sequence[Event] = ()


Entry = dict[str, object] | Input | Effect
"""What a journal is given; it is put into JSON where it is written or read, not on the way to the rover."""


def entry_to_json(entry: Entry) -> Json:
    """Return the members of a journal record, without its number."""
    if isinstance(entry, dict):
        return entry
    if not isinstance(entry, Input):
        return effect_to_json(entry)
    if entry.kind != "step":
        return {"k": entry.kind, "t": entry.t_ms}
    return {"k": "step", "t": entry.t_ms, "events": [event_to_json(event) for event in entry.events]}


def effect_to_json(effect: Effect) -> Json:
    """Return an effect of the engine as the member(s) of a journal record; `k` is its kind."""
    match effect:
        case TraceRecord():
            return {"k": "trace", "t": effect.t_ms, "e": effect.event, "a": list(effect.arguments)}
        case Command():
            return {"k": "send", **command_to_json(effect)}
        case Abort():
            return {"k": "abort", "id": command_id_to_json(effect.command)}
        case Note():
            return {
                "k": "note",
                "t": effect.t_ms,
                "kind": effect.kind,
                "text": effect.text,
                "node": effect.node,
            }
        case UtilityUsed():
            return {"k": "utility", "t": effect.t_ms, "option": effect.option, "value": effect.value}


def effect_from_json(record: Mapping[str, Any]) -> Effect | None:
    """Return the effect of a journal record, None for a record of another kind."""
    match record["k"]:
        case "trace":
            return TraceRecord(record["t"], record["e"], tuple(record["a"]))
        case "send":
            command = command_id_from_json(record["id"])
            return Command(
                command, record["action"], record["parameters"], record["metadata"], record["issue"]
            )
        case "abort":
            return Abort(command_id_from_json(record["id"]))
        case "note":
            return Note(record["t"], record["kind"], record["text"], record["node"])
        case "utility":
            return UtilityUsed(record["t"], record["option"], record["value"])
        case _:
            return None


def events_from_json(record: Mapping[str, Any]) -> list[Event]:
    """Return the events of a journal record; only a step has any."""
    return [event_from_json(event) for event in record["events"]] if record["k"] == "step" else []


def trace_line(record: TraceRecord) -> list[Any]:
    """Return a trace record as the specification writes it: time in seconds, event, arguments."""
    t_s = record.t_ms / 1000
    return [int(t_s) if t_s.is_integer() else t_s, record.event, *record.arguments]
