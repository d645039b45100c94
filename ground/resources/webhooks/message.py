"""What is sent of an event: its number, its kind and where to read more; never what it holds."""

from __future__ import annotations

from datetime import UTC

import orjson

from ground.gdr.history import EventRow

PREFIX = "/api/v1"


def message_id(webhook_id: str, event: int) -> str:
    """Return the id of a message: the same each time that an event is sent."""
    return f"{webhook_id}-{event}"


def type_of(event: EventRow) -> str:
    """Return what happened as one word, such as `target.create`."""
    return f"{event.kind}.{event.action}"


def body_of(event: EventRow, url: str) -> bytes:
    """Return the body: `type`, `timestamp` and `data`, as Standard Webhooks recommends."""
    told = {
        "type": type_of(event),
        "timestamp": event.at_utc.astimezone(UTC).isoformat(timespec="microseconds"),
        "data": {
            "mission_id": event.chain_id,
            "event": event.seq,
            "kind": event.kind,
            "action": event.action,
            "id": event.subject_id,
            "url": url,
        },
    }
    return orjson.dumps(told)
