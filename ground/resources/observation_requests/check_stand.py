"""Weigh a pose from which somebody wants a target observed."""

from __future__ import annotations

import math

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.gdr.geometry import Pose as PoseValue
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import find_row
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.keep_outs.rules import kept_clear
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import mission_terrain
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.observation_requests.value import StandCheck
from ground.resources.targets.row import TargetRow


def check_stand(
    repo: Repository,
    actor: Actor,
    request_id: str,
    east_m: float,
    north_m: float,
    heading_rad: float | None = None,
) -> StandCheck:
    """Return whether a request can be carried out from a pose, and why not.

    Without a heading the rover faces the target.

    Raises
    ------
    NotFoundError
        If there is no such request.
    """
    with repo.database.read() as session:
        request = find_row(session, OBSERVATION_REQUEST, request_id)
        actor.require(Action.READ, request.mission_id)
        target = session.get_one(TargetRow, request.target_id)
        if heading_rad is None:
            heading_rad = math.atan2(target.north_m - north_m, target.east_m - east_m)
        pose = PoseValue(east_m, north_m, heading_rad)
        return weigh_stand(repo, session, target, request.instrument, pose)


def weigh_stand(
    repo: Repository, session: Session, target: TargetRow, instrument: str, pose: PoseValue
) -> StandCheck:
    """Return whether an instrument gets at a target from a pose, by the rules of base placement."""
    from rover_iface.errors import RoverError
    from rover_iface.frames import Pose
    from rover_iface.placement import check_observation_point
    from rover_iface.profile import load_profile

    mission = session.get_one(MissionRow, target.mission_id)
    keep_outs = session.scalars(select(KeepOutRow).where(KeepOutRow.mission_id == mission.id))
    try:
        profile = load_profile(mission.rover_profile)
        found = check_observation_point(
            mission_terrain(repo, session, mission.id),
            profile,
            Pose(pose.east_m, pose.north_m, 0.0, pose.heading_rad),
            (target.east_m, target.north_m, target.up_m),
            target.normal,
            target=target.name,
            instrument=profile.instrument_key(instrument),
            keep_out=[kept_clear(k.polygon_m, k.sigma_m) for k in keep_outs],
        )
    except RoverError as err:
        return StandCheck(pose, False, str(err), None, None, None, None)
    return StandCheck(
        pose=pose,
        reachable=True,
        reason="",
        reach_m=found.reach_m,
        tool_tilt_rad=found.tool_tilt_rad,
        slope_rad=found.slope_rad,
        clearance_m=found.clearance_m,
    )
