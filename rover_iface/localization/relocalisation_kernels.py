"""Compiled loops of relocalisation: a map read at a stop's cells, and cells counted on a raster."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]


@njit(cache=True, nogil=True)
def read_map(
    values: F32,
    west: float,
    south: float,
    spacing: float,
    places: F64,
    stretch: F64,
    pose: F64,
    out: F64,
    slopes: F64,
) -> None:
    """Fill the map's values under a stop's cells, and what they change by with the pose.

    Parameters
    ----------
    values, west, south, spacing
        The map (r, c), row 0 south, NaN unknown; place of its first post, m.
    places, stretch
        (n, 3) m, counted from the stop's eye in the believed axes; (n, 3) m / px of disparity.
    pose
        (4,): east, north of the eye, turn, disparity by which ranges are off; m, rad, px.
    out, slopes
        (n,), NaN where the map is unknown; (n, 4), by the numbers of the pose.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    n_rows, n_columns = values.shape
    for k in range(places.shape[0]):
        x = places[k, 0] + pose[3] * stretch[k, 0]
        y = places[k, 1] + pose[3] * stretch[k, 1]
        east, north = c * x - s * y, s * x + c * y
        u = (pose[0] + east - west) / spacing
        v = (pose[1] + north - south) / spacing
        i, j = math.floor(u), math.floor(v)
        out[k] = math.nan
        for p in range(4):
            slopes[k, p] = 0.0
        if i < 0 or j < 0 or i > n_columns - 2 or j > n_rows - 2:
            continue
        a, b = values[j, i], values[j, i + 1]
        d, e = values[j + 1, i], values[j + 1, i + 1]
        fu, fv = u - i, v - j
        level = (a * (1 - fu) + b * fu) * (1 - fv) + (d * (1 - fu) + e * fu) * fv
        if not math.isfinite(level):
            continue
        gx = ((b - a) * (1 - fv) + (e - d) * fv) / spacing
        gy = ((d - a) * (1 - fu) + (e - b) * fu) / spacing
        out[k] = level
        slopes[k, 0], slopes[k, 1] = gx, gy
        slopes[k, 2] = gy * east - gx * north
        slopes[k, 3] = gx * (c * stretch[k, 0] - s * stretch[k, 1]) + gy * (
            s * stretch[k, 0] + c * stretch[k, 1]
        )


@njit(cache=True, nogil=True)
def add_cells(rows: I64, columns: I64, half: npt.NDArray[np.bool_], weights: F64, own: F64, out: F32) -> None:
    """Add a stop's cells to a raster `out` (3, r, c, 2): weight, weight s, weight s^2, of each half.

    Cell k falls on (`rows`[k], `columns`[k]); `own` is its value s.
    """
    for k in range(len(rows)):
        side = 1 if half[k] else 0
        r, c = rows[k], columns[k]
        w = weights[k]
        out[0, r, c, side] += w
        out[1, r, c, side] += w * own[k]
        out[2, r, c, side] += w * own[k] * own[k]
