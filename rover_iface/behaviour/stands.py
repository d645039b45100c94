"""Where the rover is to stand for each target: as planned, or elsewhere where the ground forbids it."""

from __future__ import annotations

import math
from collections.abc import Generator

import numpy as np

from rover_iface.behaviour.action import Step
from rover_iface.behaviour.following import TargetFollower
from rover_iface.behaviour.hardware import Hardware
from rover_iface.behaviour.sight import Sight
from rover_iface.behaviour.surroundings import look_round
from rover_iface.cameras.model import Array
from rover_iface.frames import Pose
from rover_iface.navigation.navigator import Navigator
from rover_iface.placement.base_adjustment import HALF_M, stands_near

LOOK_FROM_M = HALF_M - 1.5
"""Distance from a stand at which the ground round its target lies within what is made of one look."""
CHOICES = 2
"""How often in a drive another stand is chosen: the second where the first proves closed from near."""
APART_M = 0.3
"""Another stand is so far from the one that was not come to."""


class Stands:
    """Stands of targets in the believed frame."""

    def __init__(self, hardware: Hardware, sight: Sight, follower: TargetFollower) -> None:
        self.hardware = hardware
        self.sight = sight
        self.follower = follower
        self._chosen: dict[str, Pose] = {}
        self._left = CHOICES

    def of(self, name: str) -> Pose | None:
        """Return a target's stand, laid out from where the target is believed to be; None if it has none."""
        stand = self._chosen.get(name) or self.follower.targets[name].observation_point
        if stand is None:
            return None
        by = self._shift(name)
        return Pose(stand.x + float(by[0]), stand.y + float(by[1]), heading=stand.heading)

    def _shift(self, name: str) -> Array:
        """Return how far (2,), m, a target is believed to lie from where it was designated."""
        designated = np.array(self.follower.targets[name].point[:2])
        return np.asarray(self.follower.position(name)[:2], dtype=np.float64) - designated

    def begin(self) -> None:
        """Begin a drive."""
        self._left = CHOICES

    def closed(self, name: str, navigator: Navigator) -> bool:
        """Return whether what is mapped by now forbids the stand of a target that is near enough to tell."""
        stand, here = self.of(name), self.hardware.believed
        return (
            stand is not None
            and self._left > 0
            and math.hypot(stand.x - here.x, stand.y - here.y) <= LOOK_FROM_M
            and navigator.closed(navigator.where(stand))
        )

    def choose(self, name: str, navigator: Navigator) -> Generator[Step, None, bool]:
        """Look round, and choose another stand from which the arm reaches a target.

        Returns whether there is one. The nearest by the way to it, of those that nothing mapped forbids.
        """
        stand, here = self.of(name), self.hardware.believed
        if stand is None or not self._left or math.hypot(stand.x - here.x, stand.y - here.y) > LOOK_FROM_M:
            return False
        self._left -= 1
        target, position = self.follower.targets[name], self.follower.position(name)
        seen = yield from look_round(self.hardware, self.sight, target, position)
        if seen is None:
            return False
        for near in stands_near(seen.cloud, self.hardware.profile, seen.point, seen.normal):
            pose = seen.in_site(near)
            apart = math.hypot(pose.x - stand.x, pose.y - stand.y) >= APART_M
            if apart and not navigator.closed(navigator.where(pose)):
                by = self._shift(name)
                self._chosen[name] = Pose(pose.x - float(by[0]), pose.y - float(by[1]), heading=pose.heading)
                return True
        return False
