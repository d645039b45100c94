"""Pick a target."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from ground.errors import GroundError, UnobservedGroundError
from ground.gdr.base import Columns
from ground.gdr.geometry import Pose
from ground.gdr.history import batch_of
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, new_row
from ground.resources.missions.terrain import mission_terrain, terrain_row
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.in_reference import target_in_site
from ground.resources.targets.kind import TARGET
from ground.resources.targets.row import TargetRow
from ground.resources.targets.rules import free_name
from ground.resources.targets.tie_target import tied_target
from ground.resources.targets.value import Target
from ground.resources.terrains.terrain import Surface, surfaces_at

if TYPE_CHECKING:
    from rover_iface.terrain import Terrain


Foreseen = tuple[TargetCreate, Mapping[str, object]]
"""The form of a target in the axes of its mission, and what the terrain says of its point."""


def create_target(
    repo: Repository,
    actor: Actor,
    mission_id: str,
    given: TargetCreate,
    foreseen: Foreseen | GroundError | None = None,
) -> Target:
    """Return a new target; height, normal and covariance come from the full-resolution terrain.

    With `frame_id` it is tied to the frame it was seen from, and moves with it. `foreseen` is what the
    terrain says, or why nothing can be made there, if it was asked before.

    Raises
    ------
    OutsideTerrainError
        If the point is off the terrain.
    NameTakenError
        If another target has the name.
    InvalidInputError
        If it is given in a reference from which there is no way to the site.
    """
    actor.require(Action.EDIT_SCIENCE, mission_id)
    if foreseen is None:
        with repo.database.read() as session:
            given = target_in_site(session, mission_id, given)
            foreseen = given, target_columns(repo, session, mission_id, given.east_m, given.north_m)
    if isinstance(foreseen, GroundError):
        raise foreseen
    given, columns = foreseen
    with repo.database.write() as session:
        row = target_row(session, actor, mission_id, given, columns)
        insert(session, actor, TARGET, row)
        return TARGET.show_one(session, row)


def target_row(
    session: Session, actor: Actor, mission_id: str, given: TargetCreate, columns: Mapping[str, object]
) -> TargetRow:
    """Return the row of a target from what a person gave and what the terrain says of its point.

    Raises
    ------
    NameTakenError, InvalidInputError
        If another target has the name, or the mission has no such frame.
    """
    name = _free_name(session, mission_id, given.name)
    row: TargetRow = new_row(TARGET, actor, mission_id, given, **{**columns, "name": name})
    for column, value in tied_target(session, row, columns).items():
        setattr(row, column, value)
    return row


def _free_name(session: Session, mission_id: str, wanted: str | None) -> str:
    """Return a name that is free; in a batch the taken ones are read once."""
    batch = batch_of(session)
    if batch is None:
        return free_name(NamesOf(session, mission_id), wanted)
    if TargetRow.__tablename__ not in batch:
        names = session.scalars(select(TargetRow.name).where(TargetRow.mission_id == mission_id))
        batch[TargetRow.__tablename__] = set(names)
    taken = batch[TargetRow.__tablename__]
    name = free_name(taken, wanted)
    taken.add(name)
    return name


def foresee_targets(
    repo: Repository, mission_id: str, given: Sequence[TargetCreate]
) -> list[Foreseen | GroundError]:
    """Return what making many targets takes long for; the error where the terrain says nothing of a point."""
    with repo.database.read() as session:
        terrain, start = _ground(repo, session, mission_id)
        settled: list[TargetCreate | GroundError] = []
        for one in given:
            try:
                settled.append(target_in_site(session, mission_id, one))
            except GroundError as err:
                settled.append(err)
    there = [(one.east_m, one.north_m) for one in settled if not isinstance(one, GroundError)]
    columns = iter(_columns_at(terrain, start, there))
    found: list[Foreseen | GroundError] = []
    for form in settled:
        if isinstance(form, GroundError):
            found.append(form)
        else:
            here = next(columns)
            found.append(here if isinstance(here, GroundError) else (form, here))
    return found


def target_columns(
    repo: Repository, session: Session, mission_id: str, east_m: float, north_m: float
) -> dict[str, object]:
    """Return what the terrain says of a target's point.

    Raises
    ------
    OutsideTerrainError
        If the terrain has no height there.
    UnobservedGroundError
        If it has one that no camera saw.
    """
    (found,) = _columns_at(*_ground(repo, session, mission_id), [(east_m, north_m)])
    if isinstance(found, GroundError):
        raise found
    return found


def _ground(repo: Repository, session: Session, mission_id: str) -> tuple[Terrain, Pose]:
    """Return the terrain of a mission, and where its rover stands at first."""
    start = Pose(**terrain_row(session, mission_id).description["start_pose"])
    return mission_terrain(repo, session, mission_id), start


def _columns_at(
    terrain: Terrain, start: Pose, points: Sequence[tuple[float, float]]
) -> list[Columns | GroundError]:
    """Return what the terrain says of points (east, north), m; why nothing can be made where it says so."""
    return [
        found if isinstance(found, GroundError) else _columns_of(found)
        for found in surfaces_at(terrain, points, start)
    ]


def _columns_of(point: Surface) -> Columns | GroundError:
    if not point.observed:
        return UnobservedGroundError(
            f"the ground at ({point.east_m:.2f}, {point.north_m:.2f}) was never observed, its height is "
            "filled in; a target has to be a point that was seen",
            pointer="/east_m",
        )
    return {f.name: getattr(point, f.name) for f in fields(point) if f.name != "observed"}


@dataclass(frozen=True, slots=True)
class NamesOf:
    """The names that a mission's targets have, asked for one by one: a mission may have ten thousand."""

    session: Session
    mission_id: str

    def __len__(self) -> int:
        query = select(func.count()).where(TargetRow.mission_id == self.mission_id)
        return self.session.scalar(query) or 0

    def __contains__(self, name: object) -> bool:
        query = select(TargetRow.id).where(TargetRow.mission_id == self.mission_id, TargetRow.name == name)
        return self.session.scalars(query).first() is not None
