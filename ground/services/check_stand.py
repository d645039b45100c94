"""Weigh a pose from which somebody wants a target observed."""

from __future__ import annotations

import math

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import NotFoundError
from ground.gdr import values as v
from ground.gdr.models import KeepOutRow, MissionRow, ObservationRequestRow, TargetRow
from ground.gdr.repository import Repository
from ground.gdr.view_values import StandCheck
from ground.services.actor import Action, Actor
from ground.services.keep_clear import kept_clear
from ground.services.terrains import mission_terrain
from ground.work.day import INSTRUMENTS


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
        request = session.get(ObservationRequestRow, request_id)
        if request is None:
            raise NotFoundError(f"there is no observation request {request_id}")
        actor.require(Action.READ, request.mission_id)
        target = session.get_one(TargetRow, request.target_id)
        if heading_rad is None:
            heading_rad = math.atan2(target.north_m - north_m, target.east_m - east_m)
        pose = v.Pose(east_m, north_m, heading_rad)
        return weigh_stand(repo, session, target, v.Instrument(request.instrument), pose)


def weigh_stand(
    repo: Repository, session: Session, target: TargetRow, instrument: v.Instrument, pose: v.Pose
) -> StandCheck:
    """Return whether an instrument gets at a target from a pose, by the rules of base placement."""
    from rover_iface.errors import RoverError
    from rover_iface.frames import Pose
    from rover_iface.placement import check_observation_point
    from rover_iface.profile import load_profile

    mission = session.get_one(MissionRow, target.mission_id)
    keep_outs = session.scalars(select(KeepOutRow).where(KeepOutRow.mission_id == mission.id))
    try:
        found = check_observation_point(
            mission_terrain(repo, session, mission.id),
            load_profile(mission.rover_profile),
            Pose(pose.east_m, pose.north_m, 0.0, pose.heading_rad),
            (target.east_m, target.north_m, target.up_m),
            target.normal,
            target=target.name,
            instrument=INSTRUMENTS[instrument.value],
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
