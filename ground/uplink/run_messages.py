"""The messages of a run, from its journal: pose, telemetry, plan, notes and pictures, each at its time.

`/pose`, `/trail`, `/log` and the pictures have the names and members of Foxglove's own schemas
(docs.foxglove.dev/docs/visualization/message-schemas), so its panels show them as they are.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from executive.ports import Command, Product, TraceRecord
from executive.runtime.codec import effect_from_json, events_from_json
from executive.runtime.journal import Record, plan_time, require
from executive.runtime.wire.downloads import safe_path
from ground.uplink.flight import Sample, SampleBook, product_line

JOURNAL = "journal.jsonl"
FORMATS = {".png": "png", ".jpg": "jpeg", ".jpeg": "jpeg", ".webp": "webp"}
"""Pictures that `foxglove.CompressedImage` may hold, by the suffix of their files."""
INFO, WARNING = 2, 3
"""Levels of `foxglove.Log`."""
WARNINGS = ("risk", "garbage", "safing", "port", "link", "clock", "product")
"""Kinds of notes that an operator should see."""
STATES = {
    "start": "EXECUTING",
    "retry": "EXECUTING",
    "resume": "EXECUTING",
    "suspend": "SUSPENDED",
    "end": "FINISHED",
}
"""State of a node after an event of the trace; at its end that is the outcome."""
TIME = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
_NUMBER = {"type": "number"}
_TEXT = {"type": "string"}
_LIST = {"type": "array", "items": {"type": "object"}}
_XYZ = {"type": "object", "properties": dict.fromkeys("xyz", _NUMBER)}
_POSE = {
    "type": "object",
    "properties": {
        "position": _XYZ,
        "orientation": {"type": "object", "properties": dict.fromkeys("xyzw", _NUMBER)},
    },
}
SCHEMAS: Mapping[str, Mapping[str, object]] = {
    "foxglove.PoseInFrame": {"timestamp": TIME, "frame_id": _TEXT, "pose": _POSE},
    "foxglove.Log": {"timestamp": TIME, "level": {"type": "integer"}, "message": _TEXT, "name": _TEXT},
    "foxglove.CompressedImage": {
        "timestamp": TIME,
        "frame_id": _TEXT,
        "data": {"type": "string", "contentEncoding": "base64"},
        "format": _TEXT,
    },
    "outcrop.Telemetry": {"t_s": _NUMBER, "battery_j": _NUMBER, "energy_used_j": _NUMBER, "task": _TEXT},
    "outcrop.PlanEvent": {"t_s": _NUMBER, "event": _TEXT, "node": _TEXT, "detail": {"type": "array"}},
    "foxglove.SceneUpdate": {"deletions": _LIST, "entities": _LIST},
    "outcrop.NodeState": {"t_s": _NUMBER, "node": _TEXT, "state": _TEXT},
    "outcrop.Command": {"t_s": _NUMBER, "task": _TEXT, "attempt": {"type": "integer"}, "action": _TEXT},
    "outcrop.Product": {"t_s": _NUMBER, "task": _TEXT, "kind": _TEXT, "path": _TEXT, "sha256": _TEXT},
}


@dataclass(frozen=True, slots=True)
class Message:
    """One message: topic, name of its schema, plan time in milliseconds, content."""

    topic: str
    schema: str
    t_ms: int
    content: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Encoded:
    """One message as it is written: topic, name of its schema, bytes."""

    topic: str
    schema: str
    data: bytes


def schema_text(name: str) -> bytes:
    """Return the JSON Schema of the messages of a name."""
    return json.dumps({"type": "object", "properties": SCHEMAS[name]}).encode()


def zero_of(header: Record) -> int:
    """Return plan time 0 in nanoseconds of UTC; 0 for a virtual clock, which has no instant."""
    instant = plan_time(header).instant
    return 0 if instant is None else round(datetime.fromisoformat(instant).timestamp() * 1000) * 1_000_000


def messages(run: Path, records: Iterable[Record], zero_ns: int) -> Iterator[Message]:
    """Yield the messages of a journal, in its order."""
    book, trail, t_ms = SampleBook(), Trail(zero_ns), 0
    for record in records:
        t_ms = max(t_ms, require({"t": t_ms, **record}, "t", int))
        match effect_from_json(record):
            case TraceRecord(_, what, arguments):
                node, *detail = arguments or [""]
                told = {"t_s": t_ms / 1000, "event": what, "node": node, "detail": detail}
                yield Message("/plan", "outcrop.PlanEvent", t_ms, told)
                if what in STATES:
                    state = str(detail[0]) if what == "end" and detail else STATES[what]
                    about = {"t_s": t_ms / 1000, "node": node, "state": state}
                    yield Message("/nodes", "outcrop.NodeState", t_ms, about)
            case Command(command, action, parameters):
                book.sent(command)
                about = {"task": command.task, "attempt": command.attempt, "action": action}
                sent = {"t_s": t_ms / 1000, **about, "parameters": _finite(parameters)}
                yield Message("/commands", "outcrop.Command", t_ms, sent)
            case _ if record["k"] == "note":
                kind, text = require(record, "kind", str), require(record, "text", str)
                level = WARNING if kind in WARNINGS else INFO
                log = {"level": level, "message": text, "name": kind}
                yield Message("/log", "foxglove.Log", t_ms, {**_stamp(zero_ns, t_ms), **log})
        for event in events_from_json(record):
            sample = book.heard(event)
            if sample is not None:
                yield from _sample(sample, zero_ns, t_ms)
                yield from trail.goes_on(sample, t_ms)
            elif isinstance(event, Product):
                yield from _product(run, event, zero_ns, t_ms)


class Trail:
    """The line that the rover has drawn on its ground, a segment a message, for 3D panels."""

    def __init__(self, zero_ns: int) -> None:
        self._zero_ns, self._number = zero_ns, 0
        self._last: tuple[float, float] | None = None

    def goes_on(self, sample: Sample, t_ms: int) -> Iterator[Message]:
        """Yield the segment from the last place to that of a sample, none if the rover stands."""
        if not _is_pose(sample):
            return
        here, last = (sample.east_m, sample.north_m), self._last
        self._last = here
        if last is None or here == last:
            return
        self._number += 1
        origin = {
            "position": dict.fromkeys("xyz", 0.0),
            "orientation": {**dict.fromkeys("xyz", 0.0), "w": 1.0},
        }
        line = {
            "type": 0,  # a strip
            "pose": origin,
            "thickness": 3.0,
            "scale_invariant": True,
            "points": [{"x": x, "y": y, "z": 0.0} for x, y in (last, here)],
            "color": {"r": 0.9, "g": 0.5, "b": 0.1, "a": 1.0},
            "colors": [],
            "indices": [],
        }
        entity = {
            **_stamp(self._zero_ns, t_ms),
            "frame_id": "site",
            "id": f"trail-{self._number}",
            "lifetime": {"sec": 0, "nsec": 0},
            "frame_locked": False,
            **{kind: [] for kind in ("metadata", "arrows", "cubes", "spheres", "cylinders", "triangles")},
            "lines": [line],
            "texts": [],
            "models": [],
        }
        yield Message("/trail", "foxglove.SceneUpdate", t_ms, {"deletions": [], "entities": [entity]})


def _stamp(zero_ns: int, t_ms: int) -> dict[str, object]:
    seconds, nanoseconds = divmod(zero_ns + 1_000_000 * t_ms, 1_000_000_000)
    return {"timestamp": {"sec": seconds, "nsec": nanoseconds}}


def _sample(sample: Sample, zero_ns: int, t_ms: int) -> Iterator[Message]:
    told = sample.line()
    yield Message("/telemetry", "outcrop.Telemetry", t_ms, _finite(told))
    if not _is_pose(sample):
        log = {"level": WARNING, "message": "the rover told a pose that is not a number", "name": "telemetry"}
        yield Message("/log", "foxglove.Log", t_ms, {**_stamp(zero_ns, t_ms), **log})
        return
    half = sample.heading_rad / 2  # about z, east-north-up
    pose = {
        "position": {"x": sample.east_m, "y": sample.north_m, "z": 0.0},
        "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)},
    }
    content = {**_stamp(zero_ns, t_ms), "frame_id": "site", "pose": pose}
    yield Message("/pose", "foxglove.PoseInFrame", t_ms, content)


def _is_pose(sample: Sample) -> bool:
    return all(map(math.isfinite, (sample.east_m, sample.north_m, sample.heading_rad)))


def _finite(content: Any) -> Any:
    """Return content with null for every number that is not finite: JSON has no word for them."""
    match content:
        case float() if not math.isfinite(content):
            return None
        case dict():
            return {name: _finite(value) for name, value in content.items()}
        case list():
            return [_finite(value) for value in content]
        case _:
            return content


def _product(run: Path, product: Product, zero_ns: int, t_ms: int) -> Iterator[Message]:
    yield Message("/products", "outcrop.Product", t_ms, _finite(product_line(product)))
    path = safe_path(product.path)
    kind = FORMATS.get(Path(product.path).suffix.lower())
    if path is None or kind is None or not (run / path).is_file():
        return
    data = base64.b64encode((run / path).read_bytes()).decode()
    content = {**_stamp(zero_ns, t_ms), "frame_id": product.kind, "data": data, "format": kind}
    yield Message(f"/images/{product.kind}", "foxglove.CompressedImage", t_ms, content)
