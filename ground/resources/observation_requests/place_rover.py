"""Find the pose from which an instrument reaches a target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.day.prepare import stand_for
from ground.day.rovers import profile_of
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
from mission import KeepOut
from mission import Pose as DayPose

if TYPE_CHECKING:
    from rover_iface.profile import RoverProfile
    from rover_iface.terrain import Terrain


@dataclass(frozen=True, slots=True)
class Worksite:
    """What base placement needs to know of a mission, read once for any number of targets."""

    terrain: Terrain
    profile: RoverProfile
    start: DayPose
    keep_outs: Sequence[KeepOut]

    def stand(self, target: TargetRow, instrument: str) -> ObservationPoint:
        """Return the observation point of a target for an instrument, or why there is none."""
        from rover_iface.errors import RoverError

        try:
            stands = stand_for(
                self.terrain,
                self.profile,
                self.start,
                day_target(target),
                self.profile.instrument_key(instrument),
                keep_outs=self.keep_outs,
                count=1,
            )
        except RoverError as err:
            return _unreachable(str(err))
        except InvalidInputError as err:
            return _unreachable(err.message)
        best = stands[0]
        pose = Pose(best.east_m, best.north_m, best.heading_rad)
        return ObservationPoint(pose=pose, reachable=True, manual=False, reason="")


def worksite_of(repo: Repository, session: Session, mission_id: str) -> Worksite:
    """Return the worksite of a mission; the rover starts where it does on the newest sol.

    Raises
    ------
    InvalidInputError
        If the rover's profile cannot be used.
    """
    newest = session.scalars(
        select(SolRow).where(SolRow.mission_id == mission_id).order_by(SolRow.number.desc()).limit(1)
    ).first()
    start = (
        newest.start_pose
        if newest is not None
        else terrain_row(session, mission_id).description["start_pose"]
    )
    keep_outs = session.scalars(select(KeepOutRow).where(KeepOutRow.mission_id == mission_id))
    return Worksite(
        mission_terrain(repo, session, mission_id),
        profile_of(session.get_one(MissionRow, mission_id).rover_profile),
        DayPose(**start),
        [day_keep_out(k) for k in keep_outs],
    )


def stand_at(
    repo: Repository, session: Session, target: TargetRow, instrument: str, pose: Pose
) -> ObservationPoint:
    """Return an observation point that is set by hand; it has to keep the rules of the program's choice.

    Raises
    ------
    UnreachableError
        If the target cannot be observed from there.
    """
    verdict = weigh_stand(repo, session, target, instrument, pose)
    if not verdict.reachable:
        raise UnreachableError(verdict.reason, pointer="/observation_pose")
    return ObservationPoint(pose=pose, reachable=True, manual=True, reason="")


def place_rover(
    repo: Repository,
    session: Session,
    target: TargetRow,
    instrument: str,
    manual: Pose | None = None,
) -> ObservationPoint:
    """Return the observation point of a target for an instrument, or why there is none.

    A pose set by hand takes the place of the program's choice; raises as `stand_at` does.
    """
    if manual is not None:
        return stand_at(repo, session, target, instrument, manual)
    try:
        return worksite_of(repo, session, target.mission_id).stand(target, instrument)
    except InvalidInputError as err:
        return _unreachable(err.message)


def _unreachable(reason: str) -> ObservationPoint:
    return ObservationPoint(pose=None, reachable=False, manual=False, reason=reason)
