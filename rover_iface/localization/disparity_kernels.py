"""Compiled part of the ground points: disparities of semi-global matching refined by least squares."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]


@njit(cache=True, nogil=True)
def refine_disparities(
    left: F32,
    right: F32,
    pixels: F64,
    disparities: F64,
    half: tuple[int, int],
    passes: int,
    limit_px: float,
    out: F64,
) -> None:
    """Fill disparities `out` [n], px, at which windows of both images of an aligned pair differ least.

    `left` and `right` [rows, columns] are the images, `pixels` [n, 2] whole samples and lines of the left
    one, `disparities` [n] where to begin, `half` the half width and half height of the window. Brightness may
    differ by a constant. A disparity that moves by more than `limit_px`, or whose window has no contrast
    along the line or leaves an image, stays as it was (Lucas and Kanade 1981, one parameter).
    """
    rows, columns = left.shape
    wide, high = half
    count = (2 * wide + 1) * (2 * high + 1)
    for n in range(len(pixels)):
        out[n] = disparities[n]
        x, y, d = round(pixels[n, 0]), round(pixels[n, 1]), disparities[n]
        if y - high < 0 or y + high >= rows or x - wide < 0 or x + wide >= columns:
            continue
        good = True
        for _ in range(passes):
            if x - wide - d < 2.0 or x + wide - d > columns - 4.0:
                good = False
                break
            start = x - d
            whole = math.floor(start)
            f = start - whole
            sr = sg = srg = sgg = 0.0
            for j in range(y - high, y + high + 1):
                for i in range(-wide, wide + 1):
                    k = whole + i
                    b = right[j, k] * (1.0 - f) + right[j, k + 1] * f
                    here, next_ = right[j, k + 1] - right[j, k - 1], right[j, k + 2] - right[j, k]
                    g = 0.5 * (here * (1.0 - f) + next_ * f)
                    r = left[j, x + i] - b
                    sr += r
                    sg += g
                    srg += r * g
                    sgg += g * g
            spread = sgg - sg * sg / count
            if spread < 1e-6 * count:
                good = False
                break
            d -= (srg - sr * sg / count) / spread
            if abs(d - disparities[n]) > limit_px:
                good = False
                break
        if good:
            out[n] = d
