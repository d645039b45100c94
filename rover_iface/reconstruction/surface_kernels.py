"""Compiled loop that puts a surface of neighbouring pixels into a raster of heights."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from rover_iface.cameras.model import Array


@njit(cache=True, nogil=True)
def put_triangle(
    heights: Array,
    counts: Array,
    west: float,
    south: float,
    spacing: float,
    a: Array,
    b: Array,
    c: Array,
    slack: float,
) -> None:
    """Put the triangle of corners `a`, `b`, `c` (3,), m, into `heights` [rows, columns] and `counts`, in
    place.

    A post that has a height already takes the mean if the two lie within `slack`, m, of each other (the
    surface folds by its noise), else the higher of the two: a rock stands over the ground behind it.
    """
    rows, columns = heights.shape
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if abs(area) < 1e-12:
        return
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
            if u < -1e-9 or v < -1e-9 or w < -1e-9:
                continue
            z = u * a[2] + v * b[2] + w * c[2]
            n = counts[r, col]
            if n == 0.0 or z > heights[r, col] + slack:
                heights[r, col] = z
                counts[r, col] = 1.0
            elif z > heights[r, col] - slack:
                heights[r, col] = (heights[r, col] * n + z) / (n + 1.0)
                counts[r, col] = n + 1.0


@njit(cache=True, nogil=True)
def drape_pixels(
    points: Array,
    disparities: Array,
    slack: Array,
    most_jump_px: float,
    noise_px: float,
    jump_share: float,
    west: float,
    south: float,
    spacing: float,
    heights: Array,
    counts: Array,
) -> None:
    """Put the surface through neighbouring pixels into `heights` and `counts` [rows, columns], in place.

    `points` [lines, samples, 3], m; `disparities` [lines, samples], px, NaN where nothing was matched;
    `slack` [lines, samples], m, as `put_triangle` takes it. Three neighbours are a piece of surface if all
    were matched and no two differ by more than `most_jump_px`, nor by more than `noise_px` and `jump_share`
    of the least: beyond that the farther one is hidden in part by the nearer.
    """
    lines, samples = disparities.shape
    corners = np.array([[0, 0], [0, 1], [1, 1], [1, 0]])
    for i in range(lines - 1):
        for j in range(samples - 1):
            for first in (1, 3):
                i0, j0 = i + corners[0, 0], j + corners[0, 1]
                i1, j1 = i + corners[first, 0], j + corners[first, 1]
                i2, j2 = i + corners[2, 0], j + corners[2, 1]
                low = min(disparities[i0, j0], disparities[i1, j1], disparities[i2, j2])
                high = max(disparities[i0, j0], disparities[i1, j1], disparities[i2, j2])
                known = disparities[i0, j0] + disparities[i1, j1] + disparities[i2, j2]
                if math.isnan(known) or high - low > min(most_jump_px, noise_px + jump_share * low):
                    continue
                put_triangle(
                    heights,
                    counts,
                    west,
                    south,
                    spacing,
                    points[i0, j0],
                    points[i1, j1],
                    points[i2, j2],
                    slack[i0, j0],
                )
