"""Find the pose from which an instrument reaches a target."""

from __future__ import annotations

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.day.prepare import stand_for
from ground.errors import InvalidInputError, UnreachableError
from ground.gdr.geometry import Pose
from ground.gdr.repository import Repository
from ground.resources.keep_outs.row import KeepOutRow, day_keep_out
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import mission_terrain, terrain_row
from ground.resources.observation_requests.check_stand import weigh_stand
from ground.resources.observation_requests.value import ObservationPoint
from ground.resources.sols.row import SolRow
from ground.resources.targets.row import TargetRow, day_target
from mission import Pose as DayPose


def place_rover(
    repo: Repository,
    session: Session,
    target: TargetRow,
    instrument: str,
    manual: Pose | None = None,
) -> ObservationPoint:
    """Return the observation point of a target for an instrument, or why there is none.

    A pose set by hand takes the place of the program's choice and has to keep the same rules.

    Raises
    ------
    UnreachableError
        If the target cannot be observed from the pose set by hand.
    """
    from rover_iface.errors import RoverError
    from rover_iface.profile import load_profile

    if manual is not None:
        verdict = weigh_stand(repo, session, target, instrument, manual)
        if not verdict.reachable:
            raise UnreachableError(verdict.reason, pointer="/observation_pose")
        return ObservationPoint(pose=manual, reachable=True, manual=True, reason="")
    mission = session.get_one(MissionRow, target.mission_id)
    newest = session.scalars(
        select(SolRow).where(SolRow.mission_id == mission.id).order_by(SolRow.number.desc()).limit(1)
    ).first()
    start = (
        newest.start_pose
        if newest is not None
        else terrain_row(session, mission.id).description["start_pose"]
    )
    keep_outs = session.scalars(select(KeepOutRow).where(KeepOutRow.mission_id == mission.id))
    try:
        profile = load_profile(mission.rover_profile)
        stands = stand_for(
            mission_terrain(repo, session, mission.id),
            profile,
            DayPose(**start),
            day_target(target),
            profile.instrument_key(instrument),
            keep_outs=[day_keep_out(k) for k in keep_outs],
            count=1,
        )
    except RoverError as err:
        return ObservationPoint(pose=None, reachable=False, manual=False, reason=str(err))
    except InvalidInputError as err:
        return ObservationPoint(pose=None, reachable=False, manual=False, reason=err.message)
    best = stands[0]
    pose = Pose(best.east_m, best.north_m, best.heading_rad)
    return ObservationPoint(pose=pose, reachable=True, manual=False, reason="")
