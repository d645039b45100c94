"""Kernels of the safety check: plane, deviations and stereo's gaps under the tool."""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


@numba.njit(cache=True, nogil=True)
def _across(normal: Floats) -> tuple[Floats, Floats]:
    """Return `rover_iface.frames.across` of a unit normal (3,)."""
    least = 0
    for k in range(1, 3):
        if abs(normal[k]) < abs(normal[least]):
            least = k
    axis = np.zeros(3)
    axis[least] = 1.0
    first = np.cross(normal, axis)
    first /= math.sqrt(first @ first)
    return first, np.cross(normal, first)


@numba.njit(cache=True, nogil=True)
def in_ball(points: Floats, at: Floats, radius: float) -> Ints:
    """Return the indices of the points (n, 3), m, nearer to `at` (3,) than `radius`."""
    found = np.empty(len(points), np.int64)
    count = 0
    for i in range(len(points)):
        x, y, z = points[i, 0] - at[0], points[i, 1] - at[1], points[i, 2] - at[2]
        if x * x + y * y + z * z < radius * radius:
            found[count] = i
            count += 1
    return found[:count].copy()


@numba.njit(cache=True, nogil=True)
def fit_plane(points: Floats, weight: Floats, outward: Floats) -> tuple[Floats, Floats]:
    """Return a point and the outward unit normal of the plane through points (n, 3), m, wrong matches left
    out.

    `weight` (n,); `outward` (3,) tells the side of the normal.
    """
    n = len(points)
    use = np.ones(n, np.bool_)
    middle, normal = np.zeros(3), outward.copy()
    off = np.empty(n)
    for _ in range(3):
        total = 0.0
        middle[:] = 0.0
        for i in range(n):
            if use[i]:
                total += weight[i]
                for k in range(3):
                    middle[k] += weight[i] * points[i, k]
        middle /= total
        spread = np.zeros((3, 3))
        for i in range(n):
            if use[i]:
                for k in range(3):
                    for m in range(3):
                        spread[k, m] += (
                            weight[i] * (points[i, k] - middle[k]) * (points[i, m] - middle[m]) / total
                        )
        normal = np.ascontiguousarray(np.linalg.eigh(spread)[1][:, 0])
        for i in range(n):
            height = 0.0
            for k in range(3):
                height += (points[i, k] - middle[k]) * normal[k]
            off[i] = abs(height)
        limit = 3.0 * 1.4826 * np.median(off) + 1e-6
        kept = 0
        for i in range(n):
            use[i] = off[i] < limit
            kept += use[i]
        if kept < 6:
            break
    if normal @ outward < 0.0:
        normal = -normal
    return middle, normal


@numba.njit(cache=True, nogil=True)
def across_and_height(points: Floats, at: Floats, normal: Floats) -> tuple[Floats, Floats]:
    """Return for points (n, 3) the distance (n,) from the axis through `at` along the unit `normal`, and the
    height (n,) over the plane there; all in one frame, m.
    """
    across, height = np.empty(len(points)), np.empty(len(points))
    for i in range(len(points)):
        up, square = 0.0, 0.0
        for k in range(3):
            away = points[i, k] - at[k]
            up += away * normal[k]
            square += away * away
        height[i] = up
        across[i] = math.sqrt(max(0.0, square - up * up))
    return across, height


@numba.njit(cache=True, nogil=True)
def quantile(ordered: Floats, share: float) -> float:
    """Return a quantile of values [n] that are in ascending order, linear between them; `share` in 0..1."""
    at = share * (len(ordered) - 1)
    low = int(at)
    high = min(low + 1, len(ordered) - 1)
    return float(ordered[low] + (at - low) * (ordered[high] - ordered[low]))


@numba.njit(cache=True, nogil=True)
def covered(points: Floats, hides: Bools, at: Floats, normal: Floats, cell: float, depth: float) -> Bools:
    """Return which points (n, 3) the tool, coming along the unit `normal`, cannot meet: others lie over them.

    A point is covered if one of its cell that `hides` (n,), of a raster across the normal round `at` (3,),
    lies `depth` higher. What lies beside a step must not: stereo draws it over the edge.

    All lengths in m, points and directions in one frame; `cell` is the side of a cell of that raster.
    """
    first, second = _across(normal)
    u, v, h = np.empty(len(points)), np.empty(len(points)), np.empty(len(points))
    reach = 0.0
    for i in range(len(points)):
        x, y, z = points[i, 0] - at[0], points[i, 1] - at[1], points[i, 2] - at[2]
        u[i] = x * first[0] + y * first[1] + z * first[2]
        v[i] = x * second[0] + y * second[1] + z * second[2]
        h[i] = x * normal[0] + y * normal[1] + z * normal[2]
        reach = max(reach, abs(u[i]), abs(v[i]))
    half = int(reach / cell) + 1
    top = np.full((2 * half + 1, 2 * half + 1), -np.inf)
    rows, columns = np.empty(len(points), np.int64), np.empty(len(points), np.int64)
    for i in range(len(points)):
        rows[i], columns[i] = math.floor(v[i] / cell) + half, math.floor(u[i] / cell) + half
        if hides[i]:
            top[rows[i], columns[i]] = max(top[rows[i], columns[i]], h[i])
    found = np.empty(len(points), np.bool_)
    for i in range(len(points)):
        found[i] = top[rows[i], columns[i]] > h[i] + depth
    return found


@numba.njit(cache=True, nogil=True)
def relief(across: Floats, height: Floats, reach: float, above: float) -> tuple[Bools, float, float, float]:
    """Return which points lie under the tool, and their relief.

    Under the tool is what lies within `reach` of its axis and lower than `above`. The relief is the height of
    the highest parts (2 in 100 are higher), the depth of the lowest (1 in 200 is deeper), and the root mean
    square deviation.

    `across` and `height` [n] are each point's distance from the tool's axis and height over its plane; all in
    m.
    """
    under = (across < reach) & (height < above)
    over = np.sort(height[under])
    if len(over) == 0:
        return under, 0.0, 0.0, 0.0
    square = 0.0
    for value in over:
        square += value * value
    return under, quantile(over, 0.98), -quantile(over, 0.005), math.sqrt(square / len(over))


@numba.njit(cache=True, nogil=True)
def obstruction(
    across: Floats, height: Floats, reach: float, margin: float, above: float, single: int
) -> float:
    """Return the height of what stands in the tool's path, lower than `above`.

    That is the larger of the height of the highest parts (2 in 100 are higher) in the ring of `margin` round
    the tool, and the height that more than `single` points in ring and disc reach: a rock that leans over
    the surface from beside it is few points high up.

    `across` and `height` [n] are each point's distance from the tool's axis and height over its plane; all
    lengths in m.
    """
    low = height < above
    ring = np.sort(height[low & (across >= reach) & (across < reach + margin)])
    whole = np.sort(height[low & (across < reach + margin)])
    beside = quantile(ring, 0.98) if len(ring) else 0.0
    if len(whole) > single:
        beside = max(beside, whole[len(whole) - 1 - single])
    return float(beside)


@numba.njit(cache=True, nogil=True)
def median_sigma(covariances: Floats, index: Ints, normal: Floats) -> float:
    """Return the median deviation, m, along the unit `normal` (3,) of the chosen points.

    `covariances` (n, 3, 3), m^2, of which `index` (k,) chooses.
    """
    sigma = np.empty(len(index))
    for j in range(len(index)):
        value = 0.0
        for k in range(3):
            for m in range(3):
                value += normal[k] * covariances[index[j], k, m] * normal[m]
        sigma[j] = math.sqrt(max(value, 0.0))
    return float(np.median(sigma))


@numba.njit(cache=True, nogil=True)
def middle_lever(points: Floats, index: Ints, normal: Floats) -> float:
    """Return the smaller variance of the chosen points along the plane with this normal, m^2.

    `points` [n, 3], m, of which `index` [k] chooses; `normal` [3], unit length.
    """
    n = len(index)
    flat = np.empty((n, 3))
    for j in range(n):
        up = 0.0
        for k in range(3):
            up += points[index[j], k] * normal[k]
        for k in range(3):
            flat[j, k] = points[index[j], k] - up * normal[k]
    spread = np.zeros((3, 3))
    mean = np.zeros(3)
    for k in range(3):
        mean[k] = flat[:, k].mean()
    for j in range(n):
        for k in range(3):
            for m in range(3):
                spread[k, m] += (flat[j, k] - mean[k]) * (flat[j, m] - mean[m])
    return float(np.linalg.eigvalsh(spread / max(1, n - 1))[1])


@numba.njit(cache=True, nogil=True)
def disc_gaps(points: Floats, at: Floats, normal: Floats, radius: float, pixel: float) -> tuple[float, float]:
    """Return the share of a disc that lies within `pixel` of a point (n, 3), and the diameter of the largest
    circle, its centre on the disc, that holds none.

    The points are looked at along the disc's unit normal (3,); its centre `at` (3,) and all lengths are in m.
    """
    first, second = _across(normal)
    n = len(points)
    u, v = np.empty(n), np.empty(n)
    for i in range(n):
        u[i], v[i] = 0.0, 0.0
        for k in range(3):
            u[i] += (points[i, k] - at[k]) * first[k]
            v[i] += (points[i, k] - at[k]) * second[k]
    step = max(radius / 12.0, 0.0015)
    half = int((radius + step / 2.0) / step)
    limit = max(pixel, 0.5 * step)
    cells, covered, widest = 0, 0, 0.0
    for a in range(-half, half + 1):
        for b in range(-half, half + 1):
            x, y = a * step, b * step
            if x * x + y * y > radius * radius:
                continue
            nearest = 4.0 * radius * radius
            for i in range(n):
                square = (u[i] - x) ** 2 + (v[i] - y) ** 2
                nearest = min(nearest, square)
            cells += 1
            covered += nearest <= limit * limit
            widest = max(widest, nearest)
    return covered / cells, 2.0 * math.sqrt(widest)
