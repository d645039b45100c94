"""Compiled kernels of template tracking: warped templates, coarse-to-fine correlation, fine alignment."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from rover_iface.cameras.kernels import back_project_one, project_one
from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo_kernels import bilinear, few_parts

Image = npt.NDArray[np.float32]


@njit(cache=True, nogil=True, inline="always")
def cubic(image: Image, x: float, y: float) -> float:
    """Return the image [rows, columns] between pixels by Catmull-Rom cubics, at sample x and line y; bilinear
    near the border, NaN outside.
    """
    rows, columns = image.shape
    i, j = math.floor(x), math.floor(y)
    if i < 1 or j < 1 or i > columns - 3 or j > rows - 3:
        return bilinear(image, x, y)
    fx, fy = x - i, y - j
    ax = ((-0.5 * fx + 1.0) * fx - 0.5) * fx
    bx = (1.5 * fx - 2.5) * fx * fx + 1.0
    cx = ((-1.5 * fx + 2.0) * fx + 0.5) * fx
    dx = (0.5 * fx - 0.5) * fx * fx
    ay = ((-0.5 * fy + 1.0) * fy - 0.5) * fy
    by = (1.5 * fy - 2.5) * fy * fy + 1.0
    cy = ((-1.5 * fy + 2.0) * fy + 0.5) * fy
    dy = (0.5 * fy - 0.5) * fy * fy
    total = 0.0
    for n in range(4):
        row = j - 1 + n
        w = ay if n == 0 else by if n == 1 else cy if n == 2 else dy
        total += w * (
            ax * image[row, i - 1] + bx * image[row, i] + cx * image[row, i + 1] + dx * image[row, i + 2]
        )
    return total


@njit(cache=True, nogil=True)
def plane_template(
    source: Image,
    p_source: Array,
    source_px: Array,
    p_new: Array,
    center: Array,
    point: Array,
    normal: Array,
    point_source: Array,
    half: int,
    samples: int,
    out: Image,
) -> int:
    """Fill `out` with how the new camera should see the patch; return how many of its pixels are unknown.

    Each pixel's ray meets the plane through `point`; the same place, moved by `point_source - point` (the
    position was corrected since), is projected into the source image. The pixel map is shifted so that the
    middle of the template falls exactly on `source_px`. `samples` rays per pixel and axis average where the
    template shrinks.

    `source` [rows, columns] and `out` [2 half + 1, 2 half + 1] are images; `p_source` and `p_new` [26]
    cameras as `cameras.kernels` lays them out; `source_px` and `center` (of the new image) [2] pixels;
    `point`, `point_source`, m, and the unit `normal` [3] are in the frame of the cameras.
    """
    x0, y0, _a = project_one(p_source, point_source[0], point_source[1], point_source[2])
    shift_x, shift_y = source_px[0] - x0, source_px[1] - y0
    unknown = 0
    d = (point[0]) * normal[0] + point[1] * normal[1] + point[2] * normal[2]
    for j in range(-half, half + 1):
        for i in range(-half, half + 1):
            total, known = 0.0, 0
            for sj in range(samples):
                for si in range(samples):
                    u = center[0] + i + (si + 0.5) / samples - 0.5
                    v = center[1] + j + (sj + 0.5) / samples - 0.5
                    ox, oy, oz, dx, dy, dz = back_project_one(p_new, u, v)
                    down = dx * normal[0] + dy * normal[1] + dz * normal[2]
                    if abs(down) < 0.05:
                        continue
                    t = (d - ox * normal[0] - oy * normal[1] - oz * normal[2]) / down
                    if t <= 0.0:
                        continue
                    x, y, _b = project_one(
                        p_source,
                        ox + t * dx + point_source[0] - point[0],
                        oy + t * dy + point_source[1] - point[1],
                        oz + t * dz + point_source[2] - point[2],
                    )
                    if math.isnan(x):
                        continue
                    value = cubic(source, x + shift_x, y + shift_y)
                    if not math.isnan(value):
                        total += value
                        known += 1
            if known == samples * samples:
                out[j + half, i + half] = total / known
            else:
                out[j + half, i + half] = math.nan
                unknown += 1
    return unknown


@njit(cache=True, nogil=True)
def similarity_template(
    source: Image, source_px: Array, scale: float, roll: float, half: int, out: Image
) -> int:
    """Fill `out` [2 half + 1, 2 half + 1] with the source patch magnified by `scale` and turned by `roll`,
    rad (clockwise positive); return how many of its pixels are unknown.

    `source` is [rows, columns], the patch lies round its pixel `source_px` [2]. Kim et al. 2009, section
    4.3.1: the content is magnified and rolled, the window keeps its size.
    """
    c, s = math.cos(roll), math.sin(roll)
    samples = 1 if scale > 0.8 else 2 if scale > 0.4 else 3
    unknown = 0
    for j in range(-half, half + 1):
        for i in range(-half, half + 1):
            total, known = 0.0, 0
            for sj in range(samples):
                for si in range(samples):
                    u = i + (si + 0.5) / samples - 0.5
                    v = j + (sj + 0.5) / samples - 0.5
                    value = cubic(
                        source, source_px[0] + (c * u + s * v) / scale, source_px[1] + (c * v - s * u) / scale
                    )
                    if not math.isnan(value):
                        total += value
                        known += 1
            if known == samples * samples:
                out[j + half, i + half] = total / known
            else:
                out[j + half, i + half] = math.nan
                unknown += 1
    return unknown


@njit(cache=True, nogil=True)
def correlation(image: Image, template: Image, x: float, y: float, half: int) -> float:
    """Return the normalised cross-correlation (Kim et al. 2009, eq. 11) at a place between pixels, over the
    middle `half` of the template; -2 outside or flat.

    `image` [rows, columns] and `template`, square [side, side], NaN where unknown; the place is sample x,
    line y.
    """
    middle = template.shape[0] // 2
    n, sa, sb, saa, sbb, sab = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(-half, half + 1):
        for i in range(-half, half + 1):
            a = float(template[middle + j, middle + i])
            b = bilinear(image, x + i, y + j)
            if math.isnan(a) or math.isnan(b):
                continue
            n += 1.0
            sa += a
            sb += b
            saa += a * a
            sbb += b * b
            sab += a * b
    full = (2.0 * half + 1.0) ** 2
    if n < 0.6 * full:
        return -2.0
    va, vb = saa - sa * sa / n, sbb - sb * sb / n
    if va < 1e-7 or vb < 1e-7:
        return -2.0
    return (sab - sa * sb / n) / math.sqrt(va * vb)


WEIGHT = 0.30
"""Spread of the weights over a window, of its half side. Narrow: what lies at another depth than the target
moves otherwise. 0.45, 0.30, 0.22 leave 95 % of the errors below 1.9, 0.8, 1.0 cm on the tuning seeds."""
BLOCKS = 5
"""Blocks of a window to a side, of which each tells for itself where the template should go."""
SHAPE = 8
"""Parameters of an alignment: shift, four of shape, gain, offset."""


@njit(cache=True, nogil=True)
def align_shape(
    image: Image, template: Image, at: Array, half: int, shape_sd: float, most_px: float, spread: Array
) -> float:
    """Move `at` to where the template fits best, its shape left free; return the score there, -2 for no fit.

    Gauss and Newton on shift, the four of an affine shape (each kept within about `shape_sd` unless the
    pictures say otherwise: what a wrong slant does), gain and offset, the middle weighing most. `spread`
    (2, 2) is filled with the covariance of the shift, px^2: the sandwich of Liang and Zeger 1986,
    curvature of the fit on both sides, between them what the blocks of the window disagree by.
    Independent noise of pixels, grain that is correlated over a block, relief, and a background that
    moves otherwise all show in it, whatever made the picture.
    """
    middle = template.shape[0] // 2
    size = 2 * half + 1
    p = np.zeros(6)
    p[0], p[1] = at[0], at[1]
    gain, offset = _gain_and_offset(image, template, at[0], at[1], half)
    M = np.zeros((SHAPE, SHAPE))
    scores = np.zeros((BLOCKS * BLOCKS, SHAPE))
    weights = np.zeros(BLOCKS * BLOCKS)
    t = np.zeros(SHAPE)
    g = np.zeros(SHAPE)
    energy, total = 0.0, 0.0
    prior = 0.0
    for iteration in range(16):
        M[:, :] = 0.0
        scores[:, :] = 0.0
        weights[:] = 0.0
        energy, total, used = 0.0, 0.0, 0
        for j in range(-half, half + 1):
            for i in range(-half, half + 1):
                a = float(template[middle + j, middle + i])
                x = p[0] + (1.0 + p[2]) * i + p[3] * j
                y = p[1] + p[4] * i + (1.0 + p[5]) * j
                b = bilinear(image, x, y)
                if math.isnan(a) or math.isnan(b):
                    continue
                bx = 0.5 * (bilinear(image, x + 1.0, y) - bilinear(image, x - 1.0, y))
                by = 0.5 * (bilinear(image, x, y + 1.0) - bilinear(image, x, y - 1.0))
                if math.isnan(bx) or math.isnan(by):
                    continue
                q = math.exp(-0.5 * (i * i + j * j) / (WEIGHT * half) ** 2)
                r = a - gain * b - offset
                t[0], t[1] = gain * bx, gain * by
                t[2], t[3], t[4], t[5] = t[0] * i, t[0] * j, t[1] * i, t[1] * j
                t[6], t[7] = b, 1.0
                block = ((j + half) * BLOCKS // size) * BLOCKS + (i + half) * BLOCKS // size
                weights[block] += q
                for c in range(SHAPE):
                    scores[block, c] += q * t[c] * r
                    for d in range(c, SHAPE):
                        M[c, d] += q * t[c] * t[d]
                energy += q * r * r
                total += q
                used += 1
        if used < 60:
            return -2.0
        prior = energy / total / shape_sd**2
        for c in range(SHAPE):
            g[c] = 0.0
            for n in range(BLOCKS * BLOCKS):
                g[c] += scores[n, c]
            for d in range(c):
                M[c, d] = M[d, c]
        for c in range(2, 6):
            M[c, c] += prior
            g[c] -= prior * p[c]
        for c in range(SHAPE):
            M[c, c] = M[c, c] * (1.0 + 1e-6) + 1e-9
        s = np.linalg.solve(M, g)
        for c in range(2):
            p[c] += max(-1.0, min(1.0, s[c]))
        for c in range(2, 6):
            p[c] = max(-0.5, min(0.5, p[c] + s[c]))
        gain = min(5.0, max(0.2, gain + s[6]))
        offset += s[7]
        if math.hypot(p[0] - at[0], p[1] - at[1]) > most_px:
            return -2.0
        if iteration > 1 and abs(s[0]) + abs(s[1]) < 3e-3:
            break
    inverse = np.linalg.inv(M)
    between = np.zeros((SHAPE, SHAPE))
    for n in range(BLOCKS * BLOCKS):
        for c in range(SHAPE):
            for d in range(SHAPE):
                between[c, d] += scores[n, c] * scores[n, d]
    whole = inverse @ between @ inverse
    more = few_parts(weights)
    for c in range(2):
        for d in range(2):
            spread[c, d] = more * whole[c, d]
    at[0], at[1] = p[0], p[1]
    return _shaped_correlation(image, template, p, half)


@njit(cache=True, nogil=True)
def _shaped_correlation(image: Image, template: Image, p: Array, half: int) -> float:
    middle = template.shape[0] // 2
    n, sa, sb, saa, sbb, sab = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(-half, half + 1):
        for i in range(-half, half + 1):
            a = float(template[middle + j, middle + i])
            b = bilinear(image, p[0] + (1.0 + p[2]) * i + p[3] * j, p[1] + p[4] * i + (1.0 + p[5]) * j)
            if math.isnan(a) or math.isnan(b):
                continue
            n += 1.0
            sa += a
            sb += b
            saa += a * a
            sbb += b * b
            sab += a * b
    va, vb = saa - sa * sa / max(n, 1.0), sbb - sb * sb / max(n, 1.0)
    if va < 1e-7 or vb < 1e-7:
        return -2.0
    return (sab - sa * sb / n) / math.sqrt(va * vb)


@njit(cache=True, nogil=True)
def _gain_and_offset(image: Image, template: Image, x: float, y: float, half: int) -> tuple[float, float]:
    """Return gain and offset that make an image most like the template, the middle weighing most."""
    middle = template.shape[0] // 2
    n, sa, sb, sbb, sab = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(-half, half + 1):
        for i in range(-half, half + 1):
            a = float(template[middle + j, middle + i])
            b = bilinear(image, x + i, y + j)
            if math.isnan(a) or math.isnan(b):
                continue
            q = math.exp(-0.5 * (i * i + j * j) / (WEIGHT * half) ** 2)
            n += q
            sa += q * a
            sb += q * b
            sbb += q * b * b
            sab += q * a * b
    spread = sbb - sb * sb / max(n, 1e-9)
    if n <= 0.0 or spread < 1e-12:
        return 1.0, 0.0
    gain = (sab - sa * sb / n) / spread
    return gain, (sa - gain * sb) / n
