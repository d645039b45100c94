"""Open a mission from what a request says of its terrain."""

from __future__ import annotations

from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.get_resource import get_resource
from ground.resources.mission_setup import create_mission as missions
from ground.resources.mission_setup.bodies import DemoTerrain, GeneratedTerrain, MissionCreate
from ground.resources.mission_setup.load_demo import SEED, demo_source, fill_with_demo
from ground.resources.missions.kind import MISSION
from ground.resources.missions.value import Mission
from ground.resources.sols.create_sol import create_sol


def open_mission(repo: Repository, who: Actor, body: MissionCreate) -> Mission:
    """Return the new mission, with its first sol (and the demo's content where asked for)."""
    source: missions.TerrainSource
    seed = SEED
    match body.terrain:
        case DemoTerrain():
            source = demo_source()
        case GeneratedTerrain() as made:
            source, seed = missions.GeneratedTerrain(made.seed, made.size_m, made.rock_cover), made.seed
        case uploaded:
            source = missions.UploadedTerrain(uploaded.upload_id, uploaded.ortho_upload_id)
    mission = missions.create_mission(
        repo,
        who,
        name=body.name,
        source=source,
        notes=body.notes,
        rover_profile=body.rover_profile,
        place=body.place,
    )
    if body.demo_content:
        fill_with_demo(repo, who, mission.id, seed=seed)
    else:
        create_sol(repo, who, mission.id)
    opened: Mission = get_resource(repo, who, MISSION, mission.id)
    return opened
