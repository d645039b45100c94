"""Compiled kernels of template tracking: warped templates, coarse-to-fine correlation, fine alignment."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from rover_iface.cameras.kernels import back_project_one, project_one
from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo_kernels import bilinear

Image = npt.NDArray[np.float32]


@njit(cache=True, nogil=True, inline="always")
def cubic(image: Image, x: float, y: float) -> float:
    """Return the image between pixels by Catmull-Rom cubics; bilinear near the border, NaN outside."""
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
    """Fill `out` with the source patch magnified by `scale` and turned by `roll` (clockwise positive).

    Kim et al. 2009, section 4.3.1: the content is magnified and rolled, the window keeps its size.
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
    """Return eq. 11 at a place between pixels, over the middle `half` of the template; -2 outside or flat."""
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


@njit(cache=True, nogil=True)
def align(image: Image, template: Image, at: Array, half: int) -> float:
    """Move `at` to where the template fits best, to a few hundredths of a pixel; return the score there.

    Gauss and Newton on shift, gain and offset, the middle weighing most (a narrow weight takes a
    fifth off the end error on rocks smaller than the window); `at` stays where it was if that wanders off
    by over 2.5 pixels.
    """
    middle = template.shape[0] // 2
    x, y = at[0], at[1]
    gain, offset = 1.0, 0.0
    M = np.zeros((4, 4))
    g = np.zeros(4)
    for iteration in range(15):
        M[:, :] = 0.0
        g[:] = 0.0
        used = 0
        for j in range(-half, half + 1):
            for i in range(-half, half + 1):
                a = float(template[middle + j, middle + i])
                b = bilinear(image, x + i, y + j)
                if math.isnan(a) or math.isnan(b):
                    continue
                bx = 0.5 * (bilinear(image, x + i + 1.0, y + j) - bilinear(image, x + i - 1.0, y + j))
                by = 0.5 * (bilinear(image, x + i, y + j + 1.0) - bilinear(image, x + i, y + j - 1.0))
                if math.isnan(bx) or math.isnan(by):
                    continue
                q = math.exp(-0.5 * (i * i + j * j) / (0.45 * half) ** 2)
                r = q * (a - gain * b - offset)
                t0, t1 = gain * bx, gain * by
                g[0] += t0 * r
                g[1] += t1 * r
                g[2] += b * r
                g[3] += r
                M[0, 0] += q * t0 * t0
                M[0, 1] += q * t0 * t1
                M[0, 2] += q * t0 * b
                M[0, 3] += q * t0
                M[1, 1] += q * t1 * t1
                M[1, 2] += q * t1 * b
                M[1, 3] += q * t1
                M[2, 2] += q * b * b
                M[2, 3] += q * b
                M[3, 3] += q
                used += 1
        if used < 30:
            break
        for c in range(4):
            M[c, c] = M[c, c] * (1.0 + 1e-6) + 1e-9
            for d in range(c):
                M[c, d] = M[d, c]
        s = np.linalg.solve(M, g)
        x += max(-1.0, min(1.0, s[0]))
        y += max(-1.0, min(1.0, s[1]))
        gain = min(5.0, max(0.2, gain + s[2]))
        offset += s[3]
        if math.hypot(x - at[0], y - at[1]) > 2.5:
            x, y = at[0], at[1]
            break
        if iteration > 1 and abs(s[0]) + abs(s[1]) < 3e-3:
            break
    score = correlation(image, template, x, y, half)
    if score >= correlation(image, template, at[0], at[1], half) - 0.02:
        at[0], at[1] = x, y
        return score
    return correlation(image, template, at[0], at[1], half)
