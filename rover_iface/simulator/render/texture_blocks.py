"""Texture of many surface points at once: what `texture` tells of one, octave by octave over a block of them.

The loops over a block have no branches, so that the compiler takes several points in one instruction; a block
fits into the processor's first cache. Its fields lie in one array, as the compiler can then tell that they
do not overlap.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from rover_iface.simulator.render.texture import (
    CHIPS,
    DRIFT_QUIET,
    DRIFT_TINT,
    DUST,
    SOIL_STEEP,
    SOIL_TINT,
    SOIL_TURN,
    SOIL_WAVE,
    STONE_DUST,
    STONE_GRAIN,
    STONE_TURN,
    STONE_WAVE,
    TINT_LIMIT,
    drift,
    facets,
    fade,
    noise2,
    noise3,
)

Block = npt.NDArray[np.float64]

BLOCK = 128
"""Points of a block."""
X, Y, Z, FOOTPRINT, NX, NY, NZ, VX, VY, VZ = (BLOCK * field for field in range(10))
"""Where fields begin: place, m, width of a pixel, m, normal, direction to the eye."""
TINT, GX, GY, GZ, SHADE, LIGHT = (BLOCK * field for field in range(10, 16))
"""Brightness and slopes that the texture adds, shadow of stones, light."""
DEEP, LOOSE, DUSTY, BARE, BEND, NOISE = (BLOCK * field for field in range(16, 22))
"""Depth of sand and share of loose stones; noise of dust, share of bare rock, bend of the facets' lattice,
noise of the octave before."""
FIELDS = 22
"""Fields of a block, which is an array [2816] of them one after the other."""


@njit(cache=True, nogil=True)
def finest(block: Block, count: int) -> float:
    """Return the least footprint, m, of the `count` points of a `block` [2816]."""
    least = math.inf
    for n in range(count):
        least = min(least, block[n + FOOTPRINT])
    return least


@njit(cache=True, nogil=True, error_model="numpy")
def soil_octave(block: Block, count: int, level: int, slope: float, salt: int) -> None:
    """Add an octave of bare soil to a `block` [2816]; `slope` is how steep its waves are."""
    wave, darker, steep = SOIL_WAVE[level], SOIL_TINT[level], SOIL_STEEP[level]
    c, s = SOIL_TURN[level, 0], SOIL_TURN[level, 1]
    for n in range(count):
        x, y = block[n + X], block[n + Y]
        keep = fade(wave, block[n + FOOTPRINT])
        value, gu, gv = noise2((c * x + s * y) / wave, (c * y - s * x) / wave, salt + level)
        rise = slope * keep * steep
        block[n + TINT] += keep * value * darker
        block[n + GX] += rise * (c * gu - s * gv)
        block[n + GY] += rise * (s * gu + c * gv)


@njit(cache=True, nogil=True, error_model="numpy")
def soil(block: Block, count: int, slope: float, mottle: float, salt: int) -> None:
    """Add bare soil to a `block` [2816].

    Waves narrower than the pixels fade; `slope` is how steep they are, `mottle` a factor on their brightness.
    """
    least = finest(block, count)
    for level in range(len(SOIL_WAVE)):
        if SOIL_WAVE[level] <= least:
            break
        soil_octave(block, count, level, slope, salt)
    for n in range(count):
        block[n + TINT] *= mottle


@njit(cache=True, nogil=True, error_model="numpy")
def sand(block: Block, count: int, cover: float, salt: int) -> None:
    """Fill how deep sand lies on a `block` [2816], and hide the soil below.

    About a share `cover` of the ground is under it.
    """
    for n in range(count):
        deep = drift(block[n + X], block[n + Y], block[n + FOOTPRINT], cover, salt)
        block[n + DEEP] = deep
        block[n + TINT] = block[n + TINT] * (1.0 - DRIFT_QUIET[0] * deep) + DRIFT_TINT * deep
        block[n + GX] *= 1.0 - DRIFT_QUIET[1] * deep
        block[n + GY] *= 1.0 - DRIFT_QUIET[1] * deep


@njit(cache=True, nogil=True, error_model="numpy")
def stone_octave(block: Block, count: int, level: int, slope: float, mottle: float, salt: int) -> None:
    """Add an octave of rock, and of the noise of dust, to a `block` [2816].

    Where dust lies the grain fades, in patches of all sizes.
    """
    wave, grain, dusty = STONE_WAVE[level], STONE_GRAIN[level], STONE_DUST[level]
    c, s = STONE_TURN[level, 0], STONE_TURN[level, 1]
    grainy, ridged, later = wave < 0.1, level % 2 == 1, 1.0 if level >= 1 else 0.0
    for n in range(count):
        x, y, z = block[n + X], block[n + Y], block[n + Z]
        keep = fade(wave, block[n + FOOTPRINT])
        u, v, w = (c * x + s * z) / wave, y / wave + 3.7 * level, (c * z - s * x) / wave
        value, nu, nv, nw = noise3(u, v, w, salt + level)
        dust = block[n + DUSTY] + (value * dusty if keep > 0.0 else 0.0)
        bare = min(1.0, max(0.0, DUST[0] + DUST[1] * dust))
        bare = DUST[2] + (1.0 - DUST[2]) * bare * bare * (3.0 - 2.0 * bare)
        bare = bare if keep * later > 0.0 else block[n + BARE]
        block[n + DUSTY], block[n + BARE] = dust, bare
        block[n + BEND], block[n + NOISE] = CHIPS[2] * 2.0 * block[n + NOISE] / 0.42, value
        strength = keep * grain * (bare if grainy else 1.0)
        # every second octave ridged: cracks
        bright = 0.5 - 1.6 * abs(value) if ridged else value
        block[n + TINT] += strength * mottle * bright
        strength = -strength if ridged and value > 0.0 else strength
        block[n + GX] += slope * strength * (c * nu - s * nw)
        block[n + GY] += slope * strength * nv
        block[n + GZ] += slope * strength * (s * nu + c * nw)


@njit(cache=True, nogil=True, error_model="numpy")
def stone_facets(block: Block, count: int, level: int, salt: int) -> None:
    """Add facets to a `block` [2816]: cells of a lattice that the octave before bends."""
    wave = STONE_WAVE[level]
    c, s = STONE_TURN[level, 0], STONE_TURN[level, 1]
    size = 0.42 * wave
    for n in range(count):
        x, y, z, footprint = block[n + X], block[n + Y], block[n + Z], block[n + FOOTPRINT]
        u, v, w = (c * x + s * z) / wave, y / wave + 3.7 * level, (c * z - s * x) / wave
        bend = block[n + BEND]
        edge = min(1.0, max(0.06, 1.2 * footprint / size))
        t, hx, hy, hz = facets(
            u / 0.42 + bend, v / 0.42 + 0.6 * bend, w / 0.42 - bend, edge, salt + 40 + level
        )
        k = fade(size, footprint)
        block[n + TINT] += CHIPS[1] * k * t
        block[n + GX] += CHIPS[0] * k * (c * hx - s * hz)
        block[n + GY] += CHIPS[0] * k * hy
        block[n + GZ] += CHIPS[0] * k * (s * hx + c * hz)


@njit(cache=True, nogil=True, error_model="numpy")
def stone(block: Block, count: int, slope: float, mottle: float, salt: int) -> None:
    """Add a rock's surface to a `block` [2816]: chipped facets, grain, dust.

    Quiet and rough places lie side by side at every range.
    """
    least = finest(block, count)
    for n in range(count):
        block[n + DUSTY], block[n + BARE], block[n + NOISE] = 0.0, 1.0, 0.0
    for level in range(len(STONE_WAVE)):
        if STONE_WAVE[level] <= least:
            break
        stone_octave(block, count, level, slope, mottle, salt)
        if 1 <= level <= 3:
            stone_facets(block, count, level, salt)
    for n in range(count):
        tint = block[n + TINT] + DUST[3] * (0.5 - block[n + BARE])
        block[n + TINT] = tint / math.sqrt(1.0 + (tint / TINT_LIMIT) ** 2)
