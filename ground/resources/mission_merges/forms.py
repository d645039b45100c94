"""Forms by which a merge changes and makes what people otherwise change and make by hand."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import ValidationError
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError
from ground.gdr.base import Columns
from ground.records.forms import Body
from ground.resources.frames.site_chain import load_chain, outline_of, require_frame
from ground.resources.mission_merges.compared import DRIVE, PLACE, ends_of, references
from ground.versions.rows import Fields, Key

Ids = Mapping[str, str]
"""Ids of what was made, by those that the merge knew it by."""


def form_of(form: type[Body], members: Mapping[str, object]) -> Body:
    """Return a form that is filled in.

    Raises
    ------
    InvalidInputError
        If a member cannot be that.
    """
    try:
        return form.model_validate(members)
    except ValidationError as err:
        first = err.errors()[0]
        place = "/".join(str(part) for part in first["loc"])
        raise InvalidInputError(f"{place}: {first['msg']}", pointer=f"/{place}") from err


def members_of(session: Session, mission_id: str, key: Key, fields: Fields, ids: Ids) -> dict[str, object]:
    """Return the members of a form that give a resource these fields, but for drive rules.

    Raises
    ------
    InvalidInputError, StateError
        If it is tied to a frame that the mission does not have, or that lies nowhere.
    """
    found: Columns = {}
    for name, value in fields.items():
        if name == PLACE and key[0] != "mission" and isinstance(value, Mapping):
            found |= _place(session, mission_id, key[0], value)
        elif name == "after" and isinstance(value, list):
            found[name] = [ids.get(i, i) for i in value]
        elif name == "target_id" and isinstance(value, str):
            found[name] = ids.get(value, value)
        elif not name.startswith(DRIVE):
            found[name] = value
    return found


def _place(session: Session, mission_id: str, kind: str, place: Mapping[str, Any]) -> Columns:
    """Return a place in site metres, and its frame."""
    frame_id = place["frame_id"]
    if frame_id is None:
        return dict(place)
    from rover_iface.frames import NED_FROM_ENU

    require_frame(session, mission_id, frame_id)
    placed = load_chain(session, mission_id).placed(frame_id)
    if kind == "keep_out":
        return {"frame_id": frame_id, "polygon_m": outline_of(placed, place)[0]}
    east, north, _ = (float(x) for x in NED_FROM_ENU @ placed.anchor_from_frame.apply(place["position_m"]))
    return {"frame_id": frame_id, "east_m": east, "north_m": north}


def drive_rules_of(fields: Fields, ids: Ids) -> list[dict[str, object]]:
    """Return the drive rules of a mission."""
    found = []
    for name, rule in fields.items():
        if name.startswith(DRIVE) and isinstance(rule, Mapping):
            first, last = ends_of(name)
            ends = {
                "from_target_id": None if first is None else ids.get(first, first),
                "to_target_id": ids.get(last, last),
            }
            found.append({**ends, "via_m": rule["via_m"]})
    return found


Update = tuple[Key, dict[str, object]]


def in_turn(updates: Mapping[Key, dict[str, object]], held: Mapping[Any, Key], name: str) -> Iterator[Update]:
    """Yield changes of rows in an order in which no two have one name or number at any time.

    Where names go round in a circle, one row has a name in between.
    """
    present = dict(held)
    names = {key: found for found, key in held.items()}
    waiting = dict(updates)
    while waiting:
        moved = False
        for key in list(waiting):
            wanted = waiting[key].get(name, names.get(key))
            if present.get(wanted, key) != key:
                continue
            yield key, waiting.pop(key)
            present.pop(names.get(key), None)
            present[wanted], names[key] = key, wanted
            moved = True
        if waiting and not moved:
            key = next(iter(waiting))
            between = _between(present)
            yield key, {name: between}
            present.pop(names[key], None)
            present[between], names[key] = key, between


def _between(present: Mapping[Any, Key]) -> Any:
    if any(isinstance(found, int) for found in present):
        return next(n for n in range(100_000, -1, -1) if n not in present)
    return next(text for n in range(len(present) + 1) if (text := f"(being renamed {n})") not in present)


def in_order(new: Mapping[Key, Fields]) -> list[Key]:
    """Return requests in an order in which each stands behind those that it comes after."""
    found: dict[Key, None] = {}
    for start in sorted(new):
        stack = [start]
        while stack:
            key = stack[-1]
            after = references(key, "after", new[key]["after"])
            waits = [other for other in after if other in new and other not in found]
            if waits and key not in found:
                stack.extend(waits)
            else:
                found[stack.pop()] = None
    return list(found)
