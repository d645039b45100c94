"""Small moves of the base for a target that the arm does not reach from where the rover stands."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import replace

from rover_iface.behaviour.action import Step
from rover_iface.behaviour.driving import STUCK, Driving
from rover_iface.behaviour.following import Followed
from rover_iface.behaviour.hardware import Hardware
from rover_iface.behaviour.surroundings import look_round
from rover_iface.errors import PlacementError, TrackerError
from rover_iface.frames import Pose, wrap_angle
from rover_iface.placement.base_adjustment import FARTHEST_MOVE_M, MOST_TURN_RAD, base_move

MOVES = 2
"""How often the rover moves without a look so that the arm reaches or the mast sees other faces."""
REACHED_M = MOVES * FARTHEST_MOVE_M
"""How far the moves for the arm lead in all. Two of the first 36 targets of 12 looked-at days (306306749 T3,
325202762 T1), known to 4 mm, were refused 0.67 and 0.80 m from where the arm reaches them: the navigator had
come no nearer, and one move was too short."""


class BaseMoves:
    """Moves the base where that helps, watching the target at the end of each move."""

    def __init__(self, hardware: Hardware, driving: Driving) -> None:
        self.hardware = hardware
        self.driving = driving

    def to(self, followed: Followed, pose: Pose) -> Generator[Step, None, bool]:
        """Move to a pose of the believed frame, a part of the way if it is too far without a look.

        False, and no move, if the next ones do not lead there either. A move that ends at a hazard is one:
        from there the arm may reach.

        Raises
        ------
        PlacementError
            If a wheel is stuck.
        TrackerError
            If the target is lost on the way.
        """
        here = self.hardware.believed
        far_m = math.hypot(pose.x - here.x, pose.y - here.y)
        if far_m > REACHED_M:
            return False
        if far_m > FARTHEST_MOVE_M:
            share = FARTHEST_MOVE_M / far_m
            pose = replace(pose, x=here.x + share * (pose.x - here.x), y=here.y + share * (pose.y - here.y))
        if abs(wrap_angle(pose.heading - here.heading)) > MOST_TURN_RAD:
            return False
        yield from self.hardware.spend("handoff")
        if (yield from self.driving.shift(pose)) == STUCK:
            raise PlacementError(f"{STUCK} on the move for target {followed.target.id}")
        try:
            self.driving.follower.in_sight(followed.target.id)
        except TrackerError as err:
            raise TrackerError(f"{err}, since the rover moved for it") from err
        return True

    def nearer(self, followed: Followed, *, first: bool) -> Generator[Step, None, bool]:
        """Move to where the arm may reach a target: its stand at first, else by the ground in sight.

        Returns whether it moved; raises as `to` does.
        """
        stand = self.driving.stands.of(followed.target.id) if first else None
        if stand is not None and (yield from self.to(followed, stand)):
            return True
        for pose in (yield from self._by_the_ground(followed)):
            if (yield from self.to(followed, pose)):
                return True
        return False

    def _by_the_ground(self, followed: Followed) -> Generator[Step, None, list[Pose]]:
        """Look around, and return poses from which the arm reaches a target: first one that serves the face
        that was designated, then one that serves whatever face the ground in sight has.
        """
        target, position = followed.target, followed.update.position
        seen = yield from look_round(self.hardware, self.driving.sight, target, position)
        if seen is None:
            return []
        poses = []
        for face in (seen.normal, None):
            try:
                move = base_move(seen.cloud, self.hardware.profile, seen.point, face)
            except PlacementError:
                continue
            if not isinstance(move, str):
                poses.append(seen.in_site(move.pose))
        return poses
