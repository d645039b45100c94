"""Kinematics of the arm: waist yaw, shoulder pitch, elbow pitch, forearm twist, wrist pitch.

K9's manipulator (single-cycle instrument placement paper, section 3): five joints give it "arbitrary
x-y-z-pitch-yaw control", that is a point and the direction of the tool, which is just what a contact
instrument needs. Twist and wrist meet in one point, so the inverse is in closed form: the wrist lies one tool
length above the surface, waist, shoulder and elbow carry it there in up to four ways, twist and wrist turn
the tool in two.

All in the rover frame (x forward, y left, z up). With all joints at zero the arm points straight ahead;
pitches are positive downwards (REP 103), waist and twist to the left.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from rover_iface.errors import PlacementError
from rover_iface.frames import Transform
from rover_iface.profile import Arm as ArmProfile

Array = npt.NDArray[np.float64]

JOINTS = ("waist", "shoulder", "elbow", "twist", "wrist")
BRANCHES = 8
_TINY = 1e-9


class ArmLimit(StrEnum):
    """What keeps the arm from a placement."""

    REACH = "reach"
    TOO_CLOSE = "too close"
    JOINT = "joint limit"
    TOOL_ANGLE = "tool angle"
    COLLISION = "collision"


@dataclass(frozen=True, slots=True)
class ArmRefusal:
    """Why the arm cannot do what was asked, with figures."""

    limit: ArmLimit
    reason: str


@dataclass(frozen=True, eq=False)
class Postures:
    """All ways to bring the tool to poses.

    Attributes
    ----------
    joints
        (..., 8, 5), radians; NaN where the wrist is out of reach.
    allowed
        (..., 8), whether all joints are within their limits.
    excess_rad
        (..., 8, 5), how far each joint is beyond its limits.
    wrist_m
        (...,), distance from the shoulder to the wrist that the poses need.
    """

    joints: Array
    allowed: npt.NDArray[np.bool_]
    excess_rad: Array
    wrist_m: Array


@dataclass(frozen=True, eq=False)
class Posture:
    """Joint angles (5,) that put the tool on a point, and the angle left between tool and normal."""

    joints: Array
    tool_tilt_rad: float


@dataclass(frozen=True)
class Arm:
    """Forward and inverse kinematics of one arm. Angles in radians, places in the rover frame, metres."""

    profile: ArmProfile

    @property
    def shoulder(self) -> Array:
        """Return where waist and shoulder axes cross (3,)."""
        return np.array(self.profile.shoulder_m)

    @property
    def limits(self) -> Array:
        """Return least and largest angle of each joint (5, 2)."""
        return np.array(self.profile.joint_limits_rad)

    def joint_places(self, joints: npt.ArrayLike) -> Array:
        """Return shoulder, elbow, wrist and tip (..., 4, 3), rover frame, m, of postures (..., 5), rad."""
        q = np.asarray(joints, dtype=np.float64)
        upper, fore, tool = self.profile.links_m
        around = _level(q[..., 0])
        elbow = self.shoulder + upper * _pitched(around, q[..., 1])
        wrist = elbow + fore * _pitched(around, q[..., 1] + q[..., 2])
        tip = wrist + tool * self.tool_axis(q)
        return np.stack((np.broadcast_to(self.shoulder, tip.shape), elbow, wrist, tip), axis=-2)

    def tool_axis(self, joints: npt.ArrayLike) -> Array:
        """Return the unit vector (..., 3) from wrist to tool tip in postures (..., 5), rad, rover frame."""
        return self.rover_from_tool(joints)[..., 0]

    def rover_from_tool(self, joints: npt.ArrayLike) -> Array:
        """Return rotations (..., 3, 3) of the tool frame in postures (..., 5), rad, whose x axis points out
        of the tool.
        """
        q = np.asarray(joints, dtype=np.float64)
        return _forearm(q) @ _turn(0, q[..., 3]) @ _turn(1, q[..., 4])

    def forward(self, joints: npt.ArrayLike) -> tuple[Array, Array]:
        """Return tips (..., 3), m, and unit tool axes (..., 3) of postures (..., 5), rad; rover frame."""
        return self.joint_places(joints)[..., 3, :], self.tool_axis(joints)

    def tool_pose(self, joints: npt.ArrayLike) -> Transform:
        """Return `rover_from_tool` of one posture (5,), rad, the origin at the tool tip."""
        return Transform(self.rover_from_tool(joints), self.forward(joints)[0])

    def inverse(self, points: npt.ArrayLike, axes: npt.ArrayLike) -> Postures:
        """Return all postures, rad, that put the tip on points (..., 3), rover frame, m, with the tool along
        unit axes (..., 3).

        The order of the eight: waist towards the wrist or away from it, elbow up or down, wrist bent one way
        or the other.
        """
        point, axis = np.broadcast_arrays(
            np.asarray(points, dtype=np.float64), np.asarray(axes, dtype=np.float64)
        )
        upper, fore, tool = self.profile.links_m
        away = point - tool * axis - self.shoulder
        level = np.hypot(away[..., 0], away[..., 1])
        wrist_m = np.linalg.norm(away, axis=-1)
        cosine = (wrist_m**2 - upper**2 - fore**2) / (2.0 * upper * fore)
        bend = np.arccos(np.where(np.abs(cosine) <= 1.0 + _TINY, np.clip(cosine, -1.0, 1.0), np.nan))
        yaw = np.where(level > _TINY, np.arctan2(away[..., 1], away[..., 0]), 0.0)
        out = np.empty((*point.shape[:-1], BRANCHES, 5))
        number = 0
        for back in (False, True):
            waist = _wrapped(yaw + math.pi) if back else yaw
            across = -level if back else level
            for elbow in (bend, -bend):
                reach = np.arctan2(fore * np.sin(elbow), upper + fore * np.cos(elbow))
                shoulder = _wrapped(np.arctan2(-away[..., 2], across) - reach)
                q = np.stack((waist, shoulder, elbow), axis=-1)
                local = np.einsum("...ji,...j->...i", _forearm(q), axis)
                bent = np.arctan2(np.hypot(local[..., 1], local[..., 2]), local[..., 0])
                straight = np.sin(bent) < 1e-7
                for wrist in (bent, -bent):
                    sign = np.where(wrist < 0, -1.0, 1.0)
                    twist = np.arctan2(sign * local[..., 1], -sign * local[..., 2])
                    out[..., number, :3] = q
                    out[..., number, 3] = np.where(straight, 0.0, twist)
                    out[..., number, 4] = wrist
                    number += 1
        limits = self.limits
        with np.errstate(invalid="ignore"):
            excess = np.maximum(0.0, np.maximum(limits[:, 0] - out, out - limits[:, 1]))
            allowed = np.asarray((excess <= _TINY).all(axis=-1))
        return Postures(out, allowed, excess, wrist_m)

    def solve(
        self,
        point: npt.ArrayLike,
        normal: npt.ArrayLike,
        *,
        near: npt.ArrayLike | None = None,
        max_tilt_rad: float | None = None,
    ) -> Posture | ArmRefusal:
        """Return the posture (5,), rad, that puts the tool on a surface point (3,) along its outward normal
        (3,); rover frame, m.

        Of those that are allowed, the one that moves the joints least from `near` (5,; the stowed posture
        when absent). Where the normal itself is out of reach the tool is tilted off it, as little as possible
        and at most `max_tilt_rad` (the profile's when absent).

        Raises
        ------
        PlacementError
            If point or normal are not three numbers, or the normal is zero.
        """
        at, up = _three(point, "point"), _three(normal, "normal")
        length = float(np.linalg.norm(up))
        if length < _TINY:
            raise PlacementError("the surface normal is (0, 0, 0); it has no direction")
        most = self.profile.max_tool_tilt_rad if max_tilt_rad is None else max_tilt_rad
        start = np.array(self.profile.stow_rad if near is None else near, dtype=np.float64)
        tilts, offsets = _cone(round(most, 4))
        axes = -(offsets @ _basis(up / length))
        found = self.inverse(at, axes)
        usable = found.allowed
        if not usable.any():
            return self._refusal(found, tilts)
        ring = float(tilts[usable.any(axis=-1)].min())
        moves = np.abs(found.joints - start).max(axis=-1)
        moves = np.where(usable & (tilts == ring)[:, None], moves, np.inf)
        k, branch = np.unravel_index(int(np.argmin(moves)), moves.shape)
        return Posture(found.joints[k, branch].copy(), ring)

    def least_tilt(
        self, points: npt.ArrayLike, normals: npt.ArrayLike, *, max_tilt_rad: float | None = None
    ) -> Array:
        """Return (n,) the angle that `solve` leaves between tool and normal at each of many places, rad;
        infinity where the arm does not hold it within `max_tilt_rad` (the profile's when absent).

        Surface points (n, 3), m, and outward unit normals (n, 3) in the rover frame.
        """
        at, up = (np.asarray(v, dtype=np.float64).reshape(-1, 3) for v in (points, normals))
        most = self.profile.max_tool_tilt_rad if max_tilt_rad is None else max_tilt_rad
        tilts, offsets = _cone(round(most, 4))
        least = np.full(len(at), np.inf)
        left = np.flatnonzero(self._within(at, up, most))
        for ring in np.unique(tilts):
            if not len(left):
                break
            axes = -(offsets[tilts == ring] @ np.array([_basis(normal) for normal in up[left]]))
            held = self.inverse(at[left, None], axes).allowed.any(axis=(1, 2))
            least[left[held]] = ring
            left = left[~held]
        return least

    def _within(self, at: Array, up: Array, tilt_rad: float) -> npt.NDArray[np.bool_]:
        """Return whether upper arm and forearm together are long enough for points (n, 3) with the tool
        within an angle of normals (n, 3).
        """
        upper, fore, tool = self.profile.links_m
        home = self.shoulder - at
        far = np.linalg.norm(home, axis=1)
        cosine = np.einsum("ni,ni->n", home, up) / np.maximum(far, _TINY)
        turn = np.maximum(0.0, np.arccos(np.clip(cosine, -1.0, 1.0)) - tilt_rad)
        nearest = np.sqrt(np.maximum(0.0, far**2 + tool**2 - 2.0 * far * tool * np.cos(turn)))
        return np.asarray(nearest <= upper + fore + 1e-6)

    def _refusal(self, found: Postures, tilts: Array) -> ArmRefusal:
        """Return what limits most: nothing of the cone around the normal can be reached."""
        upper, fore, _ = self.profile.links_m
        straight = float(found.wrist_m[0])
        reachable = np.isfinite(found.joints).all(axis=-1)
        tilted = math.degrees(float(tilts.max()))
        if not reachable.any():
            if straight > upper + fore:
                near = float(found.wrist_m.min())
                return ArmRefusal(
                    ArmLimit.REACH,
                    f"the wrist would have to be {straight:.2f} m from the shoulder "
                    f"({near:.2f} m with the tool tilted {tilted:.0f} degrees); "
                    f"it reaches {upper + fore:.2f} m",
                )
            return ArmRefusal(
                ArmLimit.TOO_CLOSE,
                f"the wrist would be {straight:.2f} m from the shoulder; "
                f"it comes no nearer than {abs(upper - fore):.2f} m",
            )
        worst = np.where(reachable, found.excess_rad.max(axis=-1), np.inf)
        k, branch = np.unravel_index(int(np.argmin(worst)), worst.shape)
        joint = int(np.argmax(found.excess_rad[k, branch]))
        angle = math.degrees(float(found.joints[k, branch, joint]))
        low, high = (math.degrees(v) for v in self.limits[joint])
        limit = ArmLimit.TOOL_ANGLE if joint >= 3 else ArmLimit.JOINT
        return ArmRefusal(
            limit,
            f"the {JOINTS[joint]} would stand at {angle:.0f} degrees at best, with the tool tilted up to "
            f"{tilted:.0f} degrees off the normal; it turns from {low:.0f} to {high:.0f}",
        )


def _three(values: npt.ArrayLike, what: str) -> Array:
    found = np.asarray(values, dtype=np.float64)
    if found.shape != (3,) or not np.isfinite(found).all():
        raise PlacementError(f"the {what} of a placement is {found.tolist()}; three numbers are needed")
    return found


def _wrapped(angle: Array) -> Array:
    return np.asarray((angle + math.pi) % (2.0 * math.pi) - math.pi)


def _level(yaw: Array) -> Array:
    return np.stack((np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)), axis=-1)


def _pitched(around: Array, pitch: Array) -> Array:
    """Return level directions (..., 3) pitched down."""
    out = np.cos(pitch)[..., None] * around
    out[..., 2] -= np.sin(pitch)
    return np.asarray(out)


def _turn(axis: int, angle: Array) -> Array:
    """Return rotations (..., 3, 3) about one axis."""
    c, s = np.cos(angle), np.sin(angle)
    out = np.zeros((*np.shape(angle), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out[..., axis, axis] = 1.0
    out[..., i, i], out[..., i, j], out[..., j, i], out[..., j, j] = c, -s, s, c
    return out


def _forearm(q: Array) -> Array:
    """Return rotations (..., 3, 3) of the forearm frame by waist, shoulder and elbow."""
    return _turn(2, q[..., 0]) @ _turn(1, q[..., 1] + q[..., 2])


def _basis(up: Array) -> Array:
    """Return rows (3, 3): two directions across a unit vector, and the vector."""
    side = np.cross(up, (0.0, 0.0, 1.0) if abs(up[2]) < 0.9 else (1.0, 0.0, 0.0))
    side /= np.linalg.norm(side)
    return np.stack((side, np.cross(up, side), up))


@lru_cache(maxsize=8)
def _cone(most: float) -> tuple[Array, Array]:
    """Return tilts (n,) and unit vectors (n, 3) about the z axis, every 2 degrees of tilt, the axis first."""
    tilts, vectors = [0.0], [(0.0, 0.0, 1.0)]
    for tilt in np.arange(1, int(math.degrees(most) / 2.0 + 1e-6) + 1) * math.radians(2.0):
        for turn in np.linspace(0.0, math.tau, 16, endpoint=False):
            tilts.append(float(tilt))
            vectors.append((math.sin(tilt) * math.cos(turn), math.sin(tilt) * math.sin(turn), math.cos(tilt)))
    return np.array(tilts), np.array(vectors)
