"""Loose stones on the soil, from 3 cm down to 2 mm.

A stone is a truncated pyramid with five unequal sides, found in a jittered grid per size. A picture meets
each of them in many pixels, so they are kept: which stones reach into a cell of the grid, and what each is
like.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from rover_iface.simulator.render.texture import scramble, unit
from rover_iface.simulator.render.texture_blocks import FOOTPRINT, GX, GY, LOOSE, SHADE, TINT, Block, X, Y

Array = npt.NDArray[np.float64]
Cells = npt.NDArray[np.int64]
Stones = tuple[Cells, Array, Cells, Array]

WIDEST_M, LEVELS = 0.08, 5
"""Cells of the grid of the largest stones, and how often they are halved."""
SLOTS = 1024
"""Cells of a size that are kept at a time: more than a row of a picture crosses."""
NOWHERE = -(2**62)
"""Column of a slot without a cell."""
ROUND_M2 = 1e-9
"""What rounding may make of a square of a distance: far more than it does, far less than a stone."""
MORE = 1.05
"""By how much stonier a place beside may be before a cell is filled anew: its patches are metres wide."""
PLACE = 6
"""What is kept of a stone that reaches into a cell: the draw of its being there, its place, m, how far off it
is met, squared, and its cell."""
STONE = 20
"""What is kept of a stone: its height and the reach of its shadow, m, the tilts of its top, its brightness,
and of each side the direction and the inverse distance."""


@njit(cache=True, nogil=True)
def no_stones() -> Stones:
    """Return empty stores of one sun and salt: cells [5 x 1024, 3] (column, row, count) and what reaches into
    each [5 x 1024, 10, 6], the last telling up to which stoniness; cells of stones [5 x 1024, 2] and these
    [5 x 1024, 20].
    """
    slots = LEVELS * SLOTS
    cells, owners = np.full((slots, 3), NOWHERE), np.full((slots, 2), NOWHERE)
    return cells, np.empty((slots, 10, PLACE)), owners, np.empty((slots, STONE))


@njit(cache=True, nogil=True, inline="always")
def _slot(i: int, j: int, level: int) -> int:
    return level * SLOTS + (((i * 0x9E3779B1 + j * 0x85EBCA77) >> 20) & (SLOTS - 1))


@njit(cache=True, nogil=True)
def _lay_in(
    i: int,
    j: int,
    level: int,
    cell: float,
    most: float,
    sun_slope: float,
    salt: int,
    at: int,
    cells: Cells,
    places: Array,
) -> None:
    """Fill slot `at` with the stones that reach into a cell where a share `most` of the ground is stony."""
    count, a, b = 0, i - 1, j - 2
    for n in range(9):
        b += 1
        if n == 3 or n == 6:
            a, b = a + 1, j - 1
        h = scramble(a, b, level, salt)
        draw = (h & 0xFFFF) * (1.0 / 65536.0)
        if draw > most * (0.35 + 0.13 * level):
            continue
        h2 = scramble(a, b, level + 64, salt)
        r, _, reach = _sizes(h, h2, cell, sun_slope)
        cx = (a + 0.25 + 0.5 * (h2 & 0xFF) / 255.0) * cell
        cy = (b + 0.25 + 0.5 * ((h2 >> 8) & 0xFF) / 255.0) * cell
        far = 1.5 * r
        within = (far + reach) * (far + reach)
        ex = max(0.0, i * cell - cx, cx - (i + 1) * cell)
        ey = max(0.0, j * cell - cy, cy - (j + 1) * cell)
        if ex * ex + ey * ey > within + ROUND_M2:
            continue
        places[at, count, 0], places[at, count, 1], places[at, count, 2] = draw, cx, cy
        places[at, count, 3], places[at, count, 4], places[at, count, 5] = within, a, b
        count += 1
    cells[at, 0], cells[at, 1], cells[at, 2] = i, j, count
    places[at, 9, 0] = most


@njit(cache=True, nogil=True, inline="always")
def _sizes(h: int, h2: int, cell: float, sun_slope: float) -> tuple[float, float, float]:
    """Return half width, height and reach of the shadow of a stone, m."""
    r = cell * (0.12 + 0.26 * ((h >> 16) & 0xFF) / 255.0 * ((h >> 24) & 0xFF) / 255.0 + 0.03)
    tall = r * (0.35 + 0.5 * ((h2 >> 16) & 0xFF) / 255.0)
    return r, tall, tall / sun_slope


@njit(cache=True, nogil=True)
def _shape(
    i: int,
    j: int,
    level: int,
    cell: float,
    sun_slope: float,
    salt: int,
    at: int,
    owners: Cells,
    stones: Array,
) -> None:
    """Fill slot `at` with what the stone of a cell is like."""
    h, h2 = scramble(i, j, level, salt), scramble(i, j, level + 64, salt)
    r, tall, reach = _sizes(h, h2, cell, sun_slope)
    stones[at, 0], stones[at, 1] = tall, reach
    stones[at, 2], stones[at, 3] = 0.5 * (unit(i, j, 21, salt) - 0.5), 0.5 * (unit(i, j, 22, salt) - 0.5)
    stones[at, 4] = 0.9 * unit(i, j, 23, salt) - 0.40
    turn = 6.2831853 * ((h2 >> 24) & 0xFF) / 255.0
    for side in range(5):
        a = turn + 1.2566371 * side + 0.5 * (unit(i, j, side, salt + 77) - 0.5)
        stones[at, 5 + 3 * side], stones[at, 6 + 3 * side] = math.cos(a), math.sin(a)
        stones[at, 7 + 3 * side] = 1.0 / (r * (0.75 + 0.5 * unit(i, j, side + 9, salt + 77)))
    owners[at, 0], owners[at, 1] = i, j


@njit(cache=True, nogil=True, error_model="numpy")
def gravel(
    block: Block,
    count: int,
    mottle: float,
    sun_x: float,
    sun_y: float,
    sun_slope: float,
    salt: int,
    cells: Cells,
    places: Array,
    owners: Cells,
    stones: Array,
) -> None:
    """Add stones to brightness, slopes and shadow of `count` points of a `block` [2816].

    A share `LOOSE` of the ground there is stony; stones narrower than the pixels fade. `mottle` is a
    factor on their brightness, `sun_x, sun_y` the level unit vector to the sun and `sun_slope` the tangent of
    its height; `cells` [n, 3], `places` [n, 10, 6], `owners` [n, 2] and `stones` [n, 20] are the stores of
    `no_stones`.
    """
    for n in range(count):
        cover = block[n + LOOSE]
        if not cover > 0.0:
            continue
        x, y, footprint = block[n + X], block[n + Y], block[n + FOOTPRINT]
        tint, hx, hy, shade, top = 0.0, 0.0, 0.0, 0.0, 0.0
        cell = WIDEST_M
        # halved and doubled, as no rounding sees
        u, v, seen = x / cell, y / cell, 1.3 * 0.5 * cell / footprint
        for level in range(LEVELS):
            if seen <= 1.0:
                break
            i, j = math.floor(u), math.floor(v)
            at = _slot(i, j, level)
            if cells[at, 0] != i or cells[at, 1] != j or places[at, 9, 0] < cover:
                _lay_in(i, j, level, cell, MORE * cover, sun_slope, salt, at, cells, places)
            dense = cover * (0.35 + 0.13 * level)
            for m in range(cells[at, 2]):
                ex, ey = x - places[at, m, 1], y - places[at, m, 2]
                if ex * ex + ey * ey > places[at, m, 3] or places[at, m, 0] > dense:
                    continue
                a, b = int(places[at, m, 4]), int(places[at, m, 5])
                its = _slot(a, b, level)
                if owners[its, 0] != a or owners[its, 1] != b:
                    _shape(a, b, level, cell, sun_slope, salt, its, owners, stones)
                rise, nx, ny, dark = _met(stones, its, ex, ey, sun_x, sun_y, sun_slope, top)
                keep = min(1.0, seen - 1.0)
                keep = keep * keep * (3.0 - 2.0 * keep)
                if rise > top:
                    top = rise
                    soft = min(1.0, 1.5 * 0.5 * cell / footprint / 3.0)
                    steep = keep * soft * 2.2 * stones[its, 0]
                    tint, shade = keep * stones[its, 4], 0.0
                    hx, hy = stones[its, 2], stones[its, 3]
                    if nx != 0.0 or ny != 0.0:
                        hx, hy = -steep * nx + hx, -steep * ny + hy
                    else:
                        hx, hy = keep * hx, keep * hy
                shade = max(shade, keep * dark)
            cell, seen, u, v = 0.5 * cell, 0.5 * seen, 2.0 * u, 2.0 * v
        block[n + TINT] += mottle * tint
        block[n + GX] += hx
        block[n + GY] += hy
        block[n + SHADE] = max(block[n + SHADE], shade)


@njit(cache=True, nogil=True, error_model="numpy")
def _met(
    stones: Array, at: int, ex: float, ey: float, sun_x: float, sun_y: float, sun_slope: float, top: float
) -> tuple[float, float, float, float]:
    """Return how high the stone in a slot stands at an offset from its middle, m, the slope's direction where
    that is on a side, and how dark its shadow is there, on what is up to `top` high.
    """
    tall, reach = stones[at, 0], stones[at, 1]
    # the sides, seen from the point itself and from where its sun ray passes the stone
    along = -(ex * sun_x + ey * sun_y)
    along = min(max(along, 0.0), reach)
    qx, qy = ex + along * sun_x, ey + along * sun_y
    d, dq, nx, ny = -9.0, -9.0, 0.0, 0.0
    for side in range(5):
        ca, sa, w = stones[at, 5 + 3 * side], stones[at, 6 + 3 * side], stones[at, 7 + 3 * side]
        e = (ex * ca + ey * sa) * w
        if e > d:
            d, nx, ny = e, ca * w, sa * w
        dq = max(dq, (qx * ca + qy * sa) * w)
    if d < 1.0:
        if 2.2 * (1.0 - d) < 1.0:
            return tall * min(1.0, 2.2 * (1.0 - d)), nx, ny, 0.0
        return tall * min(1.0, 2.2 * (1.0 - d)), 0.0, 0.0, 0.0
    dark = 0.0
    if along > 0.0 and dq < 1.0 and top < 0.3 * tall:
        height = tall * min(1.0, 2.2 * (1.0 - dq)) - along * sun_slope
        if height > 0.0:
            dark = min(1.0, height / (0.15 * tall))
    return 0.0, 0.0, 0.0, dark
