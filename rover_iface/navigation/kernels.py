"""Compiled loops of the navigator: cast ranges, fit planes, spread costs, try arcs.

Grids are [rows, columns] with row 0 in the south and column 0 in the west; `west` and `south` are the middle
of the first cell.
"""

from __future__ import annotations

import heapq
import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.floating]

OWN_MARGIN_M = 0.02
"""How near to the rock it comes for the rover may go: up to it, not onto it."""


@njit(cache=True, nogil=True, inline="always")
def _height(heights: Array, west: float, south: float, spacing: float, x: float, y: float) -> float:
    rows, columns = heights.shape
    c = (x - west) / spacing
    r = (y - south) / spacing
    if c < 0 or r < 0 or c > columns - 1 or r > rows - 1:
        return math.nan
    j = min(int(c), columns - 2)
    i = min(int(r), rows - 2)
    fc, fr = c - j, r - i
    return (heights[i, j] * (1 - fc) + heights[i, j + 1] * fc) * (1 - fr) + (
        heights[i + 1, j] * (1 - fc) + heights[i + 1, j + 1] * fc
    ) * fr


@njit(cache=True, nogil=True)
def cast_ranges(
    heights: Array,
    west: float,
    south: float,
    spacing: float,
    eye: Array,
    directions: Array,
    reach: float,
) -> Array:
    """Return the distance [n], m, along unit directions [n, 3] to the surface, NaN where it is not met in
    reach.

    Rays leave `eye` [3]; `heights` [rows, columns] stand `spacing` apart; one frame, m.
    """
    count = directions.shape[0]
    ranges = np.full(count, np.nan)
    step = 0.8 * spacing
    for k in range(count):
        dx, dy, dz = directions[k, 0], directions[k, 1], directions[k, 2]
        flat = math.hypot(dx, dy)
        advance = step / max(flat, 0.3)
        t = 0.0
        before = 0.0
        gap_before = math.nan
        while t < reach:
            h = _height(heights, west, south, spacing, eye[0] + t * dx, eye[1] + t * dy)
            gap = eye[2] + t * dz - h
            if math.isnan(gap):
                if not math.isnan(gap_before):
                    break
            elif gap <= 0:
                if math.isnan(gap_before):
                    break
                ranges[k] = before + (t - before) * gap_before / (gap_before - gap)
                break
            # Far above the ground the ray may take longer strides, since slopes stay below 60 degrees.
            before, gap_before = t, gap
            t += max(advance, 0.4 * gap / (1.8 * flat + abs(dz) + 1e-9)) if not math.isnan(gap) else advance
    return ranges


@njit(cache=True, nogil=True)
def gather(
    weight: Array,
    total: Array,
    square: Array,
    west: float,
    south: float,
    cell: float,
    points: Array,
    gains: Array,
) -> int:
    """Add points [n, 3] with weights [n] to the cells' sums of weight, z and z^2; return how many fell
    inside.

    Lengths in m: points and the grid [rows, columns], of side `cell`, are in one frame.
    """
    rows, columns = weight.shape
    used = 0
    for k in range(points.shape[0]):
        c = math.floor((points[k, 0] - west) / cell + 0.5)
        r = math.floor((points[k, 1] - south) / cell + 0.5)
        if 0 <= r < rows and 0 <= c < columns and not math.isnan(points[k, 2]):
            w = gains[k]
            weight[r, c] += w
            total[r, c] += w * points[k, 2]
            square[r, c] += w * points[k, 2] * points[k, 2]
            used += 1
    return used


@njit(cache=True, nogil=True)
def assess(
    weight: Array,
    total: Array,
    square: Array,
    cell: float,
    r0: int,
    r1: int,
    c0: int,
    c1: int,
    reach: int,
    least: float,
    residual_limit: float,
    tilt_limit: float,
    step_limit: float,
    hazard: Array,
    confidence: Array,
) -> None:
    """Fit a plane round each cell of rows r0..r1, columns c0..c1 and write its hazard (>= 1: obstacle; NaN:
    unknown) and its confidence.

    All arrays are [rows, columns]: `weight`, `total` and `square` are the sums of weight, z (m) and z^2 (m^2)
    in each cell of `cell` metres. `reach` is half the patch in cells; `least` the weight a cell needs to
    count. The limits are in m and rad.
    """
    rows, columns = weight.shape
    for r in range(r0, r1):
        for c in range(c0, c1):
            n = 0.0
            sx = sy = sz = sxx = sxy = syy = sxz = syz = szz = 0.0
            for i in range(max(0, r - reach), min(rows, r + reach + 1)):
                for j in range(max(0, c - reach), min(columns, c + reach + 1)):
                    w = weight[i, j]
                    if w < least:
                        continue
                    x, y, z = (j - c) * cell, (i - r) * cell, total[i, j] / w
                    n += 1.0
                    sx += x
                    sy += y
                    sz += z
                    sxx += x * x
                    sxy += x * y
                    syy += y * y
                    sxz += x * z
                    syz += y * z
                    szz += z * z
            own = weight[r, c]
            confidence[r, c] = 1.0 - math.exp(-own / 3.0)
            whole = (2 * reach + 1) ** 2
            if n < max(6.0, 0.25 * whole) or own < least:
                hazard[r, c] = math.nan
                continue
            mx, my, mz = sx / n, sy / n, sz / n
            vxx, vxy, vyy = sxx / n - mx * mx, sxy / n - mx * my, syy / n - my * my
            vxz, vyz, vzz = sxz / n - mx * mz, syz / n - my * mz, szz / n - mz * mz
            det = vxx * vyy - vxy * vxy
            if det < 1e-9:
                hazard[r, c] = math.nan
                continue
            a = (vxz * vyy - vyz * vxy) / det
            b = (vyz * vxx - vxz * vxy) / det
            residual = math.sqrt(max(0.0, vzz - a * vxz - b * vyz))
            tilt = math.atan(math.hypot(a, b))
            # Step: own height against what the plane through each neighbour says, and spread inside the cell.
            height = total[r, c] / own
            step = math.sqrt(max(0.0, square[r, c] / own - height * height))
            above = abs(height - (mz - a * mx - b * my))
            if above > step:
                step = above
            near = min(reach, 4)
            for i in range(max(0, r - near), min(rows, r + near + 1)):
                for j in range(max(0, c - near), min(columns, c + near + 1)):
                    w = weight[i, j]
                    if w < least:
                        continue
                    z = total[i, j] / w - a * (j - c) * cell - b * (i - r) * cell
                    d = height - z
                    if d > step:
                        step = d
            level = residual / residual_limit
            level = max(level, tilt / tilt_limit)
            level = max(level, step / step_limit)
            hazard[r, c] = level


@njit(cache=True, nogil=True)
def obstacle_distance(blocked: NDArray[np.bool_], cell: float) -> Array:
    """Return the distance [rows, columns] to the nearest cell that is `blocked` [rows, columns], metres.

    Chamfer 3-4, within 6 % (Borgefors 1986); `cell` is the side of a cell, m. Infinite is told as a large
    number.
    """
    rows, columns = blocked.shape
    far = 1e9
    d = np.where(blocked, 0.0, far)
    for r in range(rows):
        for c in range(columns):
            v = d[r, c]
            if r > 0:
                v = min(v, d[r - 1, c] + 3)
                if c > 0:
                    v = min(v, d[r - 1, c - 1] + 4)
                if c < columns - 1:
                    v = min(v, d[r - 1, c + 1] + 4)
            if c > 0:
                v = min(v, d[r, c - 1] + 3)
            d[r, c] = v
    for r in range(rows - 1, -1, -1):
        for c in range(columns - 1, -1, -1):
            v = d[r, c]
            if r < rows - 1:
                v = min(v, d[r + 1, c] + 3)
                if c > 0:
                    v = min(v, d[r + 1, c - 1] + 4)
                if c < columns - 1:
                    v = min(v, d[r + 1, c + 1] + 4)
            if c < columns - 1:
                v = min(v, d[r, c + 1] + 3)
            d[r, c] = v
    return d * (cell / 3.0)


@njit(cache=True, nogil=True)
def cost_to_go(price: Array, cell: float, goal_row: int, goal_column: int) -> Array:
    """Return the least cost [rows, columns] to reach the goal over cells of `price` per metre (inf:
    closed).

    Shortest paths over the 8 neighbours (Dijkstra 1959); `cell` is the side of a cell, m.
    """
    rows, columns = price.shape
    cost = np.full((rows, columns), np.inf)
    cost[goal_row, goal_column] = 0.0
    heap = [(0.0, goal_row * columns + goal_column)]
    while len(heap) > 0:
        value, index = heapq.heappop(heap)
        r, c = index // columns, index % columns
        if value > cost[r, c]:
            continue
        for i in range(-1, 2):
            for j in range(-1, 2):
                a, b = r + i, c + j
                if (i == 0 and j == 0) or a < 0 or b < 0 or a >= rows or b >= columns:
                    continue
                p = price[a, b]
                if p == np.inf:
                    continue
                length = cell * (1.4142135623730951 if i != 0 and j != 0 else 1.0)
                new = value + length * 0.5 * (p + min(price[r, c], 1e6))
                if new < cost[a, b]:
                    cost[a, b] = new
                    heapq.heappush(heap, (new, a * columns + b))
    return cost


@njit(cache=True, nogil=True, inline="always")
def _clearance(u: float, v: float, half_length: float, half_width: float) -> float:
    """Return the distance of a point of the rover frame from the rover's outline, negative inside."""
    a, b = abs(u) - half_length, abs(v) - half_width
    if a > 0.0 and b > 0.0:
        return math.hypot(a, b)
    return max(a, b)


@njit(cache=True, nogil=True)
def try_ways(
    hazard: Array,
    west: float,
    south: float,
    cell: float,
    x: float,
    y: float,
    heading: float,
    ways: Array,
    half_length: float,
    half_width: float,
    margin: float,
    unknown: float,
    ignore_x: float,
    ignore_y: float,
    ignore_radius: float,
) -> Array:
    """Return per way [n, 6], in m and rad: length free of obstacles, mean hazard, end x, y, heading, share
    unknown.

    A way [n, 3] is a turn in place, then an arc of a curvature and a length (backwards if negative). An
    obstacle stops it if it comes within the margin and nearer than it is now, so that the rover can leave
    what it stands beside; so does ground never seen under the body itself. Within a circle (the tracked
    target's own rock) obstacles may come as near as `OWN_MARGIN_M`, and unseen ground does not count.

    `hazard` is [rows, columns]; a turn is in rad, a curvature in 1/m, a length in m; places and headings are
    those of the map's frame.
    """
    rows, columns = hazard.shape
    result = np.zeros((ways.shape[0], 6))
    spacing = cell
    nl = math.ceil(2 * (half_length + margin) / spacing) + 1
    nw = math.ceil(2 * (half_width + margin) / spacing) + 1
    ch, sh = math.cos(heading), math.sin(heading)
    for k in range(ways.shape[0]):
        turn, curvature, length = ways[k, 0], ways[k, 1], ways[k, 2]
        way = 1.0 if length >= 0 else -1.0
        turning = max(1, math.ceil(abs(turn) / 0.2)) if abs(turn) > 1e-6 else 0
        driving = max(1, math.ceil(abs(length) / (1.5 * cell)))
        free = abs(length)
        total, number, blind = 0.0, 0.0, 0.0
        px, py, ph = x, y, heading
        stop = False
        for s in range(1, turning + driving + 1):
            if s <= turning:
                px, py, ph = x, y, heading + turn * s / turning
                done = 0.0
            else:
                done = abs(length) * (s - turning) / driving
                ph0 = heading + turn
                dh = curvature * done * way
                ph = ph0 + dh
                if abs(curvature) < 1e-9:
                    px = x + way * done * math.cos(ph0)
                    py = y + way * done * math.sin(ph0)
                else:
                    px = x + (math.sin(ph) - math.sin(ph0)) / curvature
                    py = y - (math.cos(ph) - math.cos(ph0)) / curvature
            c, sn = math.cos(ph), math.sin(ph)
            for i in range(nl):
                u = -(half_length + margin) + 2 * (half_length + margin) * i / (nl - 1)
                for j in range(nw):
                    v = -(half_width + margin) + 2 * (half_width + margin) * j / (nw - 1)
                    gx, gy = px + c * u - sn * v, py + sn * u + c * v
                    col = math.floor((gx - west) / cell + 0.5)
                    row = math.floor((gy - south) / cell + 0.5)
                    number += 1.0
                    # beyond the map nobody has looked either
                    h = hazard[row, col] if 0 <= row < rows and 0 <= col < columns else math.nan
                    unseen = math.isnan(h)
                    if unseen:
                        total += unknown
                        blind += 1.0
                    if unseen or h >= 1.0:
                        ax, ay = gx - x, gy - y
                        after = _clearance(u, v, half_length, half_width)
                        before = _clearance(ch * ax + sh * ay, -sh * ax + ch * ay, half_length, half_width)
                        own = math.hypot(gx - ignore_x, gy - ignore_y) <= ignore_radius
                        if own and (unseen or after >= OWN_MARGIN_M):
                            continue
                        if after >= (0.0 if unseen else margin):
                            continue
                        if before < 0.0:
                            # Under the rover already: it may be left behind, not driven over once more.
                            if unseen or math.hypot(gx - px, gy - py) > math.hypot(ax, ay) - 0.02:
                                continue
                        elif after >= before - 0.01:
                            continue
                        stop = True
                        break
                    total += h
                if stop:
                    break
            if stop:
                free = 0.0 if s <= turning else abs(length) * (s - turning - 1) / driving
                break
        result[k, 0] = free
        result[k, 1] = total / max(1.0, number)
        result[k, 2], result[k, 3], result[k, 4] = px, py, ph
        result[k, 5] = blind / max(1.0, number)
    return result
