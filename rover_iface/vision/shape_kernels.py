"""Compiled kernels of the virtual range sensor: z-buffer, depth deviations, correlation search.

Points are in the sensor's axes: x right, y down, z ahead.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int32]


@njit(cache=True, nogil=True)
def z_buffer(points: Array, triangles: Index, focal: float, depth: Array) -> None:
    """Fill `depth` (rows, columns) with the nearest depth of the mesh along each pixel's ray, NaN for none.

    A facet's depth at a pixel comes from the barycentric weights on its plane (Deans, Kunz, Sargent and
    others 2005, eqs. 9 and 10).

    `points` [n, 3], m, in the camera's frame (x right, y down, z forward); `triangles` [m, 3]; `depth` [rows,
    columns], m; `focal` in px.
    """
    rows, columns = depth.shape
    cx, cy = (columns - 1) / 2.0, (rows - 1) / 2.0
    depth[:] = np.nan
    u, v = np.empty(3), np.empty(3)
    for n in range(len(triangles)):
        a, b, c = triangles[n, 0], triangles[n, 1], triangles[n, 2]
        za, zb, zc = points[a, 2], points[b, 2], points[c, 2]
        if min(za, zb, zc) < 0.05:
            continue
        for k, i in enumerate((a, b, c)):
            u[k] = focal * points[i, 0] / points[i, 2] + cx
            v[k] = focal * points[i, 1] / points[i, 2] + cy
        area = (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0])
        if abs(area) < 1e-9:
            continue
        left, right = max(0, int(np.ceil(u.min()))), min(columns - 1, int(np.floor(u.max())))
        top, bottom = max(0, int(np.ceil(v.min()))), min(rows - 1, int(np.floor(v.max())))
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                w1 = ((x - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (y - v[0])) / area
                w2 = ((u[1] - u[0]) * (y - v[0]) - (x - u[0]) * (v[1] - v[0])) / area
                w0 = 1.0 - w1 - w2
                if w0 < -1e-9 or w1 < -1e-9 or w2 < -1e-9:
                    continue
                z = 1.0 / (w0 / za + w1 / zb + w2 / zc)
                if np.isnan(depth[y, x]) or z < depth[y, x]:
                    depth[y, x] = z


@njit(cache=True, nogil=True)
def _depth_at(depth: Array, x: float, y: float) -> float:
    """Return depth between pixels, bilinear; NaN outside and where a neighbour is unknown."""
    rows, columns = depth.shape
    i, j = int(np.floor(x)), int(np.floor(y))
    if i < 0 or j < 0 or i >= columns - 1 or j >= rows - 1:
        return np.nan
    fx, fy = x - i, y - j
    return (1 - fy) * ((1 - fx) * depth[j, i] + fx * depth[j, i + 1]) + fy * (
        (1 - fx) * depth[j + 1, i] + fx * depth[j + 1, i + 1]
    )


@njit(cache=True, nogil=True)
def deviations(
    points: Array, rotation: Array, shift: Array, depth: Array, focal: float, limit: float, out: Array
) -> float:
    """Return the mean absolute depth deviation (eq. 12) of moved points from the z-buffer, capped.

    `out` (n,) gets the signed deviations, NaN where the sensor has no depth. A point without one counts as
    the cap: leaving the overlap must not pay.

    `points` (n, 3) and `shift` (3,), m; `rotation` (3, 3); `depth` (rows, columns), m; `focal` in px,
    `limit`, the cap, in m. Deans, Kunz, Sargent and others 2005.
    """
    rows, columns = depth.shape
    cx, cy = (columns - 1) / 2.0, (rows - 1) / 2.0
    total = 0.0
    for n in range(len(points)):
        p = points[n]
        x = rotation[0, 0] * p[0] + rotation[0, 1] * p[1] + rotation[0, 2] * p[2] + shift[0]
        y = rotation[1, 0] * p[0] + rotation[1, 1] * p[1] + rotation[1, 2] * p[2] + shift[1]
        z = rotation[2, 0] * p[0] + rotation[2, 1] * p[1] + rotation[2, 2] * p[2] + shift[2]
        out[n] = np.nan
        if z > 0.05:
            known = _depth_at(depth, focal * x / z + cx, focal * y / z + cy)
            out[n] = z - known
        gap = abs(out[n])
        total += gap if gap < limit else limit
    return total / max(1, len(points))


@njit(cache=True, nogil=True)
def correlate(
    points: Array,
    rotations: Array,
    offsets: Array,
    centre: Array,
    depth: Array,
    focal: float,
    limit: float,
    least_share: float,
    best: Array,
) -> None:
    """Search shifts (m, 2) in the sensor's x and y for each of rotations (k, 3, 3) about `centre`.

    For each the shift along z is the median of h_i - z_i (eq. 14, which as printed lacks the z_i), with the
    sign that takes it away. `best` (k, 4) gets cost, x, y, z; the cost is infinite where nothing overlaps.

    `points` (n, 3) and `centre` (3,), m; `depth` (rows, columns), m; `focal` in px. Deans, Kunz, Sargent and
    others 2005.
    """
    rows, columns = depth.shape
    cx, cy = (columns - 1) / 2.0, (rows - 1) / 2.0
    count = len(points)
    turned, gaps = np.empty((count, 3)), np.empty(count)
    for k in range(len(rotations)):
        best[k, 0] = np.inf
        for n in range(count):
            for i in range(3):
                turned[n, i] = centre[i]
                for j in range(3):
                    turned[n, i] += rotations[k, i, j] * (points[n, j] - centre[j])
        for m in range(len(offsets)):
            found = 0
            for n in range(count):
                z = turned[n, 2]
                x = round(focal * (turned[n, 0] + offsets[m, 0]) / z + cx)
                y = round(focal * (turned[n, 1] + offsets[m, 1]) / z + cy)
                if 0 <= x < columns and 0 <= y < rows and not np.isnan(depth[y, x]):
                    gaps[found] = z - depth[y, x]
                    found += 1
            if found < least_share * count:
                continue
            middle = np.median(gaps[:found])
            total = limit * (count - found)
            for n in range(found):
                total += min(limit, abs(gaps[n] - middle))
            total /= count
            if total < best[k, 0]:
                best[k, 0], best[k, 1], best[k, 2], best[k, 3] = total, offsets[m, 0], offsets[m, 1], -middle
