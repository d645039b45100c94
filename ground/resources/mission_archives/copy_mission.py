"""Copy a mission: a what-if of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.gdr.base import utc_now
from ground.gdr.history import open_chain
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, update
from ground.records.get_resource import find_row
from ground.resources.kinds import KINDS
from ground.resources.missions.kind import MISSION
from ground.resources.missions.value import Mission
from ground.resources.people.mission_roles import inherit_roles
from mission.codec import Document

COPIED = ("frame", "solution", "frame_file", "site_map", "sol", "target", "observation_request", "keep_out")
"""Kinds that a copy has, in the order in which they refer to each other."""


def copy_row(row: Any, changes: Document) -> Any:
    """Return a new row with the columns of another, some changed."""
    columns = {c.key: getattr(row, c.key) for c in row.__mapper__.column_attrs}
    now = utc_now()
    return type(row)(**{**columns, "revision": 1, "created_utc": now, "modified_utc": now, **changes})


def copy_mission(repo: Repository, actor: Actor, mission_id: str, *, name: str, notes: str = "") -> Mission:
    """Return a copy with its own sols, targets, requests and keep-outs; plans and runs stay with the first.

    Requests begin again as open. The terrain is shared, it never changes. Who may see the first may see the
    copy, and nobody else: see `inherit_roles`.
    """
    actor.require(Action.EDIT_MISSION, mission_id)
    with repo.database.write() as session:
        source = find_row(session, MISSION, mission_id)
        copy = copy_row(
            source,
            {
                "id": new_id("msn"),
                "name": name,
                "notes": notes,
                "author": actor.name,
                "copied_from": source.id,
                "anchor_frame_id": None,
                "drive_rules": None,
            },
        )
        session.add(copy)
        session.flush()
        open_chain(session, copy.id)
        insert(session, actor, MISSION, copy)
        inherit_roles(session, actor, source.id, copy.id)
        new_ids = _copy_parts(session, actor, source.id, copy.id)
        if source.drive_rules:
            update(session, actor, MISSION, copy, {"drive_rules": _rules(source.drive_rules, new_ids)})
        if source.anchor_frame_id is not None:
            anchored = {"anchor_frame_id": new_ids[source.anchor_frame_id]}
            update(session, actor, MISSION, copy, anchored)
        return MISSION.show_one(session, copy)


def _rules(rules: Sequence[Mapping[str, Any]], new_ids: Mapping[str, str]) -> list[dict[str, Any]]:
    """Return drive rules between the targets of the copy."""
    ends = ("from_target_id", "to_target_id")
    return [{**rule, **{end: new_ids.get(rule[end]) for end in ends}} for rule in rules]


def _copy_parts(session: Session, actor: Actor, source_id: str, copy_id: str) -> dict[str, str]:
    """Copy what belongs to a mission; return the new ids by the old ones."""
    new_ids: dict[str, str] = {}
    found: dict[str, list[Any]] = {}
    for kind_name in COPIED:
        rows: Any = KINDS[kind_name].row
        query = select(rows).where(rows.mission_id == source_id).order_by(rows.id)
        found[kind_name] = list(session.scalars(query))
        new_ids |= {row.id: new_id(KINDS[kind_name].prefix) for row in found[kind_name]}
    for kind_name in COPIED:
        kind = KINDS[kind_name]
        for row in found[kind_name]:
            changes: dict[str, Any] = {"id": new_ids[row.id], "mission_id": copy_id, "author": actor.name}
            for name in ("frame_id", "reference_id", "solution_id", "file_id"):
                if getattr(row, name, None) is not None:
                    changes[name] = new_ids[getattr(row, name)]
            if kind_name == "observation_request":
                changes |= {
                    "target_id": new_ids[row.target_id],
                    "after": [new_ids[i] for i in row.after if i in new_ids],
                    "state": "open",
                    "state_reason": "",
                }
            insert(session, actor, kind, copy_row(row, changes))
    return new_ids
