"""Small moves of the base for a target that the arm does not reach from where the rover stands."""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator

import numpy as np

from rover_iface.behaviour.action import Step
from rover_iface.behaviour.driving import Driving
from rover_iface.behaviour.following import Followed
from rover_iface.behaviour.hardware import Hardware
from rover_iface.errors import PlacementError, TrackerError
from rover_iface.frames import Pose, wrap_angle
from rover_iface.placement.base_adjustment import base_move
from rover_iface.placement.cloud import cloud_of_points

MOVES, FARTHEST_MOVE_M, MOST_TURN_RAD = 2, 0.5, 0.8
"""How often, how far and with how much of a turn the rover moves without a look so that the arm reaches."""


class BaseMoves:
    """Moves the base where that helps, watching the target at the end of each move."""

    def __init__(self, hardware: Hardware, driving: Driving) -> None:
        self.hardware = hardware
        self.driving = driving

    def to(self, followed: Followed, pose: Pose) -> Generator[Step, None, bool]:
        """Move to a pose of the believed frame; False, and no move, if that is too far without a look.

        Raises
        ------
        TrackerError
            If the target is lost on the way.
        """
        here = self.hardware.believed
        if math.hypot(pose.x - here.x, pose.y - here.y) > FARTHEST_MOVE_M:
            return False
        if abs(wrap_angle(pose.heading - here.heading)) > MOST_TURN_RAD:
            return False
        yield from self.hardware.spend("handoff")
        yield from self.driving.shift(pose)
        if self.driving.follower.tracked(followed.target.id) is None:
            raise TrackerError(f"target {followed.target.id} was lost while the rover moved for it")
        return True

    def wanted(self, followed: Followed) -> Iterator[Pose]:
        """Yield poses from which the arm may reach a target: its stand, then one by the ground in sight."""
        stand = self.driving.stand(followed.target.id)
        if stand is not None:
            yield stand
        clouds = self.driving.sight.look(around=True)
        if not clouds:
            return
        here = self.hardware.believed.site_from_rover
        at = np.asarray(here.inverse().apply(followed.update.position), dtype=np.float64)
        try:
            move = base_move(cloud_of_points(np.concatenate(clouds)), self.hardware.profile, at, None)
        except PlacementError:
            return
        if not isinstance(move, str):
            yield Pose.from_transform(here * move.pose.site_from_rover)
