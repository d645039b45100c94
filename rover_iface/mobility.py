"""How a six-wheel rocker-bogie stands on the ground: pose from wheel contacts, and what is under its
belly.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_iface.frames import Pose
from rover_iface.profile import RoverProfile
from rover_iface.profile.parts import Wheels

Array = NDArray[np.floating]


class Ground(Protocol):
    """Anything that knows heights: a `Terrain`, or a map the rover has made."""

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Return heights [...], m, at points of the site frame `x` and `y` [...], m; NaN where unknown."""
        ...


@dataclass(frozen=True, eq=False)
class Standing:
    """How the rover stands in many poses at once; every array has the shape of the poses.

    `z` is the height of the rover's origin, `belly_gap` the least distance between the ground and the
    underside of
    the body, `step` the largest difference between neighbouring wheels of one side, beyond what the slope
    explains. Unknown ground gives NaN.
    """

    z: Array
    roll: Array
    pitch: Array
    belly_gap: Array
    step: Array
    slope: Array

    @property
    def tilt(self) -> Array:
        """Return the angle between the rover's up and the vertical."""
        return np.arccos(np.clip(np.cos(self.roll) * np.cos(self.pitch), -1.0, 1.0))


def settle(
    ground: Ground,
    profile: RoverProfile,
    x: ArrayLike,
    y: ArrayLike,
    heading: ArrayLike,
    *,
    belly: bool = True,
) -> Standing:
    """Return how the rover stands with its origin above (x, y) [n], site frame, m, and its nose towards
    heading [n], rad. Without `belly` the gap is left open (infinite): it takes two thirds of the time.

    Notes
    -----
    A wheel touches where the ground, raised by the wheel's outline, is highest. Middle and rear wheel of a
    side carry the bogie pivot, that and the front wheel the rocker; the differential gives the body the mean
    angle of
    both rockers. The angle of the whole rover is neglected when the wheels' places on the map are worked
    out, which is worth 1 - cos(tilt) of the wheelbase: 3 cm at 15 degrees.
    """
    x, y, heading = np.broadcast_arrays(
        np.asarray(x, dtype=float), np.asarray(y, dtype=float), np.asarray(heading, dtype=float)
    )
    wheels = profile.wheels
    c, s = np.cos(heading), np.sin(heading)
    axle = np.array(wheels.axle_x_m)
    px, py, lift = (_before(v, x.ndim) for v in _wheel_points(wheels))
    # Poses are the last axes: the largest of five in a row is slow to find where they are the first.
    heights = ground.height(x + c * px - s * py, y + s * px + c * py).reshape(6, 5, *x.shape)
    contact = (heights + lift).max(axis=1).reshape(2, 3, *x.shape)

    front, middle, rear = contact[:, 0], contact[:, 1], contact[:, 2]
    bogie_share = (wheels.bogie_pivot_x_m - axle[2]) / (axle[1] - axle[2])
    bogie = rear + bogie_share * (middle - rear)
    rise = (front - bogie) / (axle[0] - wheels.bogie_pivot_x_m)
    pivot = bogie + rise * (wheels.rocker_pivot_x_m - wheels.bogie_pivot_x_m)
    climb = np.arctan(rise.mean(axis=0))
    pitch = -climb
    roll = np.arctan2(pivot[0] - pivot[1], wheels.track_m)
    z = pivot.mean(axis=0) - np.tan(climb) * wheels.rocker_pivot_x_m

    level = contact - np.tan(climb) * _before(axle, x.ndim)
    step = np.abs(np.diff(level, axis=1)).max(axis=(0, 1))
    slope = np.arctan(np.hypot(np.tan(climb), np.tan(roll)))
    gap = np.full_like(z, np.inf)
    standing = Standing(z, roll, pitch, gap, step, slope)
    if belly:
        gap[...] = belly_gap(ground, profile, x, y, heading, standing)
    return standing


@lru_cache(maxsize=16)
def _wheel_points(wheels: Wheels) -> tuple[Array, Array, Array]:
    """Return where the wheels touch the ground at most, x and y [30] in the rover's frame, m, and how far the
    wheel's outline stands above its lowest point there [5]. The wheels are left front, middle, rear, right
    front, middle, rear.
    """
    axle, half = np.array(wheels.axle_x_m), wheels.track_m / 2
    offset = np.linspace(-0.8, 0.8, 5) * wheels.radius_m
    lift = np.sqrt(wheels.radius_m**2 - offset**2) - wheels.radius_m
    x = (np.concatenate([axle, axle])[:, None] + offset).ravel()
    return x, np.repeat([half, -half], 15), lift


@lru_cache(maxsize=16)
def _belly_points(length_m: float, width_m: float) -> tuple[Array, Array]:
    """Return points under the body, x and y [63] in the rover's frame, m."""
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 9) * length_m, np.linspace(-0.5, 0.5, 7) * width_m)
    return x.ravel(), y.ravel()


def belly_gap(
    ground: Ground, profile: RoverProfile, x: Array, y: Array, heading: Array, standing: Standing
) -> Array:
    """Return the least distance [n], m, between the ground and the underside of the body, of poses with their
    origin above x, y [n], site frame, m, towards heading [n], rad, as they stand there.
    """
    wheels, body = profile.wheels, profile.body
    c, s = np.cos(heading), np.sin(heading)
    points = _belly_points(body.length_m, min(body.width_m, wheels.track_m - wheels.width_m))
    gx, gy = (_before(v, x.ndim) for v in points)
    under = ground.height(x + c * gx - s * gy, y + s * gx + c * gy)
    plane = standing.z + np.tan(-standing.pitch) * gx + np.tan(standing.roll) * gy
    gap: Array = (plane + body.clearance_m - under).min(axis=0)
    return gap


def _before(values: Array, axes: int) -> Array:
    """Return values [k] as an axis before `axes` others."""
    return values.reshape(-1, *(1,) * axes)


def settled_pose(ground: Ground, profile: RoverProfile, x: float, y: float, heading: float) -> Pose:
    """Return the pose at x, y (site frame, m) and heading (rad) with height, pitch and roll on the ground;
    NaN where the ground is unknown.
    """
    standing = settle(ground, profile, np.array([x]), np.array([y]), np.array([heading]))
    return Pose(x, y, float(standing.z[0]), heading, float(standing.pitch[0]), float(standing.roll[0]))
