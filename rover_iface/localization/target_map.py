"""Where the rover stands among its targets: the drive and every look at any of them, in one filter.

A look from ten metres has a target's direction to a centimetre and its range to decimetres, and dead
reckoning does not know of a slip. Together they know more: what is off between two looks at one target is
off for all of them. So a target that is out of sight stays known as long as others are followed, and a match
that puts a target where neither the drive nor the others have it is another stone. The filter is the
stochastic map of Smith, Self and Cheeseman (1990), an extended Kalman filter over the rover's place and
heading, its slip and the places of all targets.
"""

from __future__ import annotations

import math

import numpy as np

from rover_iface.cameras.model import Array
from rover_iface.frames import Pose, wrap_angle

SLIP, SLIDE = 0.05, 0.03
"""Error of a way along it and across, as shares of its length (one standard deviation), by itself."""
SLOPE_SLIP, SLOPE_SLIDE, ALIKE_M = 0.10, 0.05, 3.0
"""The part of it that ways have in common, as the wheels do not know of the slip on a slope, and how far
the rover goes until the slope is another. A day looked at (299656722) was 10 % off over 17 m. A slope draws
one way wherever the wheels go: from one way to the next, turned by over 2.5 rad (479 pairs on 120 looked-at
days), slips correlate by -0.69, and differ by 0.20 (root mean square), by 0.08 once turned with the way;
within 1.3 to 1.9 rad by 0.15 and 0.09."""
TURN_RAD = 0.003
"""Error of the heading after a way: that of the gyroscope in a turn of 90 degrees."""
SETTLED_M, OTHER_GROUND_M, WHEELS_M = 0.008, 0.3, 0.5
"""Error of the height once the wheels have come to stand on other ground, how far they roll until it is,
and how far they stand from the middle of a turn. Dead reckoning takes a turn on the spot to change no
height: of 916 on 120 looked-at days those by less than 0.1 rad left 0.7 mm (root mean square), those by 0.1
to 0.3 3.6, by 0.3 to 0.5 6.2, by more 7.4, and 27 at most. Ways of 5 to 20 cm err by 4 to 7 mm, of which
`SLIDE` has 3 to 5."""
ALIKE = 2.0
"""Factor on the variance of a look: half of its error is that of the look before, as the template is."""
CONTRADICTS = 18.47
"""Squared distance, in deviations, of a place and heading from those of the map, over which one of both is
wrong: 99.9 % of chi square with four degrees of freedom."""

_PLACE, _WAY = 10, 6
"""Numbers of the state that are the rover's: place, heading, slip along and across a way (`_WAY` in all), and
place and heading before the last way.
"""


class TargetMap:
    """The rover's place and slip and the places of its targets, with all their covariances.

    Places are given and answered in the believed site frame, as dead reckoning has it at that moment.
    `pointing_rad` is the error of a direction that the mast looks in (one standard deviation), and
    `drift_rad_m` that of the heading after a metre, which grows with the root of the way.
    """

    def __init__(self, pointing_rad: float, drift_rad_m: float) -> None:
        self.pointing_rad = pointing_rad
        self.drift_rad_m = drift_rad_m
        self._at: Pose | None = None
        self._before: Pose | None = None
        self._direction = 0.0
        self._names: list[str] = []
        self._state = np.zeros(_PLACE)
        self._covariance = np.diag([0.0] * 4 + [SLOPE_SLIP**2, SLOPE_SLIDE**2] + [0.0] * 4)

    def __contains__(self, target: str) -> bool:
        return target in self._names

    def move(self, believed: Pose) -> None:
        """Take where dead reckoning has the rover now."""
        before, self._at = self._at, believed
        if before is None:
            self._state[:4] = believed.x, believed.y, believed.z, believed.heading
            return
        step = _turn(-before.heading) @ (
            believed.x - before.x, believed.y - before.y, believed.z - before.z
        )  # fmt: skip
        turned = wrap_angle(believed.heading - before.heading)
        way = math.hypot(step[0], step[1])
        if way == 0.0 and turned == 0.0:
            return
        self._before = before
        if way:
            self._turn_slip(math.atan2(believed.y - before.y, believed.x - before.x))
        heading, slip, slide = self._state[3:_WAY]
        aside = np.array([-step[1], step[0], 0.0])
        truly = (1.0 + slip) * step + slide * aside
        alike = math.exp(-way / ALIKE_M)
        change = np.eye(len(self._state))
        change[:3, 3] = _turn_by(heading) @ truly
        change[:3, 4], change[:3, 5] = _turn(heading) @ step, _turn(heading) @ aside
        change[4, 4] = change[5, 5] = alike
        change[_WAY:_PLACE] = 0.0
        change[_WAY:_PLACE, :4] = np.eye(4)
        self._state[_WAY:_PLACE] = self._state[:4]
        self._state[:3] += _turn(heading) @ truly
        self._state[3] += turned
        self._state[4:_WAY] *= alike
        noise = np.zeros((_WAY, _WAY))
        along = _turn(math.atan2(step[1], step[0])) @ np.diag([SLIP * way, SLIDE * way, SLIDE * way])
        in_site = _turn(heading) @ along
        noise[:3, :3] = in_site @ in_site.T
        rolled = way + WHEELS_M * abs(turned)
        noise[2, 2] += (SETTLED_M * min(1.0, rolled / OTHER_GROUND_M)) ** 2
        noise[3, 3] = TURN_RAD**2 + self.drift_rad_m**2 * way
        noise[4, 4] = (1.0 - alike**2) * SLOPE_SLIP**2
        noise[5, 5] = (1.0 - alike**2) * SLOPE_SLIDE**2
        self._covariance = change @ self._covariance @ change.T
        self._covariance[:_WAY, :_WAY] += noise

    def _turn_slip(self, direction: float) -> None:
        """Take slip along and across the last way for those along and across one in another direction, rad,
        believed site frame: the slope draws as before.
        """
        change = np.eye(len(self._state))
        change[4:_WAY, 4:_WAY] = _turn(self._direction - direction)[:2, :2]
        self._direction = direction
        self._state = change @ self._state
        self._covariance = change @ self._covariance @ change.T

    def see(self, target: str, position: Array, covariance: Array) -> None:
        """Take a look at a target: its place (3,), m, and the covariance (3, 3), m^2, relative to the eye.

        Raises
        ------
        RuntimeError
            If the rover's place was never told.
        """
        here = self._here()
        back = _turn(-here.heading)
        seen = back @ (position - (here.x, here.y, here.z))
        noise = back @ (ALIKE * covariance + self._askew(position)) @ back.T
        heading = float(self._state[3])
        if target not in self._names:
            self._begin(target, seen, noise)
            return
        at = self._slot(target)
        apart = self._state[at] - self._state[:3]
        slope = self._slope(at, apart)
        self._learn(slope, seen - _turn(-heading) @ apart, noise)

    def _learn(self, slope: Array, gap: Array, noise: Array) -> None:
        """Take a measurement that is off by a gap (k,): its derivative (k, state), its covariance (k, k)."""
        total = slope @ self._covariance @ slope.T + noise
        gain = np.linalg.solve(total, slope @ self._covariance).T
        self._state = self._state + gain @ gap
        kept = np.eye(len(self._state)) - gain @ slope
        self._covariance = kept @ self._covariance @ kept.T + gain @ noise @ gain.T

    @property
    def before(self) -> Pose | None:
        """Return where dead reckoning had the rover before the last way; None where there was none."""
        return self._before

    def came(self, where: Pose, covariance: Array) -> bool:
        """Take what looks from both its ends tell of the last way (Roumeliotis and Burdick 2002).

        Returns whether it was believed: looks that contradict the drive beyond chance may have been fitted to
        other ground than that which they show.

        Parameters
        ----------
        where
            Where it ended, in the believed site frame as that was when it began.
        covariance
            (4, 4) of that place, m, and heading, rad, relative to where it began.

        Raises
        ------
        RuntimeError
            If the rover has not moved.
        """
        before = self._before
        if before is None:
            raise RuntimeError("the rover has not moved: there is no way to tell of")
        back = np.eye(4)
        back[:3, :3] = _turn(-before.heading)
        step = _turn(-before.heading) @ (where.x - before.x, where.y - before.y, where.z - before.z)
        heading = float(self._state[_WAY + 3])
        into = _turn(-heading)
        apart = self._state[:3] - self._state[_WAY : _WAY + 3]
        slope = np.zeros((4, len(self._state)))
        slope[:3, :3], slope[:3, _WAY : _WAY + 3] = into, -into
        slope[:3, _WAY + 3] = -_turn_by(-heading) @ apart
        slope[3, 3], slope[3, _WAY + 3] = 1.0, -1.0
        turned = wrap_angle(where.heading - before.heading)
        gap = np.append(step - into @ apart, wrap_angle(turned - float(self._state[3] - heading)))
        noise = back @ covariance @ back.T
        if float(gap @ np.linalg.solve(slope @ self._covariance @ slope.T + noise, gap)) > CONTRADICTS:
            return False
        self._learn(slope, gap, noise)
        return True

    @property
    def rover(self) -> tuple[Array, Array]:
        """Return the rover's place, m, and heading, rad, in the map (4,), and their covariance (4, 4)."""
        return self._state[:4].copy(), self._covariance[:4, :4].copy()

    def found(self, believed: Pose, where: Pose, covariance: Array) -> None:
        """Take where pictures have the rover, whatever dead reckoning makes of its way since the last move.

        Parameters
        ----------
        believed
            Where dead reckoning has the rover now; the next way is counted from there.
        where
            Where it stands in the believed site frame as that was at the last move.
        covariance
            (4, 4) of that place, m, and heading, rad, relative to the last move.
        """
        before = self._here()
        heading = float(self._state[3])
        step = np.array((where.x - before.x, where.y - before.y, where.z - before.z))
        into_map = np.eye(4)
        into_map[:3, :3] = _turn(heading - before.heading)
        change = np.eye(len(self._state))
        change[:3, 3] = _turn_by(heading - before.heading) @ step
        self._state[:3] += into_map[:3, :3] @ step
        self._state[3] += wrap_angle(where.heading - before.heading)
        self._covariance = change @ self._covariance @ change.T
        self._covariance[:4, :4] += into_map @ covariance @ into_map.T
        self._direction += believed.heading - where.heading
        self._at, self._before = believed, None

    def lose(self, place_m: float, turn_rad: float) -> None:
        """Take that the rover may stand elsewhere and be turned, by so much (one standard deviation each).

        What looks make of its last way is not believed either.
        """
        self._before = None
        self._covariance[:4, :4] += np.diag([place_m**2, place_m**2, 0.0, turn_rad**2])

    def place(self, target: str) -> tuple[Array, Array]:
        """Return where a target should be seen from here (3,), m, and the covariance (3, 3), m^2, of that.

        Raises
        ------
        KeyError
            If it was never seen.
        """
        if target not in self._names:
            raise KeyError(target)
        here, at = self._here(), self._slot(target)
        apart = self._state[at] - self._state[:3]
        out = _turn(here.heading)
        position = np.array((here.x, here.y, here.z)) + out @ (_turn(-float(self._state[3])) @ apart)
        slope = out @ self._slope(at, apart)
        return position, slope @ self._covariance @ slope.T + self._askew(position)

    def forget(self, target: str) -> None:
        """Leave a target out from now on."""
        if target in self._names:
            at = self._slot(target)
            self._names.remove(target)
            self._state = np.delete(self._state, at)
            self._covariance = np.delete(np.delete(self._covariance, at, 0), at, 1)

    def _begin(self, target: str, seen: Array, noise: Array) -> None:
        heading, size = float(self._state[3]), len(self._state)
        out = _turn(heading)
        slope = np.zeros((3, size))
        slope[:, :3], slope[:, 3] = np.eye(3), _turn_by(heading) @ seen
        covariance = np.zeros((size + 3, size + 3))
        covariance[:size, :size] = self._covariance
        covariance[size:, :size] = slope @ self._covariance
        covariance[:size, size:] = covariance[size:, :size].T
        covariance[size:, size:] = slope @ self._covariance @ slope.T + out @ noise @ out.T
        self._names.append(target)
        self._state = np.concatenate((self._state, self._state[:3] + out @ seen))
        self._covariance = covariance

    def _slope(self, at: slice, apart: Array) -> Array:
        """Return the derivative (3, state) of a target's place in the rover's frame."""
        heading = float(self._state[3])
        back = _turn(-heading)
        slope = np.zeros((3, len(self._state)))
        slope[:, :3], slope[:, at] = -back, back
        slope[:, 3] = -_turn_by(-heading) @ apart
        return slope

    def _slot(self, target: str) -> slice:
        begin = _PLACE + 3 * self._names.index(target)
        return slice(begin, begin + 3)

    def _here(self) -> Pose:
        if self._at is None:
            raise RuntimeError("the rover's place was never told: call move first")
        return self._at

    def _askew(self, position: Array) -> Array:
        """Return the covariance (3, 3), m^2, of a place by the directions that the mast may be off."""
        here = self._here()
        ray = position - (here.x, here.y, here.z)
        return self.pointing_rad**2 * (float(ray @ ray) * np.eye(3) - np.outer(ray, ray))


def _turn(angle_rad: float) -> Array:
    """Return the rotation (3, 3) about the vertical."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _turn_by(angle_rad: float) -> Array:
    """Return the derivative (3, 3) of that by the angle."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[-s, -c, 0.0], [c, -s, 0.0], [0.0, 0.0, 0.0]])
