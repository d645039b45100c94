"""The terrain that a mission stands on."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import NotFoundError
from ground.gdr.geometry import Bounds
from ground.gdr.repository import Repository
from ground.resources.missions.row import MissionRow
from ground.resources.terrains.row import TerrainRow

if TYPE_CHECKING:
    from rover_iface.terrain import Terrain
from ground.gdr.terrain_folders import load_cached


def terrain_row(session: Session, mission_id: str) -> TerrainRow:
    """Return the row of a mission's terrain."""
    row = session.scalars(
        select(TerrainRow)
        .join(MissionRow, MissionRow.terrain_id == TerrainRow.id)
        .where(MissionRow.id == mission_id)
    ).first()
    if row is None:
        raise NotFoundError(f"there is no mission {mission_id}")
    return row


def mission_terrain(repo: Repository, session: Session, mission_id: str) -> Terrain:
    """Return the full-resolution terrain of a mission."""
    return load_cached(repo.terrain_dir(terrain_row(session, mission_id).id))


def terrain_bounds(session: Session, mission_id: str) -> Bounds:
    """Return the rectangle of a mission's terrain, site frame, m."""
    return Bounds(**terrain_row(session, mission_id).description["bounds_m"])
