"""Change members of a resource."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, NameTakenError
from ground.gdr import models as m
from ground.gdr.repository import Repository
from ground.services.actor import Actor
from ground.services.checks import (
    free_name,
    require_after,
    require_calibration,
    require_drive_rules,
    require_polygon,
    require_profile,
    require_window,
)
from ground.services.edit import open_for_change, update
from ground.services.kinds import KINDS
from ground.services.prepare_change import Prepared, prepare_change, set_by_hand
from ground.services.site_chain import require_anchor, tied_columns


def change_resource(
    repo: Repository,
    actor: Actor,
    kind_name: str,
    resource_id: str,
    changes: Mapping[str, Any],
    revision: int | None,
    *,
    reason: str = "",
) -> Any:
    """Return the resource after the change.

    `revision` is the one the person saw; None changes whatever stands there (the command line's `--force`).

    Raises
    ------
    StaleRevisionError
        If somebody else changed it in between.
    """
    wrong = set(changes) - KINDS[kind_name].fields
    while True:
        prepared = prepare_change(repo, actor, kind_name, resource_id, {} if wrong else changes)
        with repo.database.write() as session:
            kind, row = open_for_change(session, actor, kind_name, resource_id, revision)
            if wrong:
                raise InvalidInputError(f"{kind.title} has nothing to set called {sorted(wrong)[0]!r}")
            requests = _requests_to_move(session, prepared, row)
            if row.revision != prepared.revision or requests is None:
                continue  # somebody was faster: what the terrain said was said of something else
            columns = _columns(repo, session, kind_name, row, dict(changes))
            columns |= prepared.columns
            columns |= tied_columns(session, kind_name, row, columns)
            if kind_name == "observation_request" and prepared.points:
                columns["observation_point"] = prepared.points[
                    (row.id, columns.get("instrument", row.instrument))
                ]
            update(session, actor, kind, row, columns, reason=reason)
            for request in requests:
                point = prepared.points[(request.id, request.instrument)]
                moved = {"observation_point": point}
                update(session, actor, KINDS["observation_request"], request, moved)
            return kind.show(session, [row])[0]


def _requests_to_move(session: Session, prepared: Prepared, row: Any) -> list[Any] | None:
    """Return the requests that move with a target; None if others than those prepared for are there now."""
    if not isinstance(row, m.TargetRow) or not prepared.columns:
        return []
    query = select(m.ObservationRequestRow).where(m.ObservationRequestRow.target_id == row.id)
    found = [r for r in session.scalars(query.with_for_update()) if not set_by_hand(r)]
    return found if all((r.id, r.instrument) in prepared.points for r in found) else None


def _columns(
    repo: Repository, session: Session, kind: str, row: Any, given: dict[str, Any]
) -> dict[str, Any]:
    columns = {name: _plain(value) for name, value in given.items()}
    match kind:
        case "mission":
            if "rover_profile" in given:
                require_profile(given["rover_profile"])
            if given.get("calibration") is not None:
                columns["calibration"] = require_calibration(given["calibration"])
            if given.get("drive_rules"):
                require_drive_rules(session, row.id, columns["drive_rules"])
            if "anchor_frame_id" in given and given["anchor_frame_id"] != row.anchor_frame_id:
                require_anchor(session, row.id, given["anchor_frame_id"])
        case "target":
            if "name" in given and given["name"] != row.name:
                free_name(session, row.mission_id, given["name"])
        case "observation_request":
            if "window_s" in given:
                require_window(given["window_s"])
            if "after" in given:
                require_after(session, row.mission_id, row.id, given["after"])
            if "state" in given and given["state"] not in {"open", "carried"}:
                raise InvalidInputError(
                    f"the state {given['state']!r} comes from plans and runs; a person may set open "
                    "or carried",
                    pointer="/state",
                )
            columns.pop("observation_pose", None)
        case "keep_out":
            if "polygon_m" in given:
                require_polygon(repo, session, row.mission_id, given["polygon_m"])
        case "sol":
            if "number" in given and given["number"] != row.number:
                query = select(m.SolRow.id).where(
                    m.SolRow.mission_id == row.mission_id, m.SolRow.number == given["number"]
                )
                if session.scalars(query).first():
                    raise NameTakenError(f"there is a sol {given['number']} already", pointer="/number")
        case _:
            pass
    return columns


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return getattr(value, "value", value)
