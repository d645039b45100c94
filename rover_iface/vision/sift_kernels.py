"""Compiled parts of feature matching."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

END_PX = 2.0
"""How far beyond the ends of a segment a pixel still counts as beside it."""


@njit(nogil=True, cache=True)
def near_segments(
    begin: NDArray[np.float64],
    end: NDArray[np.float64],
    pixels: NDArray[np.float64],
    row_px: float,
    out: NDArray[np.bool_],
) -> None:
    """Write (n, m) which pixels (m, 2), (sample, line), lie within `row_px` of which segment, given by its
    ends (n, 2).

    One without finite ends, or without length, has none beside it.
    """
    for i in range(len(begin)):
        x, y = end[i, 0] - begin[i, 0], end[i, 1] - begin[i, 1]
        length = math.hypot(x, y)
        if not (length > 0.0 and length < math.inf):
            out[i] = False
            continue
        x, y = x / length, y / length
        for j in range(len(pixels)):
            u, v = pixels[j, 0] - begin[i, 0], pixels[j, 1] - begin[i, 1]
            t = u * x + v * y
            out[i, j] = abs(u * y - v * x) < row_px and t > -END_PX and t < length + END_PX
