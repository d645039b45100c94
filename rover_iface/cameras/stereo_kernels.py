"""Compiled kernels of point stereo."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from rover_iface.cameras.kernels import back_project_one, between, project_one
from rover_iface.cameras.model import Array

Image = npt.NDArray[np.float32]


@njit(cache=True, nogil=True, inline="always")
def bilinear(image: Image, x: float, y: float) -> float:
    """Return the image [rows, columns] between pixels, at sample x and line y; NaN outside."""
    rows, columns = image.shape
    if not (0.0 <= x <= columns - 1.0 and 0.0 <= y <= rows - 1.0):
        return math.nan
    return between(image, x, y)


@njit(cache=True, nogil=True)
def centred_patch(image: Image, u: float, v: float, half: int) -> tuple[Array, float]:
    """Return a square patch [2 half + 1, 2 half + 1] less its mean, and its norm; 0 if it leaves the image.

    The patch is that of `image` [rows, columns] round sample u and line v.
    """
    size = 2 * half + 1
    patch = np.empty((size, size))
    mean = 0.0
    for j in range(size):
        for i in range(size):
            patch[j, i] = bilinear(image, u + i - half, v + j - half)
            mean += patch[j, i]
    if math.isnan(mean):
        return patch, 0.0
    mean /= size * size
    square = 0.0
    for j in range(size):
        for i in range(size):
            patch[j, i] -= mean
            square += patch[j, i] * patch[j, i]
    return patch, math.sqrt(square)


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def patch_score(patch: Array, norm: float, right: Image, x: float, y: float) -> float:
    """Return the normalised cross-correlation of a centred patch with the image at a place between pixels.

    `patch` [2 half + 1, 2 half + 1] has a mean of zero and the norm `norm`; `right` is [rows, columns], its
    place sample x and line y. -2 if the patch leaves the image there, or either is flat. Kim et al. 2009, eq.
    11.
    """
    size = patch.shape[0]
    half = size // 2
    rows, columns = right.shape
    if not (half <= x <= columns - 1.0 - half and half <= y <= rows - 1.0 - half):
        return -2.0
    # all pixels of the patch lie between pixels in the same way
    i0, j0 = min(int(x), columns - 2 - half), min(int(y), rows - 2 - half)
    fx, fy = x - i0, y - j0
    w00, w01 = (1.0 - fx) * (1.0 - fy), fx * (1.0 - fy)
    w10, w11 = (1.0 - fx) * fy, fx * fy
    sb, sbb, sab = 0.0, 0.0, 0.0
    for j in range(size):
        jj = j0 + j - half
        for i in range(size):
            ii = i0 + i - half
            b = (
                w00 * right[jj, ii]
                + w01 * right[jj, ii + 1]
                + w10 * right[jj + 1, ii]
                + w11 * right[jj + 1, ii + 1]
            )
            sb += b
            sbb += b * b
            sab += patch[j, i] * b
    spread = sbb - sb * sb / (size * size)
    if norm * norm < 1e-9 or spread < 1e-9:
        return -2.0
    return sab / (norm * math.sqrt(spread))


@njit(cache=True, nogil=True)
def search_epipolar(
    left: Image,
    right: Image,
    p_left: Array,
    p_right: Array,
    pixel: Array,
    half: int,
    rows: float,
    inverse_far: float,
    inverse_near: float,
) -> tuple[float, float, float]:
    """Return inverse range, 1/m, row offset, px, and score of the best place along the epipolar curve.

    Images [rows, columns]; `p_left` and `p_right` [26], cameras as `kernels` lays them out; `pixel` [2] of
    the left image. Coarse steps of two pixels with every second pixel of the window first, then all rows
    within the tolerance about the best eight.
    """
    ox, oy, oz, dx, dy, dz = back_project_one(p_left, pixel[0], pixel[1])
    # inverse range is close to linear along the curve
    x0, y0, _a = project_one(p_right, ox + dx / inverse_far, oy + dy / inverse_far, oz + dz / inverse_far)
    x1, y1, _b = project_one(p_right, ox + dx / inverse_near, oy + dy / inverse_near, oz + dz / inverse_near)
    if math.isnan(x0) or math.isnan(x1):
        return 0.0, 0.0, -2.0
    length = math.hypot(x1 - x0, y1 - y0)
    count = max(3, int(math.ceil(length)) + 1)  # noqa: RUF046
    scores = np.full(count, -2.0)
    span = int(rows)
    for s in range(count):
        w = inverse_far + (inverse_near - inverse_far) * s / (count - 1.0)
        x, y, _c = project_one(p_right, ox + dx / w, oy + dy / w, oz + dz / w)
        if math.isnan(x):
            continue
        for row in range(-span, span + 1, 2 if span >= 2 else 1):
            n, sa, sb, saa, sbb, sab = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            ok = True
            xi, yi = math.floor(x + 0.5), math.floor(y + row + 0.5)
            ui, vi = math.floor(pixel[0] + 0.5), math.floor(pixel[1] + 0.5)
            if (
                xi - half < 0
                or yi - half < 0
                or xi + half >= right.shape[1]
                or yi + half >= right.shape[0]
                or ui - half < 0
                or vi - half < 0
                or ui + half >= left.shape[1]
                or vi + half >= left.shape[0]
            ):
                ok = False
            if not ok:
                continue
            for j in range(-half, half + 1, 2):
                for i in range(-half, half + 1, 2):
                    a, b = left[vi + j, ui + i], right[yi + j, xi + i]
                    n += 1.0
                    sa += a
                    sb += b
                    saa += a * a
                    sbb += b * b
                    sab += a * b
            va, vb = saa - sa * sa / n, sbb - sb * sb / n
            if va > 1e-9 and vb > 1e-9:
                scores[s] = max(scores[s], (sab - sa * sb / n) / math.sqrt(va * vb))
    best, best_w, best_row = -2.0, 0.0, 0.0
    patch, norm = centred_patch(left, pixel[0], pixel[1], half)
    if norm == 0.0:
        return best_w, best_row, best
    for _ in range(8):
        s = int(np.argmax(scores))
        if scores[s] <= -2.0:
            break
        for t in range(max(0, s - 1), min(count, s + 2)):
            scores[t] = -2.0
        for part in range(-2, 3):
            w = inverse_far + (inverse_near - inverse_far) * (s + 0.5 * part) / (count - 1.0)
            if w <= 0.0:
                continue
            x, y, _d = project_one(p_right, ox + dx / w, oy + dy / w, oz + dz / w)
            if math.isnan(x):
                continue
            for row in range(-span, span + 1):
                score = patch_score(patch, norm, right, x, y + row)
                if score > best:
                    best, best_w, best_row = score, w, float(row)
    return best_w, best_row, best


@njit(cache=True, nogil=True)
def refine_plane(
    left: Image,
    right: Image,
    p_left: Array,
    p_right: Array,
    pixel: Array,
    half: int,
    row_offset: float,
    slant_sigma: float,
    plane: Array,
    right_px: Array,
) -> float:
    """Refine `plane` [3] (inverse range, 1/m, and its slopes per pixel) and `right_px` [2]; return the
    patches' score.

    Images [rows, columns]; `p_left` and `p_right` [26], cameras as `kernels` lays them out; `pixel` [2] of
    the left image. Gauss and Newton on brightness with gain and offset left free, one row shift, and a prior
    that keeps the slant below `slant_sigma` (tangent) unless the patch says otherwise.
    """
    size = 2 * half + 1
    count = size * size
    if half < 3:
        return -2.0
    value = np.empty(count)
    base_x, base_y = np.empty(count), np.empty(count)
    step_x, step_y = np.empty(count), np.empty(count)
    du, dv, weight = np.empty(count), np.empty(count), np.empty(count)
    w0 = plane[0]
    small = 1e-3 * w0
    n = 0
    for j in range(-half, half + 1):
        for i in range(-half, half + 1):
            a = bilinear(left, pixel[0] + i, pixel[1] + j)
            if math.isnan(a):
                continue
            ox, oy, oz, dx, dy, dz = back_project_one(p_left, pixel[0] + i, pixel[1] + j)
            x, y, _a = project_one(p_right, ox + dx / w0, oy + dy / w0, oz + dz / w0)
            w1 = w0 + small
            x1, y1, _b = project_one(p_right, ox + dx / w1, oy + dy / w1, oz + dz / w1)
            if math.isnan(x) or math.isnan(x1):
                continue
            value[n], base_x[n], base_y[n] = a, x, y
            step_x[n], step_y[n] = (x1 - x) / small, (y1 - y) / small
            du[n], dv[n] = i, j
            weight[n] = math.exp(-0.5 * (i * i + j * j) / (0.6 * half) ** 2)
            n += 1
    if n < 25:
        return -2.0
    # slopes wu, wv are per pixel: a plane at 45 degrees has |slope| = w0 / focal
    focal = 1.0 / _pixel_angle(p_left, pixel)
    prior = 1.0 / (slant_sigma * w0 / focal) ** 2
    w, wu, wv, row = w0, 0.0, 0.0, row_offset
    gain, offset = 1.0, 0.0
    unit_w = 1.0 / max(1e-12, math.hypot(step_x[n // 2], step_y[n // 2]))  # inverse range of one pixel
    M = np.zeros((6, 6))
    g = np.zeros(6)
    for iteration in range(12):
        M[:, :] = 0.0
        g[:] = 0.0
        energy, used = 0.0, 0.0
        for k in range(n):
            shift = w - w0 + wu * du[k] + wv * dv[k]
            x, y = base_x[k] + step_x[k] * shift, base_y[k] + step_y[k] * shift + row
            b = bilinear(right, x, y)
            if math.isnan(b):
                continue
            bx = 0.5 * (bilinear(right, x + 1.0, y) - bilinear(right, x - 1.0, y))
            by = 0.5 * (bilinear(right, x, y + 1.0) - bilinear(right, x, y - 1.0))
            if math.isnan(bx) or math.isnan(by):
                continue
            r = value[k] - gain * b - offset
            along = gain * (bx * step_x[k] + by * step_y[k]) * unit_w
            row_d = gain * by
            t0, t1, t2, t3, t4, t5 = along, along * du[k], along * dv[k], row_d, b, 1.0
            q = weight[k]
            for c in range(6):
                tc = (
                    t0
                    if c == 0
                    else t1
                    if c == 1
                    else t2
                    if c == 2
                    else t3
                    if c == 3
                    else t4
                    if c == 4
                    else t5
                )
                g[c] += q * tc * r
                for d in range(c, 6):
                    td = (
                        t0
                        if d == 0
                        else t1
                        if d == 1
                        else t2
                        if d == 2
                        else t3
                        if d == 3
                        else t4
                        if d == 4
                        else t5
                    )
                    M[c, d] += q * tc * td
            energy += q * r * r
            used += q
        if used < 5.0:
            return -2.0
        for c in range(6):
            for d in range(c):
                M[c, d] = M[d, c]
        noise = max(energy / used, 1e-6)
        M[1, 1] += noise * prior * unit_w * unit_w
        M[2, 2] += noise * prior * unit_w * unit_w
        g[1] -= noise * prior * unit_w * wu
        g[2] -= noise * prior * unit_w * wv
        M[3, 3] += noise / 0.25
        g[3] -= noise * (row - 0.0) / 0.25
        for c in range(6):
            M[c, c] += 1e-9 * (M[c, c] + 1.0)
        s = np.linalg.solve(M, g)
        move = max(-1.5, min(1.5, s[0]))
        w += move * unit_w
        wu += s[1] * unit_w
        wv += s[2] * unit_w
        limit = 6.0 * w0 / focal
        wu, wv = max(-limit, min(limit, wu)), max(-limit, min(limit, wv))
        row += max(-0.5, min(0.5, s[3]))
        gain += s[4]
        offset += s[5]
        if gain <= 0.05:
            gain = 0.05
        if abs(s[0]) < 2e-3 and iteration > 2:
            break
    if w <= 0.0:
        return -2.0
    m, sa, sb, saa, sbb, sab = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        shift = w - w0 + wu * du[k] + wv * dv[k]
        b = bilinear(right, base_x[k] + step_x[k] * shift, base_y[k] + step_y[k] * shift + row)
        if math.isnan(b):
            continue
        q = weight[k]
        m += q
        sa += q * value[k]
        sb += q * b
        saa += q * value[k] * value[k]
        sbb += q * b * b
        sab += q * value[k] * b
    va, vb = saa - sa * sa / m, sbb - sb * sb / m
    plane[0], plane[1], plane[2] = w, wu, wv
    ox, oy, oz, dx, dy, dz = back_project_one(p_left, pixel[0], pixel[1])
    x, y, _c = project_one(p_right, ox + dx / w, oy + dy / w, oz + dz / w)
    right_px[0], right_px[1] = x, y + row
    if math.isnan(x) or va < 1e-9 or vb < 1e-9:
        return -2.0
    return (sab - sa * sb / m) / math.sqrt(va * vb)


@njit(cache=True, nogil=True)
def _pixel_angle(p: Array, pixel: Array) -> float:
    """Return the angle between the rays of two neighbouring pixels."""
    _x, _y, _z, ax, ay, az = back_project_one(p, pixel[0], pixel[1])
    _u, _v, _w, bx, by, bz = back_project_one(p, pixel[0] + 1.0, pixel[1])
    return math.sqrt((ax - bx) ** 2 + (ay - by) ** 2 + (az - bz) ** 2)


BLOCKS = 3
"""Blocks of a patch to a side, of which each tells for itself what the disparity should be."""


@njit(cache=True, nogil=True)
def disparity_spread(
    left: Image,
    right: Image,
    p_left: Array,
    p_right: Array,
    pixel: Array,
    half: int,
    row: float,
    slant_sigma: float,
    plane: Array,
) -> float:
    """Return the variance, px^2, of the disparity that `refine_plane` has found; -1 where it cannot be told.

    The sandwich of Liang and Zeger 1986: what the blocks of the patch disagree by, between the curvature of
    the fit (disparity, both slopes, gain, offset). Noise, repetitive grain, relief and an occluding edge show
    in it, whatever made the pictures.

    Shapes as for `refine_plane`: images [rows, columns], cameras [26], `pixel` [2], `plane` [3].
    """
    size = 2 * half + 1
    focal = 1.0 / _pixel_angle(p_left, pixel)
    w0, wu, wv = plane[0], plane[1], plane[2]
    small = 1e-3 * w0
    rows = np.empty((size * size, 5))
    weight, value = np.empty(size * size), np.empty(size * size)
    block = np.empty(size * size, np.int64)
    n = 0
    for j in range(-half, half + 1):
        for i in range(-half, half + 1):
            a = bilinear(left, pixel[0] + i, pixel[1] + j)
            w = w0 + wu * i + wv * j
            if math.isnan(a) or w <= small:
                continue
            ox, oy, oz, dx, dy, dz = back_project_one(p_left, pixel[0] + i, pixel[1] + j)
            x, y, _a = project_one(p_right, ox + dx / w, oy + dy / w, oz + dz / w)
            x1, y1, _b = project_one(
                p_right, ox + dx / (w + small), oy + dy / (w + small), oz + dz / (w + small)
            )
            y += row
            b = bilinear(right, x, y)
            bx = 0.5 * (bilinear(right, x + 1.0, y) - bilinear(right, x - 1.0, y))
            by = 0.5 * (bilinear(right, x, y + 1.0) - bilinear(right, x, y - 1.0))
            step = math.hypot(x1 - x, y1 + row - y)
            if math.isnan(b) or math.isnan(bx) or math.isnan(by) or not step > 0.0:
                continue
            along = (bx * (x1 - x) + by * (y1 + row - y)) / step
            rows[n, 0], rows[n, 1], rows[n, 2], rows[n, 3], rows[n, 4] = along, along * i, along * j, b, 1.0
            weight[n] = math.exp(-0.5 * (i * i + j * j) / (0.6 * half) ** 2)
            value[n] = a
            block[n] = ((j + half) * BLOCKS // size) * BLOCKS + (i + half) * BLOCKS // size
            n += 1
    if n < 25:
        return -1.0
    sw, sa, sb, sbb, sab = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        q, b = weight[k], rows[k, 3]
        sw += q
        sa += q * value[k]
        sb += q * b
        sbb += q * b * b
        sab += q * value[k] * b
    gain = max(0.05, (sab - sa * sb / sw) / max(1e-12, sbb - sb * sb / sw))
    offset = (sa - gain * sb) / sw
    M = np.zeros((5, 5))
    scores = np.zeros((BLOCKS * BLOCKS, 5))
    seen = np.zeros(BLOCKS * BLOCKS)
    energy = 0.0
    for k in range(n):
        q = weight[k]
        r = value[k] - gain * rows[k, 3] - offset
        energy += q * r * r
        seen[block[k]] += q
        for c in range(5):
            tc = rows[k, c] * (gain if c < 3 else 1.0)
            scores[block[k], c] += q * tc * r
            for d in range(5):
                M[c, d] += q * tc * rows[k, d] * (gain if d < 3 else 1.0)
    # the same prior on the slant as in `refine_plane`, in pixels of disparity per pixel
    unit = math.hypot(*_disparity_step(p_left, p_right, pixel, w0)) * w0
    prior = energy / sw / max(1e-12, (slant_sigma * unit / focal) ** 2)
    M[1, 1] += prior
    M[2, 2] += prior
    meat = np.zeros((5, 5))
    for m in range(BLOCKS * BLOCKS):
        for c in range(5):
            for d in range(5):
                meat[c, d] += scores[m, c] * scores[m, d]
    for c in range(5):
        M[c, c] = M[c, c] * (1.0 + 1e-6) + 1e-9
    inverse = np.linalg.inv(M)
    return few_parts(seen) * (inverse @ meat @ inverse)[0, 0]


@njit(cache=True, nogil=True)
def _disparity_step(p_left: Array, p_right: Array, pixel: Array, w: float) -> tuple[float, float]:
    """Return how far the right pixel moves for a change of the inverse range, pixels times metres."""
    ox, oy, oz, dx, dy, dz = back_project_one(p_left, pixel[0], pixel[1])
    small = 1e-3 * w
    x, y, _a = project_one(p_right, ox + dx / w, oy + dy / w, oz + dz / w)
    x1, y1, _b = project_one(p_right, ox + dx / (w + small), oy + dy / (w + small), oz + dz / (w + small))
    return (x1 - x) / small, (y1 - y) / small


@njit(cache=True, nogil=True)
def few_parts(weights: Array) -> float:
    """Return the factor on a variance that `n` parts of unequal weight (n,) tell by their disagreement.

    n / (n - 1) for the mean that they share, and the square of Student's quantile over the normal one at
    95 %, so that a 95 % ellipsoid holds 95 % though few parts tell its size (Cornish and Fisher 1938; of
    three parts it holds 94 %).
    """
    total = weights.sum()
    if total <= 0.0:
        return math.inf
    count = total * total / (weights * weights).sum()
    free = max(1.0, count - 1.0)
    quantile = 1.960 + 2.373 / free + 2.822 / free**2
    return count / free * (quantile / 1.960) ** 2
