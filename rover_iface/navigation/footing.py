"""How the rover would stand along a way, on the heights that it has mapped.

Planes judge a cell for itself: a ledge of 12 cm across the whole site is an obstacle everywhere, though six
wheels on rockers climb it one by one. Where planes close a way, the rover is put on the mapped heights pose
by pose, wheels, rockers and belly (`mobility.settle`), and the way is as long as it stands well there; what
Perseverance's navigator does with bounds (ACE, Otsu and others 2020) is done here with the heights
themselves, a little to either side too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_iface.frames import Pose
from rover_iface.mobility import Standing, settle
from rover_iface.navigation.sensor import GroundRaster
from rover_iface.profile import RoverProfile

Array = NDArray[np.floating]


@dataclass(frozen=True, slots=True)
class FootingLimits:
    """What the rover must keep from touching and tipping on mapped heights.

    Heights are off by stereo's noise and between cells, so `gap_m` is left under the belly, and `step_share`
    and `tilt_share` of what the rover can do are used. To either side it must stand well, too, as far as it
    may have come astray: `astray` times the distance, at most `aside_m`. Poses are `every_m` and
    `every_rad` apart. By hand, on the drives over sites 9000 to 9013 of `studies.traverses`.
    """

    gap_m: float = 0.05
    step_share: float = 0.8
    tilt_share: float = 0.9
    astray: float = 0.25
    aside_m: float = 0.08
    every_m: float = 0.1
    every_rad: float = 0.2


def filled(heights: Array) -> Array:
    """Return heights [rows, columns] with each unknown one (NaN) that has three known neighbours or more as
    high as the highest of them.
    """
    wide = np.pad(heights, 1, constant_values=np.nan)
    rows, columns = heights.shape
    beside = np.stack(
        [wide[i : i + rows, j : j + columns] for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    )
    known = np.isfinite(beside)
    highest = np.where(known, beside, -np.inf).max(axis=0)
    return np.where(np.isnan(heights) & (known.sum(axis=0) >= 3), highest, heights)


def under_body(ground: GroundRaster, profile: RoverProfile, pose: Pose) -> GroundRaster:
    """Return the ground with what nobody has seen below the rover taken to be the plane that it stands on.

    No camera looks there, and the rover stands on it well enough to begin with.
    """
    body = profile.body
    around = math.hypot(body.length_m, body.width_m) / 2 + ground.spacing
    rows, columns = ground.heights.shape
    c, r = (pose.x - ground.west) / ground.spacing, (pose.y - ground.south) / ground.spacing
    reach = math.ceil(around / ground.spacing)
    view = (_part(round(r), reach, rows), _part(round(c), reach, columns))
    i, j = np.mgrid[view]
    east, north = (j - c) * ground.spacing, (i - r) * ground.spacing
    u = math.cos(pose.heading) * east + math.sin(pose.heading) * north
    v = -math.sin(pose.heading) * east + math.cos(pose.heading) * north
    below = (np.abs(u) <= body.length_m / 2) & (np.abs(v) <= body.width_m / 2)
    plane = pose.z - math.tan(pose.pitch) * u + math.tan(pose.roll) * v
    heights = ground.heights.copy()
    part = heights[view]
    part[...] = np.where(below & np.isnan(part), plane, part)
    return GroundRaster(heights, ground.west, ground.south, ground.spacing)


def _part(middle: int, reach: int, count: int) -> slice:
    """Return the indices round a middle one that there are; none where it lies too far outside."""
    first = min(max(0, middle - reach), count)
    return slice(first, max(first, min(count, middle + reach + 1)))


def free_lengths(
    ground: GroundRaster, profile: RoverProfile, pose: Pose, ways: Array, limits: FootingLimits
) -> Array:
    """Return how far [n], m, the rover stands well along each way [n, 3] from a pose on the map.

    A way is a turn in place, rad, then an arc of a curvature, 1/m, and a length, m (backwards if negative);
    where it does not stand well in the turn, that is -1. What is no worse than where it stands now does not
    stop it.
    """
    ground = under_body(ground, profile, pose)
    x, y, heading, done = _along(pose, ways, limits)
    aside = np.array([0.0, 1.0, -1.0])[:, None, None] * np.minimum(limits.aside_m, limits.astray * done)
    beside_x, beside_y = x - aside * np.sin(heading), y + aside * np.cos(heading)
    there = settle(ground, profile, beside_x, beside_y, np.broadcast_to(heading, beside_x.shape))
    here = settle(ground, profile, np.array([pose.x]), np.array([pose.y]), np.array([pose.heading]))
    well = np.cumprod(_stands(there, here, profile, limits).all(axis=0), axis=1, dtype=bool)
    turning = np.argmax(done > 0.0, axis=1) if done.any() else np.full(len(ways), done.shape[1])
    turned = well[np.arange(len(ways)), np.maximum(turning, 1) - 1]
    return np.where(turned, np.where(well, done, 0.0).max(axis=1), -1.0)


def _stands(
    there: Standing, here: Standing, profile: RoverProfile, limits: FootingLimits
) -> NDArray[np.bool_]:
    mobility = profile.mobility
    gap_m = np.fmin(limits.gap_m, here.belly_gap)
    step_m = np.fmax(limits.step_share * mobility.max_step_m, here.step)
    tilt_rad = np.fmax(limits.tilt_share * mobility.max_slope_rad, here.tilt)
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (there.belly_gap >= gap_m) & (there.step <= step_m) & (there.tilt <= tilt_rad), dtype=np.bool_
        )


def _along(pose: Pose, ways: Array, limits: FootingLimits) -> tuple[Array, Array, Array, Array]:
    """Return x, y, heading and length driven [n, k] of poses along each way: the turn first, then the arc."""
    turn, curvature, length = (ways[:, k : k + 1] for k in range(3))
    turning = max(1, math.ceil(float(np.abs(turn).max()) / limits.every_rad))
    driving = max(1, math.ceil(float(np.abs(length).max()) / limits.every_m))
    turned = np.hstack([turn * np.arange(1, turning + 1) / turning, np.repeat(turn, driving, axis=1)])
    driven = length * np.hstack([np.zeros((1, turning)), np.arange(1, driving + 1)[None] / driving])
    start = pose.heading + turned
    heading = start + curvature * driven
    straight = np.abs(curvature) < 1e-9
    bend = np.where(straight, 1.0, curvature)
    x = np.where(straight, driven * np.cos(start), (np.sin(heading) - np.sin(start)) / bend)
    y = np.where(straight, driven * np.sin(start), (np.cos(start) - np.cos(heading)) / bend)
    return pose.x + x, pose.y + y, heading, np.abs(driven)
