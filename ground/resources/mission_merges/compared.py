"""What of a mission is compared and merged: members that people set, under ids that both sides share."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from typing import Any

from sqlalchemy.sql.schema import ScalarElementColumnDefault

from ground.gdr.base import table_of
from ground.resources.kinds import KINDS
from ground.versions.rows import GONE, Fields, Key, Rows, Schema

Rename = Callable[[str], str]
Document = Mapping[str, object]
"""A row as it stands in the history."""

MERGED = ("mission", "sol", "target", "observation_request", "keep_out")
PLACE, POSE, DRIVE = "place", "observation_pose", "drive "
"""Members that are merged as one: where a thing lies and its frame; a stand by hand; one drive rule."""
DIGITS = 6
"""Of metres in the axes of a frame: what is tied anew comes back with the error of the way there."""
PLAIN = {
    "mission": ("notes", "rover_profile", "calibration", "place"),
    "target": ("name", "notes", "feature_type", "source_image"),
    "keep_out": ("name", "notes"),
    "observation_request": (
        "instrument",
        "value",
        "tracked",
        "window_s",
        "must_do",
        "dwell_s",
        "notes",
        "rationale",
        "state",
    ),
    "sol": tuple(sorted(KINDS["sol"].fields)),
    "frame": ("key", "notes"),
    "solution": ("label", "offset_m", "quaternion", "covariance", "notes"),
    "frame_file": ("file_name", "sha256"),
    "site_map": ("name", "notes", "in_frame", "sha256"),
}
"""Members that are compared as they stand, by kind. A mission's name is its own."""
NAMING = {
    "mission": ("anchor_frame_id",),
    "observation_request": ("target_id",),
    "frame": ("solution_id",),
    "solution": ("frame_id", "reference_id"),
    "site_map": ("frame_id",),
}
"""Members that name one other resource."""


def fields_of(kind: str, document: Document, rename: Rename) -> Mapping[str, object]:
    """Return what is compared of a resource; `rename` gives the ids that both sides share."""
    found = {name: _member(kind, document, name) for name in PLAIN[kind]}
    for name in NAMING.get(kind, ()):
        found[name] = _renamed(document.get(name), rename)
    if kind in {"target", "keep_out"}:
        found[PLACE] = _place(kind, document, rename)
    elif kind == "observation_request":
        found["after"] = [rename(i) for i in _listed(document, "after")]
        found["constraints"] = _listed(document, "constraints")
        point = document.get("observation_point")
        found[POSE] = point.get("pose") if isinstance(point, dict) and point.get("manual") else None
    elif kind == "mission":
        found |= dict(_drives(document, rename))
    return found


def _member(kind: str, document: Document, name: str) -> Any:
    """Return a member; an event earlier than its column has what the column began with."""
    found = document.get(name)
    if found is None:
        default = table_of(KINDS[kind].row).c[name].default
        return default.arg if isinstance(default, ScalarElementColumnDefault) else None
    if isinstance(found, str) and name.endswith("_utc"):
        return datetime.fromisoformat(found).astimezone(UTC).isoformat()
    return found


def _listed(document: Document, name: str) -> list[Any]:
    found = document.get(name)
    return found if isinstance(found, list) else []


def _renamed(found: object, rename: Rename) -> str | None:
    return rename(found) if isinstance(found, str) else None


def _place(kind: str, document: Document, rename: Rename) -> Document:
    """Return where a thing lies: in site metres, or in the axes of the frame that it is tied to."""
    frame_id, seen = document.get("frame_id"), document.get("in_frame")
    if not isinstance(frame_id, str) or not isinstance(seen, dict):
        names = ("east_m", "north_m") if kind == "target" else ("polygon_m",)
        return {"frame_id": None, **{name: document.get(name) for name in names}}
    name = "position_m" if kind == "target" else "outline_m"
    return {"frame_id": rename(frame_id), name: _rounded(seen[name])}


def _rounded(found: Any) -> Any:
    return [_rounded(part) for part in found] if isinstance(found, list) else round(found, DIGITS) + 0.0


def _drives(document: Document, rename: Rename) -> Iterator[tuple[str, Document]]:
    """Yield the rule of each drive, its corners from the end whose id comes first."""
    for rule in _listed(document, "drive_rules"):
        first, last = _renamed(rule["from_target_id"], rename) or "", rename(rule["to_target_id"])
        via = rule["via_m"]
        if last < first:
            first, last, via = last, first, None if via is None else via[::-1]
        yield f"{DRIVE}{first} {last}", {"via_m": via}


def ends_of(name: str) -> tuple[str | None, str]:
    """Return the targets between which the drive of a member is; None is the start pose."""
    first, last = name.removeprefix(DRIVE).split(" ")
    return first or None, last


def references(key: Key, name: str, found: Any) -> Iterator[Key]:
    """Yield what a member names, as far as it is merged."""
    if found is None:
        return
    if name.startswith(DRIVE):
        yield from (("target", end) for end in ends_of(name) if end is not None)
    elif key[0] == "observation_request" and name == "target_id":
        yield "target", found
    elif key[0] == "observation_request" and name == "after":
        yield from (("observation_request", i) for i in found)


def without(_key: Key, name: str, found: Any, other: Key) -> Any:
    """Return a member without what it names: an order without one, no rule for a drive."""
    if name == "target_id":
        return GONE
    return [i for i in found if i != other[1]] if name == "after" else None


def schema_of(*sides: Rows) -> Schema:
    """Return what a merge has to know of the parts of missions; names are those of the first side with it."""
    targets = {
        key[1]: row["name"] for side in reversed(sides) for key, row in side.items() if key[0] == "target"
    }

    def name(key: Key, row: Fields) -> str:
        if key[0] == "observation_request":
            return f"{row.get('instrument', '')} of {targets.get(str(row.get('target_id', '')), '')}"
        if key[0] == "sol":
            return f"sol {row.get('number', '')}"
        return str(row.get("name") or row.get("key") or row.get("label") or row.get("file_name") or "")

    return Schema(
        references,
        without,
        {"target": "name", "sol": "number"},
        ("observation_request", "after"),
        frozenset(MERGED),
        name,
    )
