"""Poses and transforms. A transform is named by what it gives and what it takes, so neighbours cancel.

The site frame is east-north-up in metres, a body frame is x forward, y left, z up (REP 103), an `_optical`
frame is
z forward, x right, y down; all right-handed. Flight systems use a site frame north-east-nadir and a rover
frame
forward-right-down: `NED_FROM_ENU` and `FRD_FROM_FLU` are the way there and, being their own inverse up to a
transpose, the way back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_iface.errors import FrameError

Array = NDArray[np.floating]


def wrap_angle(angle_rad: float) -> float:
    """Return the same direction in (-pi, pi], rad."""
    wrapped = math.remainder(angle_rad, 2 * math.pi)
    return math.pi if wrapped == -math.pi else wrapped


@dataclass(frozen=True, eq=False)
class Transform:
    """Rigid motion: `a_from_b.apply(point_b)` is the same point in frame a.

    Parameters
    ----------
    rotation
        3x3, right-handed, orthonormal to 1e-6.
    translation
        3, origin of b in frame a, metres.
    """

    rotation: Array
    translation: Array

    def __post_init__(self) -> None:
        rotation = np.asarray(self.rotation, dtype=float)
        translation = np.asarray(self.translation, dtype=float)
        if rotation.shape != (3, 3) or translation.shape != (3,):
            raise FrameError(f"a transform takes 3x3 and 3, found {rotation.shape} and {translation.shape}")
        error = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
        if not error < 1e-6 or np.linalg.det(rotation) < 0:
            raise FrameError(
                f"matrix is not a rotation: R R^T differs from 1 by {error:.3g}; the limit is 1e-6"
            )
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", translation)

    @staticmethod
    def identity() -> Transform:
        """Return the motion that moves nothing."""
        return Transform(np.eye(3), np.zeros(3))

    @staticmethod
    def from_rpy(
        roll: float, pitch: float, yaw: float, translation: ArrayLike = (0.0, 0.0, 0.0)
    ) -> Transform:
        """Return the transform `site_from_body` of a body turned by yaw about z, then pitch about y, roll
        about x.

        Angles in rad; `translation` [3] is the body's origin in the site frame, m.
        """
        return Transform(rotation_rpy(roll, pitch, yaw), np.asarray(translation, dtype=float))

    def __mul__(self, other: Transform) -> Transform:
        return Transform(self.rotation @ other.rotation, self.rotation @ other.translation + self.translation)

    def inverse(self) -> Transform:
        """Return the way back: `b_from_a`."""
        return Transform(self.rotation.T, -self.rotation.T @ self.translation)

    def apply(self, points: ArrayLike) -> Array:
        """Return points [..., 3], m, in the other frame."""
        moved: Array = np.asarray(points, dtype=float) @ self.rotation.T + self.translation
        return moved

    def rotate(self, vectors: ArrayLike) -> Array:
        """Return directions [..., 3] in the other frame."""
        turned: Array = np.asarray(vectors, dtype=float) @ self.rotation.T
        return turned

    def covariance(self, covariance: ArrayLike) -> Array:
        """Return a covariance [3, 3], m^2, of a point expressed in the other frame."""
        turned: Array = self.rotation @ np.asarray(covariance, dtype=float) @ self.rotation.T
        return turned


def across(normal: ArrayLike) -> NDArray[np.float64]:
    """Return two unit vectors (2, 3) at right angles to a unit normal (3,) and to each other."""
    up = np.asarray(normal, dtype=np.float64)
    first = np.cross(up, np.eye(3)[int(np.abs(up).argmin())])
    first /= np.linalg.norm(first)
    return np.vstack((first, np.cross(up, first)))


def rotation_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Return Rz(yaw) Ry(pitch) Rx(roll) [3, 3], angles in rad; pitch up is negative (REP 103)."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_of(rotation: ArrayLike) -> tuple[float, float, float]:
    """Return roll, pitch, yaw, rad, of a rotation [3, 3], pitch in [-pi/2, pi/2]."""
    r = np.asarray(rotation, dtype=float)
    pitch = math.asin(min(1.0, max(-1.0, -float(r[2, 0]))))
    if abs(r[2, 0]) > 1 - 1e-12:
        return 0.0, pitch, math.atan2(-float(r[0, 1]), float(r[1, 1]))
    return math.atan2(float(r[2, 1]), float(r[2, 2])), pitch, math.atan2(float(r[1, 0]), float(r[0, 0]))


def rotation_from_quaternion(w: float, x: float, y: float, z: float) -> Array:
    """Return the rotation [3, 3] of a quaternion (scalar first), which is normalised.

    Raises
    ------
    FrameError
        If the quaternion is zero.
    """
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if norm < 1e-12:
        raise FrameError("quaternion (0, 0, 0, 0) has no direction")
    w, x, y, z = w / norm, x / norm, y / norm, z / norm
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of(rotation: ArrayLike) -> tuple[float, float, float, float]:
    """Return (w, x, y, z) of a rotation [3, 3], w not negative."""
    r = np.asarray(rotation, dtype=float)
    trace = float(np.trace(r))
    candidates = [trace, float(r[0, 0]), float(r[1, 1]), float(r[2, 2])]
    k = int(np.argmax(candidates))
    if k == 0:
        s = 2 * math.sqrt(1 + trace)
        q = (s / 4, (r[2, 1] - r[1, 2]) / s, (r[0, 2] - r[2, 0]) / s, (r[1, 0] - r[0, 1]) / s)
    elif k == 1:
        s = 2 * math.sqrt(1 + r[0, 0] - r[1, 1] - r[2, 2])
        q = ((r[2, 1] - r[1, 2]) / s, s / 4, (r[0, 1] + r[1, 0]) / s, (r[0, 2] + r[2, 0]) / s)
    elif k == 2:
        s = 2 * math.sqrt(1 + r[1, 1] - r[0, 0] - r[2, 2])
        q = ((r[0, 2] - r[2, 0]) / s, (r[0, 1] + r[1, 0]) / s, s / 4, (r[1, 2] + r[2, 1]) / s)
    else:
        s = 2 * math.sqrt(1 + r[2, 2] - r[0, 0] - r[1, 1])
        q = ((r[1, 0] - r[0, 1]) / s, (r[0, 2] + r[2, 0]) / s, (r[1, 2] + r[2, 1]) / s, s / 4)
    sign = -1.0 if q[0] < 0 else 1.0
    return sign * float(q[0]), sign * float(q[1]), sign * float(q[2]), sign * float(q[3])


@dataclass(frozen=True, slots=True)
class Pose:
    """Where the rover stands: origin of its frame in the site frame, and its attitude in radians.

    `heading` is counter-clockwise from east; positive `pitch` puts the nose down, positive `roll` the right
    side.
    """

    x: float
    y: float
    z: float = 0.0
    heading: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0

    @property
    def site_from_rover(self) -> Transform:
        """Return the transform from the rover frame to the site frame."""
        return Transform.from_rpy(self.roll, self.pitch, self.heading, (self.x, self.y, self.z))

    @property
    def tilt(self) -> float:
        """Return the angle between the rover's up and the vertical."""
        return math.acos(min(1.0, math.cos(self.roll) * math.cos(self.pitch)))

    @staticmethod
    def from_transform(site_from_rover: Transform) -> Pose:
        """Return the pose of a transform."""
        roll, pitch, heading = rpy_of(site_from_rover.rotation)
        x, y, z = (float(v) for v in site_from_rover.translation)
        return Pose(x, y, z, heading, pitch, roll)


NED_FROM_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Site convention of the rovers: north, east, nadir. Its own inverse."""

FRD_FROM_FLU = np.diag([1.0, -1.0, -1.0])
"""Body convention of the rovers: forward, right, down. Its own inverse."""


def site_from_rover_flu(site_ned: Transform) -> Transform:
    """Return a pose of the flight systems in ours: east-north-up, forward-left-up."""
    return Transform(NED_FROM_ENU @ site_ned.rotation @ FRD_FROM_FLU, NED_FROM_ENU @ site_ned.translation)
