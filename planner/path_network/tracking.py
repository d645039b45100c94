"""Tracking regions and what a segment does to a track: metres inside, outside and hidden.

The region of a target is a cone with its apex at the target that opens towards the place from which the
target was first imaged (Pedersen et al. 2005, figure 6). Outside it the target shows another side and the
chance to lose it is higher. Ground between camera and target hides it.
"""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

from mission import TerrainGrid
from planner.path_network.values import FloatArray, NetworkRequest, Target, TrackingRegion


def tracking_regions(request: NetworkRequest) -> tuple[TrackingRegion, ...]:
    """Return the region of every tracked target; its polygon reaches as far as the first sight."""
    half = request.rover.cone_half_angle_rad
    regions = []
    for target in request.targets:
        if not target.tracked:
            continue
        east, north = _first_seen(request, target)
        axis = math.atan2(north - target.north_m, east - target.east_m)
        reach = math.hypot(east - target.east_m, north - target.north_m)
        steps = max(2, math.ceil(half / math.radians(5.0)) * 2)
        arc = [axis - half + 2 * half * k / steps for k in range(steps + 1)]
        rim = [(target.east_m + reach * math.cos(a), target.north_m + reach * math.sin(a)) for a in arc]
        apex = (target.east_m, target.north_m)
        regions.append(TrackingRegion(target.id, apex, axis, half, reach, (apex, *rim, apex)))
    return tuple(regions)


def _first_seen(request: NetworkRequest, target: Target) -> tuple[float, float]:
    if target.first_seen is not None:
        return target.first_seen
    return request.start.east_m, request.start.north_m


def loss_exposure(
    request: NetworkRequest, a: FloatArray, b: FloatArray, heights: TerrainGrid | None
) -> FloatArray:
    """Return metres inside, outside (weighted by the angle beyond the cone) and hidden.

    Parameters
    ----------
    a, b
        Ends of segments, shape (segments, 2), site frame, m.

    Returns
    -------
    Array of shape (segments, tracked targets, 3).
    """
    tracked = [t for t in request.targets if t.tracked]
    regions = tracking_regions(request)
    if not tracked or not len(a):
        return np.zeros((len(a), len(tracked), 3))
    apex = np.array([r.apex for r in regions])
    axis = np.array([(math.cos(r.axis_rad), math.sin(r.axis_rad)) for r in regions])
    half = np.array([r.half_angle_rad for r in regions])
    if heights is None:
        grid, frame, level = np.zeros((1, 1)), np.array([0.0, 0.0, -1.0]), np.zeros(len(tracked))
    else:
        grid = filled(heights)
        frame = np.array([heights.origin_east_m, heights.origin_north_m, heights.spacing_m])
        ground = sample(heights, grid, apex)
        level = np.array(
            [
                g + 0.1 if t.height_m is None else t.height_m
                for t, g in zip(tracked, ground.tolist(), strict=True)
            ]
        )
    return _expose(
        np.ascontiguousarray(a),
        np.ascontiguousarray(b),
        apex,
        axis,
        half,
        level,
        grid,
        frame,
        request.options.sample_m,
        request.rover.mast_height_m,
        request.calibration.angle_gain_per_rad,
    )


def filled(heights: TerrainGrid) -> FloatArray:
    """Return the heights as float64 with each unknown cell set to its nearest known one."""
    grid = np.ascontiguousarray(heights.heights_m, dtype=np.float64)
    known = np.isfinite(grid)
    if known.all():
        return grid
    from scipy import ndimage

    nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.ascontiguousarray(grid[tuple(nearest)])


def sample(heights: TerrainGrid, grid: FloatArray, points: npt.NDArray[np.float64]) -> FloatArray:
    """Return heights (n,), m, at points (n, 2), site frame, m, bilinear, clamped to the grid's edge."""
    frame = (heights.origin_east_m, heights.origin_north_m, heights.spacing_m)
    return _heights(grid, *map(float, frame), np.ascontiguousarray(points, dtype=np.float64))


@numba.njit(cache=True, nogil=True)
def _height(
    grid: FloatArray, east0: float, north0: float, spacing: float, east: float, north: float
) -> float:
    rows, columns = grid.shape
    x = min(max((east - east0) / spacing, 0.0), columns - 1.000001)
    y = min(max((north0 - north) / spacing, 0.0), rows - 1.000001)
    j, i = int(x), int(y)
    u, v = x - j, y - i
    top = grid[i, j] * (1 - u) + grid[i, j + 1] * u
    low = grid[i + 1, j] * (1 - u) + grid[i + 1, j + 1] * u
    return top * (1 - v) + low * v


@numba.njit(cache=True, nogil=True)
def _heights(grid: FloatArray, east0: float, north0: float, spacing: float, points: FloatArray) -> FloatArray:
    out = np.empty(len(points))
    for i in range(len(points)):
        out[i] = _height(grid, east0, north0, spacing, points[i, 0], points[i, 1])
    return out


@numba.njit(cache=True, nogil=True)
def _expose(
    a: FloatArray,
    b: FloatArray,
    apex: FloatArray,
    axis: FloatArray,
    half: FloatArray,
    level: FloatArray,
    grid: FloatArray,
    frame: FloatArray,
    step_m: float,
    mast_m: float,
    gain: float,
) -> FloatArray:
    out = np.zeros((len(a), len(apex), 3))
    east0, north0, spacing = frame[0], frame[1], frame[2]
    for s in range(len(a)):
        dx, dy = b[s, 0] - a[s, 0], b[s, 1] - a[s, 1]
        length = math.sqrt(dx * dx + dy * dy)
        parts = max(1, math.ceil(length / step_m))
        share = length / parts
        for k in range(parts):
            f = (k + 0.5) / parts
            x, y = a[s, 0] + f * dx, a[s, 1] + f * dy
            eye = 0.0
            if spacing > 0:
                eye = _height(grid, east0, north0, spacing, x, y) + mast_m
            for t in range(len(apex)):
                vx, vy = x - apex[t, 0], y - apex[t, 1]
                reach = math.sqrt(vx * vx + vy * vy)
                hidden = False
                if spacing > 0 and reach > 1.0:
                    rays = max(2, min(400, int(reach / max(spacing, 0.1))))
                    for q in range(1, rays):
                        g = q / rays
                        if g * reach < 0.5:  # the target's own rock does not hide it
                            continue
                        line = level[t] + g * (eye - level[t])
                        if (
                            _height(grid, east0, north0, spacing, apex[t, 0] + g * vx, apex[t, 1] + g * vy)
                            > line
                        ):
                            hidden = True
                            break
                if hidden:
                    out[s, t, 2] += share
                    continue
                excess = 0.0
                if reach > 1e-6:
                    cosine = (vx * axis[t, 0] + vy * axis[t, 1]) / reach
                    excess = math.acos(min(1.0, max(-1.0, cosine))) - half[t]
                if excess <= 0:
                    out[s, t, 0] += share
                else:
                    out[s, t, 1] += share * (1.0 + gain * excess)
    return out
