"""Heights between the posts of a raster."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.floating]


@njit(cache=True, nogil=True)
def _between(heights: Array, west: float, south: float, spacing: float, x: float, y: float) -> float:
    rows, columns = heights.shape
    c = min(max((x - west) / spacing, 0.0), columns - 1.0)
    r = min(max((y - south) / spacing, 0.0), rows - 1.0)
    c0, r0 = min(int(c), columns - 2), min(int(r), rows - 2)
    across, up = c - c0, r - r0
    low, high = heights[r0, c0], heights[r0 + 1, c0]
    lower = low + (heights[r0, c0 + 1] - low) * across
    upper = high + (heights[r0 + 1, c0 + 1] - high) * across
    return float(lower + (upper - lower) * up)


@njit(cache=True, nogil=True)
def bilinear(heights: Array, west: float, south: float, spacing: float, x: Array, y: Array) -> Array:
    """Return bilinear heights [n], m, at points `x` and `y` [n], site frame, m; NaN where a point is none.

    `heights` [rows, columns], row 0 south, stand `spacing` apart, the first post at (`west`, `south`). What
    lies beyond the posts is moved to the border.
    """
    found = np.empty(x.shape)
    for k in range(x.size):
        if np.isnan(x[k]) or np.isnan(y[k]):
            found[k] = np.nan
        else:
            found[k] = _between(heights, west, south, spacing, x[k], y[k])
    return found


@njit(cache=True, nogil=True)
def fill(
    heights: Array, known: Array, west: float, south: float, spacing: float, x: Array, y: Array, found: Array
) -> int:
    """Put bilinear heights, m, into `found` [n] where it is NaN and the cells of the posts hold the point,
    and return for how many points there is still none.

    The posts are those of `bilinear`; `known` [rows, columns] is NaN where nothing is known.
    """
    half = spacing / 2
    east = west + (heights.shape[1] - 0.5) * spacing
    north = south + (heights.shape[0] - 0.5) * spacing
    left = 0
    for k in range(x.size):
        if not np.isnan(found[k]):
            continue
        inside = west - half <= x[k] <= east and south - half <= y[k] <= north
        if inside and np.isfinite(_between(known, west, south, spacing, x[k], y[k])):
            found[k] = _between(heights, west, south, spacing, x[k], y[k])
        left += np.isnan(found[k])
    return left
