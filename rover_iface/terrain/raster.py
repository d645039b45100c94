"""Compiled loops over height rasters."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.floating]


@njit(cache=True, nogil=True)
def drape_triangles(
    heights: Array, west: float, south: float, spacing: float, vertices: Array, triangles: NDArray[np.int32]
) -> None:
    """Raise posts of `heights` [rows, columns] to the triangles above them, in place.

    vertices [bodies, n, 3]; triangles [m, 3] are shared by all bodies.

    Lengths in m; `west` and `south` are the first post.
    """
    rows, columns = heights.shape
    for body in range(vertices.shape[0]):
        for k in range(triangles.shape[0]):
            a = vertices[body, triangles[k, 0]]
            b = vertices[body, triangles[k, 1]]
            c = vertices[body, triangles[k, 2]]
            area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            if area <= 1e-12:
                continue
            c0 = max(0, math.ceil((min(a[0], b[0], c[0]) - west) / spacing))
            c1 = min(columns - 1, math.floor((max(a[0], b[0], c[0]) - west) / spacing))
            r0 = max(0, math.ceil((min(a[1], b[1], c[1]) - south) / spacing))
            r1 = min(rows - 1, math.floor((max(a[1], b[1], c[1]) - south) / spacing))
            for r in range(r0, r1 + 1):
                y = south + r * spacing
                for col in range(c0, c1 + 1):
                    x = west + col * spacing
                    u = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / area
                    v = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / area
                    w = 1.0 - u - v
                    if u >= -1e-9 and v >= -1e-9 and w >= -1e-9:
                        z = u * a[2] + v * b[2] + w * c[2]
                        if not heights[r, col] >= z:
                            heights[r, col] = z


@njit(cache=True, nogil=True)
def cast_shadow(
    heights: Array, spacing: float, east: float, north: float, rise: float, reach_m: float
) -> Array:
    """Return the light [rows, columns] that a sun lets through, 0 shadow to 1 lit.

    (`east`, `north`) is the unit direction to the sun on the map, `rise` the tangent of its height. The edge
    is soft over a post of height difference.

    `heights` [rows, columns], row 0 south, stand `spacing` apart, m.
    """
    rows, columns = heights.shape
    light = np.ones((rows, columns))
    count = int(reach_m / spacing)
    top = np.max(heights)
    for r in range(rows):
        for c in range(columns):
            base = heights[r, c]
            worst = 0.0
            for k in range(1, count + 1):
                y = r + north * k
                x = c + east * k
                if x < 0 or y < 0 or x > columns - 1.001 or y > rows - 1.001:
                    break
                ray = base + rise * k * spacing
                if ray > top:
                    break
                i, j = int(y), int(x)
                fy, fx = y - i, x - j
                h = (heights[i, j] * (1 - fx) + heights[i, j + 1] * fx) * (1 - fy) + (
                    heights[i + 1, j] * (1 - fx) + heights[i + 1, j + 1] * fx
                ) * fy
                if h - ray > worst:
                    worst = h - ray
                    if worst > spacing:
                        break
            light[r, c] = 1.0 - min(1.0, worst / (0.5 * spacing))
    return light


@njit(cache=True, nogil=True, inline="always")
def _scramble(i: int, j: int, salt: int) -> float:
    h = np.uint64(i) * np.uint64(0x9E3779B97F4A7C15) ^ np.uint64(j) * np.uint64(0xC2B2AE3D27D4EB4F)
    h += np.uint64(salt) * np.uint64(0x165667B19E3779F9)
    h ^= h >> np.uint64(33)
    h *= np.uint64(0xFF51AFD7ED558CCD)
    h ^= h >> np.uint64(33)
    return float(h >> np.uint64(11)) / 9007199254740992.0


@njit(cache=True, nogil=True)
def cell_borders(x: Array, y: Array, where: NDArray[np.bool_], seed: int) -> tuple[Array, Array]:
    """Return distance to the border of Worley cells (Worley 1996) of size 1 and a number in [0, 1) per cell,
    where asked.

    x, y, where [rows, columns]; elsewhere the distance is 1 and the number 0.5.
    """
    rows, columns = x.shape
    distance = np.ones((rows, columns))
    label = np.full((rows, columns), 0.5)
    for r in range(rows):
        for c in range(columns):
            if not where[r, c]:
                continue
            i, j = math.floor(x[r, c]), math.floor(y[r, c])
            first, second, name = 1e9, 1e9, 0.0
            for a in range(i - 1, i + 2):
                for b in range(j - 1, j + 2):
                    px = a + 0.1 + 0.8 * _scramble(a, b, seed + 1) - x[r, c]
                    py = b + 0.1 + 0.8 * _scramble(a, b, seed + 2) - y[r, c]
                    d = math.sqrt(px * px + py * py)
                    if d < first:
                        second = first
                        first = d
                        name = _scramble(a, b, seed + 3)
                    elif d < second:
                        second = d
            distance[r, c] = (second - first) / 2
            label[r, c] = name
    return distance, label
