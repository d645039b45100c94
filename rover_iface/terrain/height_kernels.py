"""Heights between the posts of a raster."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.floating]


@njit(cache=True, nogil=True)
def bilinear(heights: Array, west: float, south: float, spacing: float, x: Array, y: Array) -> Array:
    """Return bilinear heights [n], m, at points `x` and `y` [n], site frame, m; NaN where a point is none.

    `heights` [rows, columns], row 0 south, stand `spacing` apart, the first post at (`west`, `south`). What
    lies beyond the posts is moved to the border.
    """
    rows, columns = heights.shape
    found = np.empty(x.shape)
    for k in range(x.size):
        if np.isnan(x[k]) or np.isnan(y[k]):
            found[k] = np.nan
            continue
        c = min(max((x[k] - west) / spacing, 0.0), columns - 1.0)
        r = min(max((y[k] - south) / spacing, 0.0), rows - 1.0)
        c0, r0 = min(int(c), columns - 2), min(int(r), rows - 2)
        across, up = c - c0, r - r0
        low, high = heights[r0, c0], heights[r0 + 1, c0]
        lower = low + (heights[r0, c0 + 1] - low) * across
        upper = high + (heights[r0 + 1, c0 + 1] - high) * across
        found[k] = lower + (upper - lower) * up
    return found
