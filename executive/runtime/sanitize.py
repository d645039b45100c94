"""What a rover reports, before it reaches the engine: garbage is taken out and noted."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from executive.engine.instance import Note
from executive.ports import Acknowledgement, CommandId, Event, Operator, Product, Result, Update, Value


def sanitized(events: Sequence[Event], t_ms: int) -> tuple[list[Event], list[Note]]:
    """Return the events that make sense, and notes on what does not.

    A value that is not a finite number, string or truth value is left out; a result whose `success` is
    not a truth value counts as a failure; anything that is not an event at all is dropped.
    """
    notes: list[Note] = []
    clean: list[Event] = []
    for event in events:
        kept = event if _is_plain(event) else _event(event, t_ms, notes)
        if kept is not None:
            clean.append(kept)
    return clean, notes


def _is_plain(event: Any) -> bool:
    """Tell whether an event is what most commands come to: success, and nothing else to be looked at."""
    return (
        type(event) is Result
        and event.success is True
        and event.values == {}
        and event.updates == {}
        and type(event.command) is CommandId
    )


def _event(event: Any, t_ms: int, notes: list[Note]) -> Event | None:
    if isinstance(event, (Operator, Product)):
        return event
    if not isinstance(event, (Update, Result, Acknowledgement)):
        notes.append(Note(t_ms, "garbage", f"{event!r} is not an event"))
        return None
    if isinstance(event, Update):
        values = _values(event.values, t_ms, notes)
        return event if values is event.values else event._replace(values=values)
    command: object = event.command
    if not isinstance(command, CommandId):
        notes.append(Note(t_ms, "garbage", f"{type(event).__name__} without a command: {command!r}"))
        return Update(event.t_ms, _values(event.updates, t_ms, notes), event.number)
    updates = _values(event.updates, t_ms, notes)
    if isinstance(event, Acknowledgement):
        return event if updates is event.updates else event._replace(updates=updates)
    values = _values(event.values, t_ms, notes)
    success: object = event.success
    if not isinstance(success, bool):
        notes.append(
            Note(
                t_ms,
                "garbage",
                f"{event.command}: success is {success!r}, taken as failure",
                event.command.task,
            )
        )
        success = False
    if updates is event.updates and values is event.values and success is event.success:
        return event
    return event._replace(success=success, reason=str(event.reason), values=values, updates=updates)


def _values(values: Any, t_ms: int, notes: list[Note]) -> Mapping[str, Value]:
    if isinstance(values, (dict, Mapping)):
        if not values or all(_is_value(v) and isinstance(k, str) for k, v in values.items()):
            return values
        for key, value in values.items():
            if not isinstance(key, str) or not _is_value(value):
                notes.append(Note(t_ms, "garbage", f"state key {key!r}: {value!r} is not a value"))
        return {k: v for k, v in values.items() if isinstance(k, str) and _is_value(v)}
    notes.append(Note(t_ms, "garbage", f"state values are {values!r}"))
    return {}


def _is_value(value: object) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    return isinstance(value, (str, bool, int))
