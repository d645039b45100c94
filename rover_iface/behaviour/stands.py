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
"""Distance from a stand or a target at which the ground round that lies within what is made of one look."""
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
        self._noted: dict[str, list[Pose]] = {}
        self._left = CHOICES

    def of(self, name: str) -> Pose | None:
        """Return a target's stand, laid out from where the target is believed to be; None if it has none."""
        stand = self._chosen.get(name) or self.follower.targets[name].observation_point
        return None if stand is None else self._laid(stand, name)

    def _laid(self, stand: Pose, name: str) -> Pose:
        """Return a stand laid out from where a target is believed to be."""
        by = self._shift(name)
        return Pose(stand.x + float(by[0]), stand.y + float(by[1]), heading=stand.heading)

    def _shift(self, name: str) -> Array:
        """Return how far (2,), m, a target is believed to lie from where it was designated."""
        designated = np.array(self.follower.targets[name].point[:2])
        return np.asarray(self.follower.position(name)[:2], dtype=np.float64) - designated

    def begin(self) -> None:
        """Begin a drive."""
        self._left = CHOICES
        self._noted.clear()

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

        Returns whether there is one. The nearest by the way to it, of those that nothing mapped forbids; far
        from the target, of those that were noted on the way.
        """
        stand = self.of(name)
        near = self._near(name)
        if stand is None or not self._left or not (near or self._noted.get(name)):
            return False
        self._left -= 1
        if near:
            others = yield from self._around(name)
        else:
            # back to them once: a drive that fails again has used up its time
            others, self._noted[name] = self._noted[name], []
        for other in others:
            pose = self._laid(other, name)
            apart = math.hypot(pose.x - stand.x, pose.y - stand.y) >= APART_M
            if apart and not navigator.closed(navigator.where(pose)):
                self._chosen[name] = other
                return True
        return False

    def note(self, name: str) -> Generator[Step, None, None]:
        """Look round once a drive for stands near a target that the rover has before it: a way round to the
        planned one may lead far off, and to nothing.
        """
        if name not in self._noted and self._near(name):
            self._noted[name] = yield from self._around(name)

    def _near(self, name: str) -> bool:
        """Return whether one look shows the ground round a target or its stand.

        A stand behind a ledge is farther off than the target that the rover has before it.
        """
        here, position = self.hardware.believed, self.follower.position(name)
        places = [(float(position[0]), float(position[1]))]
        stand = self.of(name)
        if stand is not None:
            places.append((stand.x, stand.y))
        return min(math.hypot(x - here.x, y - here.y) for x, y in places) <= LOOK_FROM_M

    def _around(self, name: str) -> Generator[Step, None, list[Pose]]:
        """Look round, and return the stands from which the arm reaches a target, the nearest by the way to it
        first, as they would be had the target been designated right.
        """
        target, position = self.follower.targets[name], self.follower.position(name)
        seen = yield from look_round(self.hardware, self.sight, target, position)
        if seen is None:
            return []
        by = self._shift(name)
        poses = map(seen.in_site, stands_near(seen.cloud, self.hardware.profile, seen.point, seen.normal))
        return [Pose(p.x - float(by[0]), p.y - float(by[1]), heading=p.heading) for p in poses]
