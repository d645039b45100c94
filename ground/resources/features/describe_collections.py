"""What is told of a mission's collections."""

from __future__ import annotations

from sqlalchemy import select

from ground.gdr.geometry import Bounds
from ground.gdr.repository import Repository
from ground.geo.place import Place
from ground.geo.site_frame import site_frame
from ground.records.actor import Action, Actor
from ground.resources.features.select_features import place_of
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import terrain_bounds


def describe_site(repo: Repository, actor: Actor, mission_id: str) -> tuple[str, str, Place, Bounds]:
    """Return a mission's name, the name of its reference, its place and the rectangle of its terrain.

    Raises
    ------
    NotFoundError, StateError
        If there is no such mission, or it has no place.
    """
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        place = place_of(session, mission_id)
        name = session.scalar(select(MissionRow.name).where(MissionRow.id == mission_id)) or ""
        return name, site_frame(place).degrees.name, place, terrain_bounds(session, mission_id)
