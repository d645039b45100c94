"""Pick a target."""

from __future__ import annotations

from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import NameTakenError, UnobservedGroundError
from ground.gdr.geometry import Pose
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert
from ground.resources.missions.terrain import mission_terrain, terrain_row
from ground.resources.targets.kind import TARGET, show_targets
from ground.resources.targets.row import TargetRow
from ground.resources.targets.tie_target import tied_target
from ground.resources.targets.value import Target
from ground.resources.terrains.terrain import ground_at


def create_target(
    repo: Repository,
    actor: Actor,
    mission_id: str,
    *,
    east_m: float,
    north_m: float,
    name: str | None = None,
    notes: str = "",
    source_image: str = "",
    frame_id: str | None = None,
) -> Target:
    """Return a new target; height, normal and covariance come from the full-resolution terrain.

    With `frame_id` it is tied to the frame it was seen from, and moves with it.

    Raises
    ------
    OutsideTerrainError
        If the point is off the terrain.
    NameTakenError
        If another target has the name.
    """
    actor.require(Action.EDIT_SCIENCE, mission_id)
    with repo.database.read() as session:
        columns = target_columns(repo, session, mission_id, east_m, north_m)
    with repo.database.write() as session:
        row = TargetRow(
            id=new_id("tgt"),
            author=actor.name,
            mission_id=mission_id,
            name=free_name(session, mission_id, name),
            notes=notes,
            source_image=source_image,
            **columns,
        )
        if frame_id is not None:
            tied = tied_target(session, row, {**columns, "frame_id": frame_id})
            for column, value in tied.items():
                setattr(row, column, value)
        insert(session, actor, TARGET, row)
        return show_targets(session, [row])[0]


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
    start = Pose(**terrain_row(session, mission_id).description["start_pose"])
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
    query = select(TargetRow.name).where(TargetRow.mission_id == mission_id)
    taken = set(session.scalars(query))
    if wanted is None:
        number = len(taken) + 1
        while f"T{number}" in taken:
            number += 1
        return f"T{number}"
    if wanted in taken:
        raise NameTakenError(f"there is a target {wanted!r} already", pointer="/name")
    return wanted
