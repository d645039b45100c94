"""Say where a point of a mission's site lies in another reference."""

from __future__ import annotations

from ground.gdr.repository import Repository
from ground.geo.in_reference import from_site
from ground.records.actor import Action, Actor
from ground.records.get_resource import require_mission
from ground.records.located import PointIn
from ground.resources.missions.where import site_of


def read_coordinates(
    repo: Repository, actor: Actor, mission_id: str, east_m: float, north_m: float, crs: str
) -> PointIn:
    """Return a point given in site metres in a reference.

    Raises
    ------
    InvalidInputError
        If nobody has said where the site lies, or there is no way to the reference.
    """
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        require_mission(session, mission_id)
        site = site_of(session, mission_id)
    ((x, y),) = from_site([(east_m, north_m)], crs, site)
    return PointIn(crs, x, y)
