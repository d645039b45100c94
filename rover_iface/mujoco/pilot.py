"""A simple driver: it follows a path by pure pursuit, turns in place where it must, and gives up in time.

Pure pursuit steers along the circle through the rover and a point ahead on the path (Coulter 1992,
CMU-RI-TR-92-01). The driver knows the rover's pose exactly and sees nothing of the ground.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from rover_iface.behaviour.action import Doing, Route, Step
from rover_iface.frames import Pose, wrap_angle
from rover_iface.mujoco.options import PilotOptions
from rover_iface.mujoco.vehicle import Moved, Vehicle

TURNED_RAD = 0.1
"""A turn in place towards the path ends so near its direction."""

SLOW_M = 0.3
"""Within so far of the goal the rover slows down, to a third."""


@dataclass(slots=True)
class DriveLog:
    """What a drive has come to so far: metres and joules, and why it ended, empty if at its goal.

    `distance_m` is what the rover moved, `wheels_m` what the rims of its wheels did, turns included.
    """

    distance_m: float = 0.0
    wheels_m: float = 0.0
    energy_j: float = 0.0
    elapsed_s: float = 0.0
    left_m: float = 0.0
    reason: str = ""


@dataclass(frozen=True, slots=True)
class _Part:
    """One step of a drive, for the watch over its progress."""

    pose: Pose
    turned_rad: float
    moved: Moved


class Pilot:
    """Drives a vehicle. `speed_m_s` and `turn_rate_rad_s` are those it commands."""

    def __init__(self, vehicle: Vehicle, options: PilotOptions) -> None:
        self.vehicle, self.options = vehicle, options
        self.speed_m_s = vehicle.profile.mobility.speed_m_s
        self.turn_rate_rad_s = vehicle.profile.mobility.turn_rate_rad_s
        self._state = vehicle.state()
        self._controls: list[npt.NDArray[np.float64]] = []

    def follow(self, route: Route, heading_rad: float | None, log: DriveLog) -> Doing[None]:
        """Drive along a path of the site from where the rover is, and turn to a heading at its end.

        `log` is kept up to date; its reason tells a stall, wheels that slip, or the end of the time limit.
        """
        path = _Path(route, heading_rad, self)
        begin = self.vehicle.pose
        limit_s = self.options.patience * path.expected_s(begin) + self.options.patience_s
        window: deque[_Part] = deque([_Part(begin, 0.0, Moved(0.0, 0.0, 0.0))])
        commanded = 0.0
        while not log.reason:
            before = self.vehicle.pose
            done, ticks, moved = self._report(path)
            here = self.vehicle.pose
            if ticks:
                self._count(log, before, here, ticks, moved)
                yield Step(
                    round(1000 * ticks * self.options.tick_s),
                    self._energy_j(ticks, moved),
                    _chord(before, here),
                )
            log.left_m = path.left_m(here)
            if done:
                return
            window.append(_Part(here, wrap_angle(here.heading - before.heading), moved))
            commanded += moved.commanded_m
            log.reason = self._stuck(window, commanded)
            while commanded - window[0].moved.commanded_m > self.speed_m_s * self.options.window_s:
                commanded -= window.popleft().moved.commanded_m
            if not log.reason and log.elapsed_s > limit_s:
                log.reason = f"time limit of {limit_s:.0f} s: {log.left_m:.1f} m are left"

    def cut(self, after_s: float) -> None:
        """Stop as if the last step had been broken off so long after its begin."""
        self.vehicle.replay(self._state, self._controls, after_s, self.options.tick_s)
        self.stop()

    def stop(self) -> None:
        """Stand."""
        self.vehicle.command(0.0, 0.0)

    def _report(self, path: _Path) -> tuple[bool, int, Moved]:
        """Drive for one step; return whether the goal is reached, the ticks it took and what it came to."""
        self._state, self._controls = self.vehicle.state(), []
        work = wheels = commanded = 0.0
        for ticks in range(round(self.options.report_s / self.options.tick_s)):
            motion = path.motion(self.vehicle.pose)
            if motion is None:
                self.stop()
                return True, ticks, Moved(work, wheels, commanded)
            self.vehicle.command(*motion)
            self._controls.append(self.vehicle.data.ctrl.copy())
            moved = self.vehicle.advance(self.options.tick_s)
            work, wheels = work + moved.work_j, wheels + moved.wheels_m
            commanded += moved.commanded_m
        return False, len(self._controls), Moved(work, wheels, commanded)

    def _energy_j(self, ticks: int, moved: Moved) -> float:
        options = self.vehicle.options
        return moved.work_j / options.drive_efficiency + options.electronics_w * ticks * self.options.tick_s

    def _count(self, log: DriveLog, before: Pose, here: Pose, ticks: int, moved: Moved) -> None:
        log.distance_m += math.hypot(here.x - before.x, here.y - before.y)
        log.wheels_m += moved.wheels_m
        log.energy_j += self._energy_j(ticks, moved)
        log.elapsed_s += ticks * self.options.tick_s

    def _stuck(self, window: deque[_Part], commanded_m: float) -> str:
        """Return why the drive gets nowhere, or an empty string."""
        if commanded_m < self.speed_m_s * self.options.window_s:
            return ""
        first, last = window[0].pose, window[-1].pose
        turned = abs(sum(part.turned_rad for part in list(window)[1:]))
        moved = math.hypot(last.x - first.x, last.y - first.y)
        moved += turned * self.vehicle.profile.wheels.track_m / 2
        if moved >= self.options.least_share * commanded_m:
            return ""
        wheels = sum(part.moved.wheels_m for part in list(window)[1:])
        if wheels < commanded_m / 2:
            return (
                f"stalled: the wheels turned {wheels:.2f} m of {commanded_m:.2f} m, "
                f"their motors give {self.vehicle.torque_limit_nm:.1f} N m"
            )
        return f"wheels slip: they turned {wheels:.2f} m, the rover moved {moved:.2f} m"


class _Path:
    """The path of a drive: which motion leads along it from a pose."""

    def __init__(self, route: Route, heading_rad: float | None, pilot: Pilot) -> None:
        self.points = [(float(x), float(y)) for x, y in route]
        self.heading_rad = heading_rad
        self.pilot, self.options = pilot, pilot.options
        self.curvature_1_m = 1.0 / max(pilot.vehicle.profile.mobility.min_arc_radius_m, 0.1)
        self._segment = 0
        self._turning = False
        self._arrived = len(self.points) < 2

    def expected_s(self, pose: Pose) -> float:
        """Return how long the path takes by speed and turn rate alone."""
        length, turns, heading = 0.0, 0.0, pose.heading
        for a, b in pairwise(self.points):
            part = math.hypot(b[0] - a[0], b[1] - a[1])
            if part > 0:
                length += part
                way = math.atan2(b[1] - a[1], b[0] - a[0])
                turns += abs(wrap_angle(way - heading))
                heading = way
        if self.heading_rad is not None:
            turns += abs(wrap_angle(self.heading_rad - heading))
        return length / self.pilot.speed_m_s + turns / self.pilot.turn_rate_rad_s

    def left_m(self, pose: Pose) -> float:
        """Return the distance to the goal."""
        if not self.points:
            return 0.0
        return math.hypot(self.points[-1][0] - pose.x, self.points[-1][1] - pose.y)

    def motion(self, pose: Pose) -> tuple[float, float] | None:
        """Return the speed and turn rate that lead on, None at the end of the path."""
        if not self._arrived:
            point, passed = self._ahead(pose)
            left = self.left_m(pose)
            self._arrived = left <= self.options.arrived_m or (passed and left <= self.options.beside_m)
            if not self._arrived:
                return self._towards(pose, point, left)
        if self.heading_rad is None:
            return None
        off = wrap_angle(self.heading_rad - pose.heading)
        return None if abs(off) <= self.options.arrived_rad else (0.0, self._rate(off))

    def _rate(self, off_rad: float) -> float:
        rate = self.pilot.turn_rate_rad_s
        return math.copysign(min(rate, max(rate / 4, abs(off_rad))), off_rad)

    def _towards(self, pose: Pose, point: tuple[float, float], left_m: float) -> tuple[float, float]:
        away = math.hypot(point[0] - pose.x, point[1] - pose.y)
        off = wrap_angle(math.atan2(point[1] - pose.y, point[0] - pose.x) - pose.heading)
        if abs(off) > (TURNED_RAD if self._turning else self.options.turn_first_rad):
            self._turning = True
            return 0.0, self._rate(off)
        self._turning = False
        speed = self.pilot.speed_m_s * min(1.0, max(1 / 3, left_m / SLOW_M))
        bend = 2 * math.sin(off) / max(away, self.options.arrived_m)
        bend = max(-self.curvature_1_m, min(self.curvature_1_m, bend))
        return speed, speed * bend

    def _ahead(self, pose: Pose) -> tuple[tuple[float, float], bool]:
        """Return the point to steer for, and whether the rover is beyond the last segment's end."""
        while True:
            a, b = self.points[self._segment], self.points[self._segment + 1]
            dx, dy = b[0] - a[0], b[1] - a[1]
            length = math.hypot(dx, dy)
            along = ((pose.x - a[0]) * dx + (pose.y - a[1]) * dy) / length if length > 0 else 0.0
            last = self._segment == len(self.points) - 2
            if along < length - self.options.arrived_m or last:
                break
            self._segment += 1
        ahead = max(along, 0.0) + self.options.look_ahead_m
        for a, b in pairwise(self.points[self._segment :]):
            part = math.hypot(b[0] - a[0], b[1] - a[1])
            if ahead <= part and part > 0:
                share = ahead / part
                return (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])), False
            ahead -= part
        return self.points[-1], last and along >= length


def _chord(before: Pose, here: Pose) -> Route:
    """Return the way of a step; none where the rover hardly moved, whose direction means nothing."""
    moved = math.hypot(here.x - before.x, here.y - before.y)
    return ((before.x, before.y), (here.x, here.y)) if moved > 0.01 else ()
