"""What a rover says, made fit for a frame: JSON has no NaN, and a frame has an end."""

from __future__ import annotations

from collections.abc import Mapping

from executive.ports import Acknowledgement, Event, Product, Result, Update, Value
from executive.runtime.sanitize import sanitized
from executive.runtime.wire.frames import LIMIT

ROOM = LIMIT // 4
"""Bytes for the values of an event: it has two sets of them, and more members."""
NUMBER = 32
"""Bytes of the longest number in JSON, its separators with it: 17 digits, sign, point and exponent."""
LETTER = 6
"""Bytes of the longest letter in JSON, a control character as an escape."""


def speakable(event: Event) -> tuple[Event | None, list[str]]:
    """Return an event as a frame can hold it, and what was left out; None if nothing of it can be said."""
    clean, notes = sanitized([event], event.t_ms if isinstance(event, Update) else 0)
    left_out = [note.text[:200] for note in notes]
    if not clean:
        return None, left_out
    match clean[0]:
        case Update() as one:
            return one._replace(values=fitting(one.values, left_out)), left_out
        case Result() as one:
            values, updates = fitting(one.values, left_out), fitting(one.updates, left_out)
            return one._replace(reason=_plain(one.reason)[:1000], values=values, updates=updates), left_out
        case Acknowledgement() as one:
            return one._replace(updates=fitting(one.updates, left_out)), left_out
        case Product() as one:
            return one._replace(label=fitting(one.label, left_out)), left_out
        case other:
            return other, left_out


def fitting(values: Mapping[str, Value], left_out: list[str], room: int = ROOM) -> Mapping[str, Value]:
    """Return the values that have room in a frame; the keys of the others are added to `left_out`."""
    kept: dict[str, Value] = {}
    for key, value in values.items():
        size = _size(key) + _size(value)
        if size <= room:
            room -= size
            kept[key] = value
        else:
            left_out.append(f"state key {_plain(key)[:100]!a} has no room in a frame")
    return values if len(kept) == len(values) else kept


def _size(value: Value) -> int:
    """Return an upper bound of the bytes of a value in JSON, those of a frame if it has no form there."""
    if isinstance(value, str):
        return LETTER * len(value) if value.isascii() or _plain(value) == value else LIMIT
    return NUMBER if isinstance(value, float) or value.bit_length() <= 64 else LIMIT


def _plain(text: str) -> str:
    """Return a text without what UTF-8 cannot hold."""
    return text.encode("utf-8", "replace").decode()
