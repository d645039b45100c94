"""Open a mission on a terrain."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ground.errors import TerrainFileError
from ground.gdr.history import open_chain
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert
from ground.resources.mission_setup.unpack_terrain import unpack_terrain
from ground.resources.missions.bodies import PlaceBody
from ground.resources.missions.kind import MISSION
from ground.resources.missions.row import MissionRow
from ground.resources.missions.rules import place_in, require_place, require_profile
from ground.resources.missions.value import Mission
from ground.resources.terrains.terrain import store_terrain

if TYPE_CHECKING:
    from rover_iface.terrain import Terrain


@dataclass(frozen=True, slots=True)
class GeneratedTerrain:
    """A terrain made from a seed."""

    seed: int
    size_m: float = 128.0
    rock_cover: float = 0.05


@dataclass(frozen=True, slots=True)
class UploadedTerrain:
    """A terrain from files that were uploaded: a zip of a folder, a GeoTIFF, a mesh; an ortho image
    beside it.
    """

    upload_id: str
    ortho_upload_id: str | None = None


@dataclass(frozen=True, slots=True)
class FolderTerrain:
    """A terrain from a folder on this machine; only the command line may say so."""

    folder: Path


TerrainSource = GeneratedTerrain | UploadedTerrain | FolderTerrain


def load_source(repo: Repository, actor: Actor, source: TerrainSource, work: Path) -> Terrain:
    """Return the terrain a mission is to stand on; `work` is an empty folder for unpacking.

    Raises
    ------
    TerrainFileError
        If it cannot be read.
    """
    from rover_iface.errors import RoverError
    from rover_iface.terrain import generate_terrain, load_terrain

    try:
        match source:
            case GeneratedTerrain(seed, size_m, rock_cover):
                return generate_terrain(seed, size_m, rock_cover=rock_cover)
            case FolderTerrain(folder):
                return load_terrain(folder)
            case UploadedTerrain():
                return load_terrain(
                    unpack_terrain(repo, actor, source.upload_id, source.ortho_upload_id, work)
                )
    except RoverError as err:
        raise TerrainFileError(str(err).replace(f"{work}/", ""), pointer="/terrain") from err


def create_mission(
    repo: Repository,
    actor: Actor,
    *,
    name: str,
    source: TerrainSource,
    notes: str = "",
    rover_profile: str = "k9",
    terrain_name: str | None = None,
    place: PlaceBody | None = None,
) -> Mission:
    """Return a new mission without targets, with a first sol still to be opened.

    Its site lies at `place`, else where the files of the terrain say if that can be used.

    Raises
    ------
    InvalidInputError
        If terrain, rover profile or place cannot be used.
    """
    actor.require(Action.EDIT_MISSION)
    require_profile(rover_profile)
    if place is not None:
        require_place(place)
    with tempfile.TemporaryDirectory(prefix="outcrop-terrain-") as work:
        terrain = load_source(repo, actor, source, Path(work))
        told = place_in(terrain.origin) if place is None else place.model_dump()
        label = terrain_name or terrain.name or name
        with repo.database.write() as session:
            ground = store_terrain(repo, session, terrain, name=label[:200], author=actor.name)
            row = MissionRow(
                id=new_id("msn"),
                author=actor.name,
                name=name,
                notes=notes,
                terrain_id=ground.id,
                copied_from=None,
                rover_profile=rover_profile,
                place=told,
            )
            session.add(row)
            session.flush()
            open_chain(session, row.id)
            insert(session, actor, MISSION, row)
            return MISSION.show_one(session, row)
