"""Procedural detail below the triangles: noise of position alone, so that it stands still from every view.

Every octave fades out as its wavelength nears the pixel's footprint. Without that the fine octaves alias, the
image of a stone changes with every step of the rover, and no tracker could be judged on it.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

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

DRIFT_WEIGHT = 1.0, 0.62, 0.62 * 0.62
"""Of these lattices."""

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


U32 = np.uint32
FACTORS = 0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D, 0x27D4EB2F
"""Of three axes and of the salt, in the hash of a lattice's corner."""
MIX_I, MIX_J, MIX_K, MIX_SALT = (U32(factor) for factor in FACTORS)
MIX_IJ, MIX_IK, MIX_JK, MIX_IJK = (
    U32(sum(FACTORS[axis] for axis in axes) & 0xFFFFFFFF) for axes in ((0, 1), (0, 2), (1, 2), (0, 1, 2))
)
"""What one corner further along several axes adds to it."""
BYTE = U32(255)
STIR, STIR_AGAIN, FAR, NEAR = U32(0x2C1B3C6D), U32(0x297A2D39), U32(15), U32(12)
"""Factors and shifts by which the hash is stirred."""
SHARE = 1.0 / 4294967296.0


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def stirred(n: np.uint32) -> np.uint32:
    """Return 32 well mixed bits of 32, in 32 bits throughout: a loop over points takes many at once."""
    n = U32(U32(n ^ (n >> FAR)) * STIR)
    n = U32(U32(n ^ (n >> NEAR)) * STIR_AGAIN)
    return U32(n ^ (n >> FAR))


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def corner(i: np.uint32, j: np.uint32, k: np.uint32, salt: np.uint32) -> np.uint32:
    """Return the hash of four integers before it is stirred: sums of it go from cell to cell."""
    return U32(U32(U32(i * MIX_I) + U32(j * MIX_J)) + U32(U32(k * MIX_K) + U32(salt * MIX_SALT)))


@njit(cache=True, nogil=True, inline="always")
def scramble(i: int, j: int, k: int, salt: int) -> int:
    """Return 32 well mixed bits of four integers."""
    return int(stirred(corner(U32(i), U32(j), U32(k), U32(salt))))


@njit(cache=True, nogil=True, inline="always")
def unit(i: int, j: int, k: int, salt: int) -> float:
    """Return a number in [0, 1) of four integers."""
    return scramble(i, j, k, salt) * SHARE


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def noise3(x: float, y: float, z: float, salt: int) -> tuple[float, float, float, float]:
    """Return value noise in [-1, 1] with lattice constant 1, and its gradient."""
    xi, yi, zi = np.floor(x), np.floor(y), np.floor(z)
    fx, fy, fz = x - xi, y - yi, z - zi
    ux, uy, uz = fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy), fz * fz * (3.0 - 2.0 * fz)
    dx, dy, dz = 6.0 * fx * (1.0 - fx), 6.0 * fy * (1.0 - fy), 6.0 * fz * (1.0 - fz)
    n = corner(U32(np.int32(xi)), U32(np.int32(yi)), U32(np.int32(zi)), U32(salt))
    a, b = stirred(n) * SHARE, stirred(U32(n + MIX_I)) * SHARE
    c, d = stirred(U32(n + MIX_J)) * SHARE, stirred(U32(n + MIX_IJ)) * SHARE
    e, f = stirred(U32(n + MIX_K)) * SHARE, stirred(U32(n + MIX_IK)) * SHARE
    g, h = stirred(U32(n + MIX_JK)) * SHARE, stirred(U32(n + MIX_IJK)) * SHARE
    x00, x10, x01, x11 = a + ux * (b - a), c + ux * (d - c), e + ux * (f - e), g + ux * (h - g)
    y0, y1 = x00 + uy * (x10 - x00), x01 + uy * (x11 - x01)
    value = y0 + uz * (y1 - y0)
    gx = dx * (((b - a) * (1 - uy) + (d - c) * uy) * (1 - uz) + ((f - e) * (1 - uy) + (h - g) * uy) * uz)
    gy = dy * ((x10 - x00) * (1 - uz) + (x11 - x01) * uz)
    gz = dz * (y1 - y0)
    return 2.0 * value - 1.0, 2.0 * gx, 2.0 * gy, 2.0 * gz


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def noise2(x: float, y: float, salt: int) -> tuple[float, float, float]:
    """Return value noise in [-1, 1] with lattice constant 1, and its gradient."""
    xi, yi = np.floor(x), np.floor(y)
    fx, fy = x - xi, y - yi
    ux, uy = fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy)
    n = corner(U32(np.int32(xi)), U32(np.int32(yi)), U32(7), U32(salt))
    a, b = stirred(n) * SHARE, stirred(U32(n + MIX_I)) * SHARE
    c, d = stirred(U32(n + MIX_J)) * SHARE, stirred(U32(n + MIX_IJ)) * SHARE
    low, high = a + ux * (b - a), c + ux * (d - c)
    gx = 6.0 * fx * (1.0 - fx) * ((b - a) * (1.0 - uy) + (d - c) * uy)
    gy = 6.0 * fy * (1.0 - fy) * (high - low)
    return 2.0 * (low + uy * (high - low)) - 1.0, 2.0 * gx, 2.0 * gy


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def fade(wavelength: float, footprint: float) -> float:
    """Return how much of an octave survives: 0 below 1 pixel a lattice cell (half a wave), 1 above 2."""
    t = min(1.0, max(0.0, wavelength / footprint - 1.0))
    return t * t * (3.0 - 2.0 * t)


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def _drift_octave(x: float, y: float, footprint: float, level: int, salt: int) -> float:
    c, s = SOIL_TURN[level + 4, 0], SOIL_TURN[level + 4, 1]
    wave = DRIFT_WAVE[level]
    value, _, _ = noise2((c * x + s * y) / wave, (c * y - s * x) / wave, salt + level)
    return fade(wave, footprint) * DRIFT_WEIGHT[level] * value


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def drift(x: float, y: float, footprint: float, cover: float, salt: int) -> float:
    """Return how deep sand lies over the soil at a point (m): 0 none, 1 all of it hidden.

    About a share `cover` of the ground is under sand; waves narrower than the pixel's `footprint` (m) fade.
    """
    n = _drift_octave(x, y, footprint, 0, salt)
    n += _drift_octave(x, y, footprint, 1, salt)
    n += _drift_octave(x, y, footprint, 2, salt)
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


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def facets(x: float, y: float, z: float, edge: float, salt: int) -> tuple[float, float, float, float]:
    """Return a brightness and three slopes in [-1, 1] that are constant over cells of a unit lattice.

    `edge` is the width of the passage from cell to cell, 0..1: sharp edges, yet none sharper than the pixel.
    """
    xi, yi, zi = np.floor(x), np.floor(y), np.floor(z)
    first = corner(U32(np.int32(xi)), U32(np.int32(yi)), U32(np.int32(zi)), U32(salt))
    fx = min(1.0, max(0.0, (x - xi - 0.5) / edge + 0.5))
    fy = min(1.0, max(0.0, (y - yi - 0.5) / edge + 0.5))
    fz = min(1.0, max(0.0, (z - zi - 0.5) / edge + 0.5))
    tint, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
    for n in range(8):
        a, b, c = n >> 2, (n >> 1) & 1, n & 1
        wa = fx if a == 1 else 1.0 - fx
        wb = wa * (fy if b == 1 else 1.0 - fy)
        w = wb * (fz if c == 1 else 1.0 - fz) / 127.5
        h = stirred(U32(first + U32(U32(a) * MIX_I) + U32(U32(b) * MIX_J) + U32(U32(c) * MIX_K)))
        tint += w * (np.int32(h & BYTE) - 127.5)
        gx += w * (np.int32((h >> U32(8)) & BYTE) - 127.5)
        gy += w * (np.int32((h >> U32(16)) & BYTE) - 127.5)
        gz += w * (np.int32(h >> U32(24)) - 127.5)
    return tint, gx, gy, gz
