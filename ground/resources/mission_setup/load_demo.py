"""File the demo mission: a terrain, a sol, ten targets, fourteen observation requests, two keep-outs."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from sqlalchemy import select

from ground.day.rovers import instrument_name, profile_of
from ground.demo.mission import demo_mission
from ground.errors import TerrainFileError
from ground.gdr.geometry import Pose
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.edit import insert, new_row
from ground.records.forms import PoseBody
from ground.records.get_resource import get_resource
from ground.resources.keep_outs.bodies import KeepOutCreate
from ground.resources.keep_outs.kind import KEEP_OUT
from ground.resources.mission_setup.create_mission import (
    FolderTerrain,
    GeneratedTerrain,
    TerrainSource,
    create_mission,
)
from ground.resources.missions.kind import MISSION
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import mission_terrain
from ground.resources.missions.value import Mission
from ground.resources.observation_requests.bodies import ObservationRequestCreate
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.observation_requests.place_rover import place_rover
from ground.resources.observation_requests.value import RequestState
from ground.resources.sols.bodies import SolCreate
from ground.resources.sols.create_sol import create_sol
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.kind import TARGET
from ground.resources.targets.row import TargetRow
from ground.resources.terrains.terrain import ground_at

NAME = "Demo"
SEED = 7
SIZE_M = 64.0


def demo_source(terrain: Path | None = None, seed: int = SEED) -> TerrainSource:
    """Return the terrain of the demo: the folder named, else one generated from the seed."""
    return GeneratedTerrain(seed=seed, size_m=SIZE_M) if terrain is None else FolderTerrain(terrain)


def load_demo(
    repo: Repository, actor: Actor, *, name: str = NAME, terrain: Path | None = None, seed: int = SEED
) -> tuple[Mission, bool]:
    """Return the demo mission and whether it was made just now; one of the name that is there is left
    alone.
    """
    with repo.database.read() as session:
        found = session.scalars(select(MissionRow.id).where(MissionRow.name == name).limit(1)).first()
    if found is not None:
        return get_resource(repo, actor, MISSION, found), False
    mission = create_mission(
        repo, actor, name=name, source=demo_source(terrain, seed), notes="The demo mission."
    )
    fill_with_demo(repo, actor, mission.id, seed=seed)
    return get_resource(repo, actor, MISSION, mission.id), True


def fill_with_demo(repo: Repository, actor: Actor, mission_id: str, *, seed: int = SEED) -> None:
    """File the demo's sol, targets, requests and keep-outs in a mission.

    Raises
    ------
    TerrainFileError
        If the terrain has no ten targets that can be reached.
    """
    with repo.database.read() as session:
        terrain = mission_terrain(repo, session, mission_id)
        mission = session.get_one(MissionRow, mission_id)
        profile = profile_of(mission.rover_profile)
    try:
        day = demo_mission(terrain, profile, seed=seed)
    except ValueError as err:
        raise TerrainFileError(str(err), pointer="/terrain") from err
    start = Pose(day.start.east_m, day.start.north_m, day.start.heading_rad)
    sol = SolCreate(
        number=1,
        start_pose=PoseBody(east_m=start.east_m, north_m=start.north_m, heading_rad=start.heading_rad),
        time_budget_s=day.limits.time_s,
        energy_budget_j=day.limits.energy_j,
        overrun_penalty=day.limits.overrun_penalty,
    )
    create_sol(repo, actor, mission_id, sol)
    with repo.database.write() as session:
        ids: dict[str, str] = {}
        rows: dict[str, TargetRow] = {}
        for target in day.targets:
            east, north, _ = target.point_site
            point = ground_at(terrain, east, north, start)
            row = new_row(
                TARGET,
                actor,
                mission_id,
                TargetCreate(name=target.name, east_m=east, north_m=north),
                up_m=point.up_m,
                normal=point.normal,
                slope_rad=point.slope_rad,
                covariance_m2=point.covariance_m2,
            )
            insert(session, actor, TARGET, row)
            ids[target.id], rows[target.id] = row.id, row
        ids |= {request.id: new_id(OBSERVATION_REQUEST.prefix) for request in day.requests}
        for request in day.requests:
            instrument = instrument_name(profile, request.instrument)
            window = request.window
            asked = ObservationRequestCreate(
                target_id=ids[request.target_id],
                instrument=instrument,
                value=request.value,
                tracked=request.tracked,
                window_s=None if window is None else [window.opens_s, window.closes_s],
                after=[ids[i] for i in request.after],
                must_do=request.must_do,
                dwell_s=request.dwell_s,
            )
            row = new_row(
                OBSERVATION_REQUEST,
                actor,
                mission_id,
                asked,
                id=ids[request.id],
                constraints=None,
                observation_point=asdict(place_rover(repo, session, rows[request.target_id], instrument)),
                state=RequestState.OPEN.value,
                state_reason="",
            )
            insert(session, actor, OBSERVATION_REQUEST, row)
        for number, keep_out in enumerate(day.keep_outs, 1):
            ring = KeepOutCreate(name=f"Keep-out {number}", polygon_m=[list(c) for c in keep_out.polygon_m])
            insert(session, actor, KEEP_OUT, new_row(KEEP_OUT, actor, mission_id, ring))
