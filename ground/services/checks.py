"""Rules that hold for what people enter, beyond the form of each member."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, NameTakenError, OutsideTerrainError, UnobservedGroundError
from ground.gdr import models as m
from ground.gdr import values as v
from ground.gdr.repository import Repository
from ground.services.terrains import ground_at, mission_terrain, terrain_row


def target_columns(
    repo: Repository, session: Session, mission_id: str, east_m: float, north_m: float
) -> dict[str, Any]:
    """Return what the terrain says of a target's point.

    Raises
    ------
    OutsideTerrainError
        If the terrain has no height there.
    UnobservedGroundError
        If it has one that no camera saw.
    """
    terrain = mission_terrain(repo, session, mission_id)
    start = v.Pose(**terrain_row(session, mission_id).description["start_pose"])
    point = ground_at(terrain, east_m, north_m, start)
    if not point.observed:
        raise UnobservedGroundError(
            f"the ground at ({east_m:.2f}, {north_m:.2f}) was never observed, its height is filled in; "
            "a target has to be a point that was seen",
            pointer="/east_m",
        )
    return {
        "east_m": east_m,
        "north_m": north_m,
        "up_m": point.up_m,
        "normal": point.normal,
        "slope_rad": point.slope_rad,
        "covariance_m2": point.covariance_m2,
    }


def free_name(session: Session, mission_id: str, wanted: str | None) -> str:
    """Return a target's name: the one wanted, or the next of T1, T2, ...

    Raises
    ------
    NameTakenError
        If another target of the mission has it.
    """
    query = select(m.TargetRow.name).where(m.TargetRow.mission_id == mission_id)
    taken = set(session.scalars(query))
    if wanted is None:
        number = len(taken) + 1
        while f"T{number}" in taken:
            number += 1
        return f"T{number}"
    if wanted in taken:
        raise NameTakenError(f"there is a target {wanted!r} already", pointer="/name")
    return wanted


def require_polygon(
    repo: Repository, session: Session, mission_id: str, polygon_m: Sequence[Sequence[float]]
) -> None:
    """Raise unless the corners make a simple polygon with an area, on the terrain."""
    from shapely.geometry import Polygon

    corners = [tuple(c) for c in polygon_m]
    if len(corners) > 1 and corners[0] == corners[-1]:
        corners = corners[:-1]
    if len(set(corners)) < 3:
        raise InvalidInputError(
            f"a keep-out needs 3 corners, this one has {len(set(corners))}", pointer="/polygon_m"
        )
    shape = Polygon(corners)
    if not shape.is_valid or shape.area < 1e-4:
        raise InvalidInputError(
            "the outline of the keep-out crosses itself or has no area", pointer="/polygon_m"
        )
    bounds = terrain_row(session, mission_id).description["bounds_m"]
    west, south, east, north = shape.bounds
    margin = 10.0
    if (
        west < bounds["east_min_m"] - margin
        or east > bounds["east_max_m"] + margin
        or south < bounds["north_min_m"] - margin
        or north > bounds["north_max_m"] + margin
    ):
        raise OutsideTerrainError(
            f"the keep-out reaches from ({west:.1f}, {south:.1f}) to ({east:.1f}, {north:.1f}) m, "
            f"more than {margin:g} m "
            f"off the terrain",
            pointer="/polygon_m",
        )


def require_window(window_s: Sequence[float] | None) -> None:
    """Raise unless a time window ends after it begins."""
    if window_s is not None and not window_s[0] < window_s[1]:
        raise InvalidInputError(
            f"the window ends at {window_s[1]:g} s and begins at {window_s[0]:g} s", pointer="/window_s"
        )


def require_after(session: Session, mission_id: str, request_id: str | None, after: Sequence[str]) -> None:
    """Raise unless the requests to be done before exist in the mission and make no circle."""
    rows = session.execute(
        select(m.ObservationRequestRow.id, m.ObservationRequestRow.after).where(
            m.ObservationRequestRow.mission_id == mission_id
        )
    ).all()
    before: dict[str, list[str]] = {row.id: list(row.after) for row in rows}
    for index, other in enumerate(after):
        if other not in before or other == request_id:
            raise InvalidInputError(
                f"there is no other observation request {other} in the mission", pointer=f"/after/{index}"
            )
    if request_id is None:
        return
    before[request_id] = list(after)
    seen: set[str] = set()
    stack = list(after)
    while stack:
        current = stack.pop()
        if current == request_id:
            raise InvalidInputError(f"{request_id} would have to come before itself", pointer="/after")
        if current not in seen:
            seen.add(current)
            stack.extend(before.get(current, ()))


def next_number(session: Session, row: Any, mission_id: str) -> int:
    """Return one more than the largest `number` in the mission."""
    return int(session.scalar(select(func.max(row.number)).where(row.mission_id == mission_id)) or 0) + 1


def require_profile(name: str) -> None:
    """Raise unless there is a rover profile of the name."""
    from rover_iface.profile import profile_names

    if name not in profile_names():
        raise InvalidInputError(
            f"there is no rover profile {name!r}; there are {', '.join(profile_names())}",
            pointer="/rover_profile",
        )


def require_drive_rules(session: Session, mission_id: str, rules: Sequence[Mapping[str, Any]]) -> None:
    """Raise unless each rule is about two places of the mission that no other rule is about."""
    known = {None, *session.scalars(select(m.TargetRow.id).where(m.TargetRow.mission_id == mission_id))}
    seen: set[frozenset[str | None]] = set()
    for index, rule in enumerate(rules):
        ends = rule["from_target_id"], rule["to_target_id"]
        for end in ends:
            if end not in known:
                raise InvalidInputError(
                    f"there is no target {end} in the mission", pointer=f"/drive_rules/{index}"
                )
        if ends[0] == ends[1]:
            raise InvalidInputError(
                "a drive leads from one place to another", pointer=f"/drive_rules/{index}/to_target_id"
            )
        if frozenset(ends) in seen:
            raise InvalidInputError("there is a rule for this drive already", pointer=f"/drive_rules/{index}")
        seen.add(frozenset(ends))


def require_calibration(document: dict[str, Any]) -> dict[str, Any]:
    """Return a `calibration/1` document with all its members; raise if it is none."""
    from planner.errors import PlannerError
    from planner.path_network import calibration_from_json, calibration_to_json

    try:
        checked: dict[str, Any] = json.loads(calibration_to_json(calibration_from_json(json.dumps(document))))
    except PlannerError as err:
        raise InvalidInputError(str(err), pointer="/calibration") from err
    return checked
