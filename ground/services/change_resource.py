"""Change members of a resource."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, is_dataclass
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, NameTakenError
from ground.gdr import models as m
from ground.gdr import values as v
from ground.gdr.repository import Repository
from ground.services.actor import Actor
from ground.services.checks import (
    free_name,
    require_after,
    require_polygon,
    require_profile,
    require_window,
    target_columns,
)
from ground.services.edit import open_for_change, update
from ground.services.kinds import observation_point_of
from ground.services.place_rover import place_rover


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
    with repo.database.write() as session:
        kind, row = open_for_change(session, actor, kind_name, resource_id, revision)
        wrong = set(changes) - kind.fields
        if wrong:
            raise InvalidInputError(f"{kind.title} has nothing to set called {sorted(wrong)[0]!r}")
        columns = _columns(repo, session, kind_name, row, dict(changes))
        update(session, actor, kind, row, columns, reason=reason)
        if kind_name == "target" and {"east_m", "north_m"} & set(changes):
            _move_requests(repo, session, actor, row)
        return kind.show(session, [row])[0]


def _columns(
    repo: Repository, session: Session, kind: str, row: Any, given: dict[str, Any]
) -> dict[str, Any]:
    columns = {name: _plain(value) for name, value in given.items()}
    match kind:
        case "mission":
            if "rover_profile" in given:
                require_profile(given["rover_profile"])
        case "target":
            if "name" in given and given["name"] != row.name:
                free_name(session, row.mission_id, given["name"])
            if {"east_m", "north_m"} & set(given):
                east, north = given.get("east_m", row.east_m), given.get("north_m", row.north_m)
                columns |= target_columns(repo, session, row.mission_id, east, north)
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
            pose = columns.pop("observation_pose", None)
            if "observation_pose" in given or "instrument" in given:
                instrument = v.Instrument(given.get("instrument", row.instrument))
                target = session.get_one(m.TargetRow, row.target_id)
                old = observation_point_of(row.observation_point)
                if "observation_pose" not in given and old is not None and old.manual:
                    manual = old.pose
                else:
                    manual = None if pose is None else v.Pose(**pose)
                point = place_rover(repo, session, target, instrument, manual)
                columns["observation_point"] = None if point is None else asdict(point)
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


def _move_requests(repo: Repository, session: Session, actor: Actor, target: m.TargetRow) -> None:
    """Find the observation points anew when a target has moved."""
    from ground.services.kinds import KINDS

    for request in session.scalars(
        select(m.ObservationRequestRow).where(m.ObservationRequestRow.target_id == target.id)
    ):
        old = observation_point_of(request.observation_point)
        if old is not None and old.manual:
            continue
        point = place_rover(repo, session, target, v.Instrument(request.instrument))
        document = None if point is None else asdict(point)
        update(session, actor, KINDS["observation_request"], request, {"observation_point": document})


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return getattr(value, "value", value)
