"""File the demo mission: a terrain, a sol, ten targets, fourteen observation requests, two keep-outs."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from sqlalchemy import select

from ground.demo_mission import demo_mission
from ground.errors import TerrainFileError
from ground.gdr import models as m
from ground.gdr import values as v
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.services.actor import Actor
from ground.services.create_mission import FolderTerrain, GeneratedTerrain, TerrainSource, create_mission
from ground.services.create_sol import create_sol
from ground.services.edit import insert
from ground.services.get_resource import get_resource
from ground.services.kinds import KINDS
from ground.services.place_rover import place_rover
from ground.services.terrains import ground_at, mission_terrain
from ground.work.day import instrument_name

NAME = "Demo"
SEED = 7
SIZE_M = 64.0


def demo_source(terrain: Path | None = None, seed: int = SEED) -> TerrainSource:
    """Return the terrain of the demo: the folder named, else one generated from the seed."""
    return GeneratedTerrain(seed=seed, size_m=SIZE_M) if terrain is None else FolderTerrain(terrain)


def load_demo(
    repo: Repository, actor: Actor, *, name: str = NAME, terrain: Path | None = None, seed: int = SEED
) -> tuple[v.Mission, bool]:
    """Return the demo mission and whether it was made just now; one of the name that is there is left
    alone."""
    with repo.database.read() as session:
        found = session.scalars(select(m.MissionRow.id).where(m.MissionRow.name == name).limit(1)).first()
    if found is not None:
        return get_resource(repo, actor, "mission", found), False
    mission = create_mission(
        repo, actor, name=name, source=demo_source(terrain, seed), notes="The demo mission."
    )
    fill_with_demo(repo, actor, mission.id, seed=seed)
    return get_resource(repo, actor, "mission", mission.id), True


def fill_with_demo(repo: Repository, actor: Actor, mission_id: str, *, seed: int = SEED) -> None:
    """File the demo's sol, targets, requests and keep-outs in a mission.

    Raises
    ------
    TerrainFileError
        If the terrain has no ten targets that can be reached.
    """
    from rover_iface.profile import load_profile

    with repo.database.read() as session:
        terrain = mission_terrain(repo, session, mission_id)
        mission = session.get_one(m.MissionRow, mission_id)
        profile = load_profile(mission.rover_profile)
    try:
        day = demo_mission(terrain, profile, seed=seed)
    except ValueError as err:
        raise TerrainFileError(str(err), pointer="/terrain") from err
    start = v.Pose(day.limits.start.east_m, day.limits.start.north_m, day.limits.start.heading_rad)
    create_sol(
        repo,
        actor,
        mission_id,
        number=1,
        start_pose=start,
        time_budget_s=day.limits.time_s,
        energy_budget_j=day.limits.energy_j,
        overrun_penalty=day.limits.overrun_penalty,
    )
    with repo.database.write() as session:
        ids: dict[str, str] = {}
        rows: dict[str, m.TargetRow] = {}
        for target in day.targets:
            east, north, _ = target.point_site
            point = ground_at(terrain, east, north, start)
            row = m.TargetRow(
                id=new_id("tgt"),
                author=actor.name,
                mission_id=mission_id,
                name=target.name,
                east_m=east,
                north_m=north,
                up_m=point.up_m,
                normal=point.normal,
                slope_rad=point.slope_rad,
                covariance_m2=point.covariance_m2,
            )
            insert(session, actor, KINDS["target"], row)
            ids[target.id], rows[target.id] = row.id, row
        for request in day.requests:
            ids[request.id] = new_id("req")
        for request in day.requests:
            instrument = v.Instrument(instrument_name(request.instrument))
            pose = place_rover(repo, session, rows[request.target_id], instrument)
            insert(
                session,
                actor,
                KINDS["observation_request"],
                m.ObservationRequestRow(
                    id=ids[request.id],
                    author=actor.name,
                    mission_id=mission_id,
                    target_id=ids[request.target_id],
                    instrument=instrument.value,
                    value=request.value,
                    tracked=request.tracked,
                    window_s=None if request.window_s is None else list(request.window_s),
                    after=[ids[i] for i in request.after],
                    must_do=request.must_do,
                    dwell_s=request.dwell_s,
                    observation_point=None if pose is None else asdict(pose),
                    state=v.RequestState.OPEN.value,
                    state_reason="",
                ),
            )
        for number, keep_out in enumerate(day.keep_outs, 1):
            insert(
                session,
                actor,
                KINDS["keep_out"],
                m.KeepOutRow(
                    id=new_id("kpo"),
                    author=actor.name,
                    mission_id=mission_id,
                    name=f"Keep-out {number}",
                    polygon_m=[list(c) for c in keep_out.polygon_m],
                ),
            )
