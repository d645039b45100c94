"""Compiled kernels of the ranging of one spot."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from rover_iface.cameras.kernels import back_project_one, project_one
from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo_kernels import bilinear, few_parts

Image = npt.NDArray[np.float32]
CUT2 = 9.0
"""Squared residual, in expected deviations, at which a pixel counts a quarter (Geman and McClure 1987)."""
ROW_PX2, GAIN2 = 0.25, 0.04
"""Variance of what the rows of a pair are off, and of the gain between its images."""
STEEPEST = 3.0
"""Most slant, in deviations of its prior."""
FREE_STEPS = 3
"""Steps after which neighbours of pixels that are off the plane count as little as these: an outline mixes
what is on both sides, and a rock curves away towards it."""
TOLD = 0.02
"""Least share of what gradients seem to tell that is believed, so that an error is finite."""
BLOCKS = 3
"""Blocks of a window to a side, of which each tells for itself what the disparity should be."""


@njit(cache=True, nogil=True)
def lay_out(
    left: Image,
    p_left: Array,
    p_right: Array,
    pixel: Array,
    half: int,
    reach: float,
    blur: float,
    noise: float,
    inverse: float,
    window: Array,
) -> int:
    """Fill `window` [n, 9] with the pixels round `pixel` [2] of the left image; return how many both images
    may show.

    A row holds the offset (sample, line), the brightness, where the right image [rows, columns] has it for an
    inverse range, 1/m, how far it moves there for each 1/m, its weight by distance (`reach`, px) and the
    variance of its brightness: noise, and `blur` px of misplacement on its slope. `p_left` and `p_right` [26]
    are cameras as `kernels` lays them out.
    """
    small, count, n = 1e-3 * inverse, 0, 0
    for j in range(-half, half + 1):
        for i in range(-half, half + 1):
            u, v = pixel[0] + i, pixel[1] + j
            a = bilinear(left, u, v)
            gx = 0.5 * (bilinear(left, u + 1.0, v) - bilinear(left, u - 1.0, v))
            gy = 0.5 * (bilinear(left, u, v + 1.0) - bilinear(left, u, v - 1.0))
            ox, oy, oz, dx, dy, dz = back_project_one(p_left, u, v)
            x, y, _a = project_one(p_right, ox + dx / inverse, oy + dy / inverse, oz + dz / inverse)
            w = inverse + small
            x1, y1, _b = project_one(p_right, ox + dx / w, oy + dy / w, oz + dz / w)
            row = window[n]
            n += 1
            row[:] = 0.0
            if math.isnan(a + gx + gy) or math.isnan(x + x1):
                continue
            row[0], row[1], row[2], row[3], row[4] = i, j, a, x, y
            row[5], row[6] = (x1 - x) / small, (y1 - y) / small
            row[7] = math.exp(-0.5 * (i * i + j * j) / reach**2)
            row[8] = noise**2 + blur**2 * (gx * gx + gy * gy)
            count += 1
    return count


@njit(cache=True, nogil=True)
def worst_beside(on_it: Array, size: int, out: Array) -> None:
    """Fill `out` [n] with the least of `on_it` [n] over each pixel of a window and its eight neighbours; n is
    size^2.
    """
    for j in range(size):
        for i in range(size):
            least = 1.0
            for y in range(max(0, j - 1), min(size, j + 2)):
                for x in range(max(0, i - 1), min(size, i + 2)):
                    least = min(least, on_it[y * size + x])
            out[j * size + i] = least


@njit(cache=True, nogil=True)
def fit_surface(
    right: Image,
    window: Array,
    half: int,
    inverse: float,
    unit: float,
    slant: float,
    steps: int,
    plane: Array,
) -> tuple[float, float]:
    """Refine `plane` [6] by the pixels that lie on it; return its cost, and the variance of its disparity,
    px^2.

    The cost is the mean over the window [n, 9] of `lay_out` of what each pixel is off, squared, in expected
    deviations, and at most `CUT2`; beside it what the nine in the middle are off. A plane holds the inverse
    range, 1/m, its slopes per pixel, the shift of the rows, px, gain and offset. `unit` is the pixels of
    disparity for each 1/m, `slant` the prior of the slopes in pixels of disparity per pixel.

    The variance is the sandwich of Liang and Zeger 1986 between the blocks of the window, by those pixels.
    Gradients that noise makes are left out of what they tell (errors in variables, Fuller 1987): a window of
    bare noise seems to be known to 0.2 px otherwise, wherever it is looked for.
    """
    m, g, t = np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    scores, seen = np.zeros((BLOCKS * BLOCKS, 6)), np.zeros(BLOCKS * BLOCKS)
    size = 2 * half + 1
    on_it, beside = np.ones(len(window)), np.ones(len(window))
    cost, total, middle, nine = 0.0, 0.0, 0.0, 0.0
    bare, held, squares = 0.0, 0.0, 0.0
    for step in range(steps + 1):
        m[:, :], g[:] = 0.0, 0.0
        scores[:, :], seen[:] = 0.0, 0.0
        cost, total, middle, nine = 0.0, 0.0, 0.0, 0.0
        bare, held, squares = 0.0, 0.0, 0.0
        if step > FREE_STEPS:
            worst_beside(on_it, size, beside)
        for k in range(len(window)):
            if window[k, 7] == 0.0:
                on_it[k] = 0.0
                continue
            i, j, near, variance = window[k, 0], window[k, 1], window[k, 7], window[k, 8]
            shift = plane[0] - inverse + plane[1] * i + plane[2] * j
            x, y = window[k, 3] + window[k, 5] * shift, window[k, 4] + window[k, 6] * shift + plane[3]
            b = bilinear(right, x, y)
            gx = 0.5 * (bilinear(right, x + 1.0, y) - bilinear(right, x - 1.0, y))
            gy = 0.5 * (bilinear(right, x, y + 1.0) - bilinear(right, x, y - 1.0))
            total += near
            if math.isnan(b + gx + gy):
                cost += near * CUT2
                on_it[k] = 0.0
                continue
            r = window[k, 2] - plane[4] * b - plane[5]
            off = r * r / variance
            share = CUT2 / (CUT2 + off)
            on_it[k] = share * share
            q = near / variance * (beside[k] if step > FREE_STEPS else on_it[k])
            cost += near * share * off
            if abs(i) <= 1.0 and abs(j) <= 1.0:
                middle += share * off
                nine += 1.0
            t[0] = plane[4] * (gx * window[k, 5] + gy * window[k, 6]) / unit
            t[1], t[2], t[3], t[4], t[5] = t[0] * i, t[0] * j, plane[4] * gy, b, 1.0
            # two pixels of one image, halved, against what is left of one pixel of both
            bare += 0.25 * q * r * r * (window[k, 5] ** 2 + window[k, 6] ** 2) / unit**2
            held += q * variance
            squares += (q * variance) ** 2
            block = int((j + half) * BLOCKS / (2.0 * half + 1.0)) * BLOCKS
            block += int((i + half) * BLOCKS / (2.0 * half + 1.0))
            seen[block] += q * variance
            for c in range(6):
                g[c] += q * t[c] * r
                scores[block, c] += q * t[c] * r
                for d in range(6):
                    m[c, d] += q * t[c] * t[d]
        for c in range(1, 3):
            m[c, c] += 1.0 / slant**2
            g[c] -= plane[c] * unit / slant**2
        m[3, 3] += 1.0 / ROW_PX2
        g[3] -= plane[3] / ROW_PX2
        m[4, 4] += 1.0 / GAIN2
        g[4] -= (plane[4] - 1.0) / GAIN2
        for c in range(6):
            m[c, c] += 1e-9 * (m[c, c] + 1.0)
        if step == steps:
            break
        s = np.linalg.solve(m, g)
        plane[0] += max(-1.0, min(1.0, s[0])) / unit
        for c in range(1, 3):
            limit = STEEPEST * slant / unit
            plane[c] = max(-limit, min(limit, plane[c] + s[c] / unit))
        plane[3] += max(-0.5, min(0.5, s[3]))
        plane[4] = max(0.3, plane[4] + s[4])
        plane[5] += s[5]
        if plane[0] <= 0.0:
            return math.inf, math.inf
    if nine == 0.0:
        return math.inf, math.inf
    back = np.linalg.inv(m)
    variance = few_parts(seen) * (back @ (scores.T @ scores) @ back)[0, 0]
    pixels = held * held / max(squares, 1e-12)
    bare *= pixels / max(1.0, pixels - len(m))  # the fit has taken up some of what they were off
    told = max(TOLD, 1.0 - bare * back[0, 0])
    return cost / total + middle / nine, variance / told**2
