"""Procedural detail below the triangles: noise of position alone, so that it stands still from every view.

Every octave fades out as its wavelength nears the pixel's footprint. Without that the fine octaves alias, the
image of a stone changes with every step of the rover, and no tracker could be judged on it.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

MASK = 0xFFFFFFFF
GRAIN = 1.15, 0.56, 10.0
"""Grain of rock finer than 10 cm against the coarse octaves: factor there, power by which it grows, limit."""

DUST = 0.2, 2.0, 0.06, 0.12
"""Bare rock: share where the noise is 0, growth with the noise, the grain that shows through dust; and by how
much dust is darker or brighter than the mean."""

CHIPS = 0.06, 0.06, 0.35
"""Facets of rock: slope, brightness, and by how much of a cell their lattice is bent."""

TINT_LIMIT = 0.65
"""What the brightness of rock varies by at most, share of its albedo."""


def _turns(angles: npt.NDArray[np.floating]) -> npt.NDArray[np.float64]:
    """Return cosine and sine (n, 2): octaves are turned, else their lattices line up and show."""
    return np.column_stack((np.cos(angles), np.sin(angles)))


DRIFT_WAVE = 1.3, 0.47, 0.17
"""Lattices of the noise that says where sand lies, m: drifts as long as a rock field's gaps, down to the
lee of a stone; not multiples of each other, or of the soil's, else their cells line up."""

DRIFT_EDGE = 0.3
"""Width of a drift's edge in that noise: it thins out over a few centimetres of the finest lattice."""

DRIFT_QUIET = 0.6, 0.3, 0.9
"""What sand takes of the soil's brightness, of its slopes and of its loose stones: with more, patches were
more sharply parted into quiet and rough than those of Mars frames (`studies/picture_page.py`, kurtosis)."""

DRIFT_TINT = 0.07
"""By how much sand is brighter than the soil around; by eye, after Spirit's Pancam frame."""

SAND_GRAIN = 1.4e-3, 0.35e-3, 0.4
"""Grains of sand: size of the coarse and of the fine, m, and which share of the places has a coarse one.
Ripples at Gusev and Meridiani have crests of 1 to 2 mm on sand of 0.1 to 0.4 mm (Sullivan et al. 2008)."""

ROCK_GRAIN = 0.5e-3, 0.35
"""Grains of rock: size, m (medium sand and crystals, as of sandstones and basalts), and how much of the
relief and contrast of loose sand they have; by eye."""

RIPPLE = 0.10, 1.4, 0.55
"""Ripples of sand: distance of crests and size of their patches, m, and by how much of their distance they
are bent; by eye, Spirit's Navcam frame of sol 1869."""

SOIL_WAVE = 1.28 * 0.5 ** np.arange(12)
SOIL_TURN = _turns(1.1 * np.arange(12))
SOIL_TINT = np.where(SOIL_WAVE > 0.3, 0.03, np.where(SOIL_WAVE > 0.05, 0.05, 0.12))
SOIL_STEEP = np.where(SOIL_WAVE > 0.2, 0.25, np.where(SOIL_WAVE > 0.05, 0.5, 1.0))

# finer steps below 3 cm, where octaves come and go with the range
STONE_WAVE = np.concatenate((0.48 * 0.5 ** np.arange(5), 0.015 * 0.7 ** np.arange(9)))
STONE_TURN = _turns(0.9 * np.arange(14) + 0.3)
STONE_GRAIN = np.where(STONE_WAVE < 0.1, np.minimum(GRAIN[2], GRAIN[0] * (0.1 / STONE_WAVE) ** GRAIN[1]), 1.0)
STONE_DUST = np.array([0.0, 0.35, 0.5, 0.35] + 10 * [0.5])
"""Weights of the octaves in the noise of dust: all of them, so its patches have ragged edges."""


@njit(cache=True, nogil=True, inline="always")
def scramble(i: int, j: int, k: int, salt: int) -> int:
    """Return 32 well mixed bits of four integers."""
    n = (i * 0x9E3779B1 + j * 0x85EBCA77 + k * 0xC2B2AE3D + salt * 0x27D4EB2F) & MASK
    n = ((n ^ (n >> 15)) * 0x2C1B3C6D) & MASK
    n = ((n ^ (n >> 12)) * 0x297A2D39) & MASK
    return n ^ (n >> 15)


@njit(cache=True, nogil=True, inline="always")
def unit(i: int, j: int, k: int, salt: int) -> float:
    """Return a number in [0, 1) of four integers."""
    return scramble(i, j, k, salt) * (1.0 / 4294967296.0)


@njit(cache=True, nogil=True)
def noise3(x: float, y: float, z: float, salt: int) -> tuple[float, float, float, float]:
    """Return value noise in [-1, 1] with lattice constant 1, and its gradient."""
    xi, yi, zi = math.floor(x), math.floor(y), math.floor(z)
    i, j, k = int(xi), int(yi), int(zi)
    fx, fy, fz = x - xi, y - yi, z - zi
    ux, uy, uz = fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy), fz * fz * (3.0 - 2.0 * fz)
    dx, dy, dz = 6.0 * fx * (1.0 - fx), 6.0 * fy * (1.0 - fy), 6.0 * fz * (1.0 - fz)
    a, b = unit(i, j, k, salt), unit(i + 1, j, k, salt)
    c, d = unit(i, j + 1, k, salt), unit(i + 1, j + 1, k, salt)
    e, f = unit(i, j, k + 1, salt), unit(i + 1, j, k + 1, salt)
    g, h = unit(i, j + 1, k + 1, salt), unit(i + 1, j + 1, k + 1, salt)
    x00, x10, x01, x11 = a + ux * (b - a), c + ux * (d - c), e + ux * (f - e), g + ux * (h - g)
    y0, y1 = x00 + uy * (x10 - x00), x01 + uy * (x11 - x01)
    value = y0 + uz * (y1 - y0)
    gx = dx * (((b - a) * (1 - uy) + (d - c) * uy) * (1 - uz) + ((f - e) * (1 - uy) + (h - g) * uy) * uz)
    gy = dy * ((x10 - x00) * (1 - uz) + (x11 - x01) * uz)
    gz = dz * (y1 - y0)
    return 2.0 * value - 1.0, 2.0 * gx, 2.0 * gy, 2.0 * gz


@njit(cache=True, nogil=True)
def noise2(x: float, y: float, salt: int) -> tuple[float, float, float]:
    """Return value noise in [-1, 1] with lattice constant 1, and its gradient."""
    xi, yi = math.floor(x), math.floor(y)
    i, j = int(xi), int(yi)
    fx, fy = x - xi, y - yi
    ux, uy = fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy)
    a, b = unit(i, j, 7, salt), unit(i + 1, j, 7, salt)
    c, d = unit(i, j + 1, 7, salt), unit(i + 1, j + 1, 7, salt)
    low, high = a + ux * (b - a), c + ux * (d - c)
    gx = 6.0 * fx * (1.0 - fx) * ((b - a) * (1.0 - uy) + (d - c) * uy)
    gy = 6.0 * fy * (1.0 - fy) * (high - low)
    return 2.0 * (low + uy * (high - low)) - 1.0, 2.0 * gx, 2.0 * gy


@njit(cache=True, nogil=True, inline="always")
def fade(wavelength: float, footprint: float) -> float:
    """Return how much of an octave survives: 0 below 1 pixel a lattice cell (half a wave), 1 above 2."""
    t = wavelength / footprint - 1.0
    if t <= 0.0:
        return 0.0
    if t >= 1.0:
        return 1.0
    return t * t * (3.0 - 2.0 * t)


@njit(cache=True, nogil=True)
def soil(x: float, y: float, footprint: float, slope: float, salt: int) -> tuple[float, float, float]:
    """Return brightness variation and the two slopes of bare soil at a point (m); waves narrower than the
    pixel's `footprint` (m) fade, `slope` is how steep they are.
    """
    tint, hx, hy = 0.0, 0.0, 0.0
    for level in range(len(SOIL_WAVE)):
        wavelength = SOIL_WAVE[level]
        keep = fade(wavelength, footprint)
        if keep <= 0.0:
            break
        c, s = SOIL_TURN[level, 0], SOIL_TURN[level, 1]
        n, gu, gv = noise2((c * x + s * y) / wavelength, (c * y - s * x) / wavelength, salt + level)
        tint += keep * n * SOIL_TINT[level]
        steep = slope * keep * SOIL_STEEP[level]
        hx += steep * (c * gu - s * gv)
        hy += steep * (s * gu + c * gv)
    return tint, hx, hy


@njit(cache=True, nogil=True)
def drift(x: float, y: float, footprint: float, cover: float, salt: int) -> float:
    """Return how deep sand lies over the soil at a point (m): 0 none, 1 all of it hidden.

    About a share `cover` of the ground is under sand; waves narrower than the pixel's `footprint` (m) fade.
    """
    n, weight = 0.0, 1.0
    for level in range(3):
        keep = fade(DRIFT_WAVE[level], footprint)
        if keep <= 0.0:
            break
        c, s = SOIL_TURN[level + 4, 0], SOIL_TURN[level + 4, 1]
        wavelength = DRIFT_WAVE[level]
        value, _, _ = noise2((c * x + s * y) / wavelength, (c * y - s * x) / wavelength, salt + level)
        n += keep * weight * value
        weight *= 0.62
    t = min(1.0, max(0.0, (n + 1.6 * (cover - 0.5)) / DRIFT_EDGE + 0.5))
    return t * t * (3.0 - 2.0 * t)


@njit(cache=True, nogil=True)
def sand_grains(x: float, y: float, footprint: float, salt: int) -> tuple[float, float, float]:
    """Return brightness and two slopes of grains of sand at a point (m), coarse ones on a bed of fine ones.

    A grain is a cap round a point of a jittered lattice, the gaps between are dark; grains that a pixel of
    `footprint` (m) does not resolve fade.
    """
    tint, hx, hy = 0.0, 0.0, 0.0
    for level in range(2):
        cell = SAND_GRAIN[level]
        keep = fade(0.7 * cell, footprint)
        if keep <= 0.0:
            continue
        gi, gj = math.floor(x / cell), math.floor(y / cell)
        best, bx, by, hue = 4.0, 0.0, 0.0, 0.5
        for di in range(-1, 2):
            for dj in range(-1, 2):
                i, j = gi + di, gj + dj
                h = scramble(i, j, level + 17, salt)
                if level == 0 and (h >> 24) > 255.0 * SAND_GRAIN[2]:
                    continue
                ex = x / cell - i - 0.15 - 0.7 * (h & 255) / 255.0
                ey = y / cell - j - 0.15 - 0.7 * ((h >> 8) & 255) / 255.0
                away = ex * ex + ey * ey
                if away < best:
                    best, bx, by, hue = away, ex, ey, ((h >> 16) & 255) / 255.0
        if level == 0 and best > 0.2:  # no coarse grain here
            continue
        edge = min(1.0, best / 0.3)
        tint = keep * (0.5 * (hue - 0.5) - 0.35 * edge * edge)
        # the side of a ball, no steeper than its foot is hidden by its neighbours
        hx, hy = -1.6 * keep * bx, -1.6 * keep * by
        if level == 0:
            break
    return tint, hx, hy


@njit(cache=True, nogil=True)
def rock_grains(
    x: float, y: float, z: float, nx: float, ny: float, nz: float, footprint: float, salt: int
) -> tuple[float, float, float, float]:
    """Return brightness and three slopes of the grains of rock at a point (m) with normal (`nx`, `ny`, `nz`).

    They are those of sand, larger and worn, projected along the axis that the normal is nearest to.
    """
    k = SAND_GRAIN[1] / ROCK_GRAIN[0]
    if abs(nz) >= abs(nx) and abs(nz) >= abs(ny):
        t, a, b = sand_grains(k * x, k * y, k * footprint, salt)
        hx, hy, hz = a, b, 0.0
    elif abs(nx) >= abs(ny):
        t, a, b = sand_grains(k * y, k * z, k * footprint, salt)
        hx, hy, hz = 0.0, a, b
    else:
        t, a, b = sand_grains(k * x, k * z, k * footprint, salt)
        hx, hy, hz = a, 0.0, b
    worn = ROCK_GRAIN[1]
    return worn * t, worn * hx, worn * hy, worn * hz


@njit(cache=True, nogil=True)
def ripple(
    x: float, y: float, footprint: float, wind_x: float, wind_y: float, salt: int
) -> tuple[float, float, float]:
    """Return brightness and the two slopes of wind ripples at a point (m), for a steepest slope of 1.

    Crests lie across the wind, which comes from (`wind_x`, `wind_y`); they bend, fork and die out. Ripples
    narrower than two pixels of `footprint` (m) fade.
    """
    keep = fade(0.5 * RIPPLE[0], footprint)
    if keep <= 0.0:
        return 0.0, 0.0, 0.0
    patch, _, _ = noise2(x / RIPPLE[1], y / RIPPLE[1], salt)
    strength = keep * min(1.0, max(0.0, 0.5 + 1.6 * patch))
    if strength <= 0.0:
        return 0.0, 0.0, 0.0
    along = (wind_x * x + wind_y * y) / RIPPLE[0]
    aside = (wind_x * y - wind_y * x) / RIPPLE[0]
    bend, b_along, b_aside = noise2(0.35 * along, 0.12 * aside, salt + 1)
    phase = 6.283185307179586 * (along + RIPPLE[2] * bend)
    # steeper in the lee: a second wave leans the crest
    slope = (math.cos(phase) + 0.5 * math.cos(2.0 * phase + 0.6)) / 1.4
    d_along = 1.0 + RIPPLE[2] * 0.35 * b_along
    d_aside = RIPPLE[2] * 0.12 * b_aside
    hx = strength * slope * (d_along * wind_x - d_aside * wind_y)
    hy = strength * slope * (d_along * wind_y + d_aside * wind_x)
    # coarser, darker grains gather on the crests
    return -0.35 * strength * math.sin(phase), hx, hy


@njit(cache=True, nogil=True)
def grains(x: float, y: float, footprint: float, salt: int) -> float:
    """Return noise, about -1 to 1, at x, y (m) of grains that a pixel of `footprint` (m) does not resolve.

    Two lattices of powers of two pass into each other as the footprint grows; their cells are 1.2 pixels wide
    where one stands alone.
    """
    scale = math.log2(footprint)
    level = math.floor(scale)
    t = scale - level
    cell = 1.2 * 2.0**level
    near, _, _ = noise2(x / cell, y / cell, salt + int(level))
    far, _, _ = noise2(0.5 * x / cell, 0.5 * y / cell, salt + int(level) + 1)
    return ((1.0 - t) * near + t * far) / math.sqrt((1.0 - t) * (1.0 - t) + t * t)


@njit(cache=True, nogil=True)
def gravel(
    x: float,
    y: float,
    footprint: float,
    cover: float,
    sun_x: float,
    sun_y: float,
    sun_slope: float,
    salt: int,
) -> tuple[float, float, float, float]:
    """Return brightness variation, two slopes and shadow (0..1) of stones from 3 cm down to 2 mm.

    A stone is a truncated pyramid with five unequal sides, found in a jittered grid per size; `sun_x, sun_y`
    is the level unit vector to the sun and `sun_slope` the tangent of its height.
    """
    tint, hx, hy, shade = 0.0, 0.0, 0.0, 0.0
    top = 0.0
    cell = 0.08
    for level in range(5):
        size = 0.5 * cell
        keep = fade(1.3 * size, footprint)
        if keep <= 0.0:
            break
        gi, gj = math.floor(x / cell), math.floor(y / cell)
        dense = cover * (0.35 + 0.13 * level)
        for di in range(-1, 2):
            for dj in range(-1, 2):
                i, j = gi + di, gj + dj
                h = scramble(i, j, level, salt)
                if (h & 0xFFFF) * (1.0 / 65536.0) > dense:
                    continue
                h2 = scramble(i, j, level + 64, salt)
                r = cell * (0.12 + 0.26 * ((h >> 16) & 0xFF) / 255.0 * ((h >> 24) & 0xFF) / 255.0 + 0.03)
                cx = (i + 0.25 + 0.5 * (h2 & 0xFF) / 255.0) * cell
                cy = (j + 0.25 + 0.5 * ((h2 >> 8) & 0xFF) / 255.0) * cell
                ex, ey = x - cx, y - cy
                tall = r * (0.35 + 0.5 * ((h2 >> 16) & 0xFF) / 255.0)
                reach = tall / sun_slope
                far = 1.5 * r
                if ex * ex + ey * ey > (far + reach) * (far + reach):
                    continue
                turn = 6.2831853 * ((h2 >> 24) & 0xFF) / 255.0
                # the sides, seen from the point itself and from where its sun ray passes the stone
                along = -(ex * sun_x + ey * sun_y)
                along = min(max(along, 0.0), reach)
                qx, qy = ex + along * sun_x, ey + along * sun_y
                d, dq, nx, ny = -9.0, -9.0, 0.0, 0.0
                for side in range(5):
                    a = turn + 1.2566371 * side + 0.5 * (unit(i, j, side, salt + 77) - 0.5)
                    ca, sa = math.cos(a), math.sin(a)
                    w = 1.0 / (r * (0.75 + 0.5 * unit(i, j, side + 9, salt + 77)))
                    e = (ex * ca + ey * sa) * w
                    if e > d:
                        d, nx, ny = e, ca * w, sa * w
                    q = (qx * ca + qy * sa) * w
                    dq = max(dq, q)
                if d < 1.0:
                    rise = tall * min(1.0, 2.2 * (1.0 - d))
                    if rise > top:
                        top = rise
                        k = keep
                        tilt = 0.5 * (unit(i, j, 21, salt) - 0.5)
                        tilt2 = 0.5 * (unit(i, j, 22, salt) - 0.5)
                        if 2.2 * (1.0 - d) < 1.0:
                            soft = min(1.0, 1.5 * size / footprint / 3.0)
                            hx, hy = -k * soft * 2.2 * tall * nx + tilt, -k * soft * 2.2 * tall * ny + tilt2
                        else:
                            hx, hy = k * tilt, k * tilt2
                        tint = k * (0.9 * unit(i, j, 23, salt) - 0.40)
                        shade = 0.0
                elif along > 0.0 and dq < 1.0:
                    height = tall * min(1.0, 2.2 * (1.0 - dq)) - along * sun_slope
                    if height > 0.0 and top < 0.3 * tall:
                        shade = max(shade, keep * min(1.0, height / (0.15 * tall)))
        cell *= 0.5
    return tint, hx, hy, shade


@njit(cache=True, nogil=True)
def facets(x: float, y: float, z: float, edge: float, salt: int) -> tuple[float, float, float, float]:
    """Return a brightness and three slopes in [-1, 1] that are constant over cells of a unit lattice.

    `edge` is the width of the passage from cell to cell, 0..1: sharp edges, yet none sharper than the pixel.
    """
    xi, yi, zi = math.floor(x), math.floor(y), math.floor(z)
    i, j, k = int(xi), int(yi), int(zi)
    fx = min(1.0, max(0.0, (x - xi - 0.5) / edge + 0.5))
    fy = min(1.0, max(0.0, (y - yi - 0.5) / edge + 0.5))
    fz = min(1.0, max(0.0, (z - zi - 0.5) / edge + 0.5))
    tint, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
    for a in range(2):
        wa = fx if a == 1 else 1.0 - fx
        for b in range(2):
            wb = wa * (fy if b == 1 else 1.0 - fy)
            for c in range(2):
                w = wb * (fz if c == 1 else 1.0 - fz)
                if w <= 0.0:
                    continue
                h = scramble(i + a, j + b, k + c, salt)
                w /= 127.5
                tint += w * ((h & 255) - 127.5)
                gx += w * (((h >> 8) & 255) - 127.5)
                gy += w * (((h >> 16) & 255) - 127.5)
                gz += w * (((h >> 24) & 255) - 127.5)
    return tint, gx, gy, gz


@njit(cache=True, nogil=True)
def stone(
    x: float, y: float, z: float, footprint: float, slope: float, mottle: float, salt: int
) -> tuple[float, float, float, float]:
    """Return brightness variation and the gradient of a rock surface's height: chipped facets, grain, dust.

    Facets are cells of a lattice bent by the coarser octaves. Where dust lies the grain fades, in patches of
    all sizes: quiet and rough places lie side by side at every range.
    """
    tint, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
    bend, bare, dust = 0.0, 1.0, 0.0
    for level in range(len(STONE_WAVE)):
        wavelength = STONE_WAVE[level]
        keep = fade(wavelength, footprint)
        if keep <= 0.0:
            break
        c, s = STONE_TURN[level, 0], STONE_TURN[level, 1]
        u, v, w = (c * x + s * z) / wavelength, y / wavelength + 3.7 * level, (c * z - s * x) / wavelength
        n, nu, nv, nw = noise3(u, v, w, salt + level)
        if level >= 1:
            dust += n * STONE_DUST[level]
            bare = min(1.0, max(0.0, DUST[0] + DUST[1] * dust))
            bare = DUST[2] + (1.0 - DUST[2]) * bare * bare * (3.0 - 2.0 * bare)
        strength = keep * STONE_GRAIN[level]
        if wavelength < 0.1:
            strength *= bare
        if level % 2 == 1:  # every second octave ridged: cracks
            tint += strength * mottle * (0.5 - 1.6 * abs(n))
            strength = -strength if n > 0.0 else strength
        else:
            tint += strength * mottle * n
        gx += slope * strength * (c * nu - s * nw)
        gy += slope * strength * nv
        gz += slope * strength * (s * nu + c * nw)
        if 1 <= level <= 3:
            size = 0.42 * wavelength
            edge = min(1.0, max(0.06, 1.2 * footprint / size))
            t, hx, hy, hz = facets(
                u / 0.42 + bend, v / 0.42 + 0.6 * bend, w / 0.42 - bend, edge, salt + 40 + level
            )
            k = fade(size, footprint)
            tint += CHIPS[1] * k * t
            gx += CHIPS[0] * k * (c * hx - s * hz)
            gy += CHIPS[0] * k * hy
            gz += CHIPS[0] * k * (s * hx + c * hz)
        bend = CHIPS[2] * 2.0 * n / 0.42
    tint += DUST[3] * (0.5 - bare)
    return tint / math.sqrt(1.0 + (tint / TINT_LIMIT) ** 2), gx, gy, gz
