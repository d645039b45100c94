"""Pairs of corners whose segment hugs both, all of them or those that lie near each other."""

from __future__ import annotations

import numba
import numpy as np

from planner.path_network.values import FloatArray, IntArray

_EPS = 1e-9

SECTORS, NEAREST, LOOKED_AT = 12, 3, 400
"""Directions in which near corners are looked for, corners in each, and neighbours that they come from. By
hand: 36 segments to be looked at from a corner, of about 25 obstacles round it."""

_PER_CELL, _MOST_CELLS = 32.0, 1_000_000
"""Nodes in the cell of a node, in the mean, up to which cells are halved, and how many cells there are at
most. By hand: some 5 by 5 cells hold those looked at, also where all obstacles lie in a corner of the map.
"""


def near_pairs(xy: FloatArray, before: FloatArray, after: FloatArray) -> IntArray:
    """Return tangent pairs (p, 2) of nodes that lie near each other, in each direction the nearest.

    `xy`, `before` and `after` [n, 2] are nodes and the corners before and after them, site frame, m; NaN
    for nodes that all segments hug. A pair may come twice, once from either end.
    """
    low = xy.min(axis=0)
    size = xy.max(axis=0) - low
    cell_m = max(float(size.max()), 1e-6)
    while True:
        shape = (size / cell_m).astype(np.int64) + 1
        column, row = ((xy - low) / cell_m).astype(np.int64).T
        cell = column * shape[1] + row
        held = np.bincount(cell, minlength=shape.prod())
        if held[cell].mean() <= _PER_CELL or 4 * shape.prod() > _MOST_CELLS:
            break
        cell_m /= 2.0
    order = np.argsort(cell, kind="stable")
    begin = np.concatenate([[0], np.cumsum(held)])
    return np.asarray(_near(xy - low, before - low, after - low, cell_m, shape, order, begin))


@numba.njit(cache=True, nogil=True)
def hugs(xy: FloatArray, before: FloatArray, after: FloatArray, at: int, other: int) -> bool:
    """Return whether the segment to another node hugs the corner `at`; a plain node hugs all.

    `xy`, `before` and `after` [n, 2] as for `near_pairs`. A segment hugs a corner when both edges of the
    corner are on one side of it.
    """
    if np.isnan(before[at, 0]):
        return True
    east, north = xy[other, 0] - xy[at, 0], xy[other, 1] - xy[at, 1]
    one = east * (before[at, 1] - xy[at, 1]) - north * (before[at, 0] - xy[at, 0])
    two = east * (after[at, 1] - xy[at, 1]) - north * (after[at, 0] - xy[at, 0])
    return one * two >= -_EPS


@numba.njit(cache=True, nogil=True)
def _around(
    at: FloatArray, xy: FloatArray, cell: float, shape: IntArray, order: IntArray, begin: IntArray
) -> IntArray:
    """Return the nodes [k] of a square of cells that surely holds the `LOOKED_AT` nearest to a point (2,)."""
    column, row = int(at[0] / cell), int(at[1] / cell)
    reach = 1
    while True:
        first, last = max(0, row - reach), min(shape[1] - 1, row + reach)
        columns = range(max(0, column - reach), min(shape[0] - 1, column + reach) + 1)
        whole = first == 0 and last == shape[1] - 1 and len(columns) == shape[0]
        held = 0
        for c in columns:
            held += begin[c * shape[1] + last + 1] - begin[c * shape[1] + first]
        if held >= LOOKED_AT or whole:
            found = np.empty(held, np.int64)
            held = 0
            for c in columns:
                for k in range(begin[c * shape[1] + first], begin[c * shape[1] + last + 1]):
                    found[held] = order[k]
                    held += 1
            # Nothing outside the square is nearer than its sides are.
            sure = min(at[0] - (column - reach) * cell, at[1] - (row - reach) * cell)
            sure = min(sure, (column + reach + 1) * cell - at[0], (row + reach + 1) * cell - at[1])
            inside = 0
            for node in found:
                inside += (xy[node, 0] - at[0]) ** 2 + (xy[node, 1] - at[1]) ** 2 < sure * sure
            if inside >= LOOKED_AT or whole:
                return found
        reach += 1 + reach // 4


@numba.njit(cache=True, nogil=True)
def _near(
    xy: FloatArray,
    before: FloatArray,
    after: FloatArray,
    cell: float,
    shape: IntArray,
    order: IntArray,
    begin: IntArray,
) -> IntArray:
    """Return the tangent pairs (p, 2) of each node with the nearest in each direction.

    `order` holds the nodes of the grid's cells, those of cell c from `begin[c]` on.
    """
    found = np.empty((len(xy) * SECTORS * NEAREST, 2), dtype=np.int64)
    count = 0
    taken = np.zeros(SECTORS, dtype=np.int64)
    for a in range(len(xy)):
        others = _around(xy[a], xy, cell, shape, order, begin)
        square = (xy[others, 0] - xy[a, 0]) ** 2 + (xy[others, 1] - xy[a, 1]) ** 2
        most = np.inf
        if len(others) > LOOKED_AT:
            most = np.partition(square, LOOKED_AT - 1)[LOOKED_AT - 1]
        kept = 0
        for k in range(len(others)):
            b = others[k]
            if (
                square[k] <= most
                and b != a
                and hugs(xy, before, after, a, b)
                and hugs(xy, before, after, b, a)
            ):
                others[kept], square[kept] = b, square[k]
                kept += 1
        taken[:] = 0
        for k in np.argsort(square[:kept]):
            b = others[k]
            angle = np.arctan2(xy[b, 1] - xy[a, 1], xy[b, 0] - xy[a, 0]) + np.pi
            sector = int(angle / (2 * np.pi) * SECTORS) % SECTORS
            if taken[sector] < NEAREST:
                taken[sector] += 1
                found[count, 0], found[count, 1] = a, b
                count += 1
    return found[:count]


@numba.njit(cache=True, nogil=True)
def tangent_pairs(xy: FloatArray, before: FloatArray, after: FloatArray) -> IntArray:
    """Return all tangent pairs (p, 2) of nodes, lower first; `xy`, `before` and `after` [n, 2] as for
    `near_pairs`.
    """
    found = np.empty((1024, 2), dtype=np.int64)
    count = 0
    for a in range(len(xy)):
        for b in range(a + 1, len(xy)):
            if hugs(xy, before, after, a, b) and hugs(xy, before, after, b, a):
                if count == len(found):
                    found = np.concatenate((found, np.empty_like(found)))
                found[count, 0], found[count, 1] = a, b
                count += 1
    return found[:count]
