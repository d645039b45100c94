"""Segments that obstacles surely close, found on a grid before exact geometry is asked.

What lies nearer to a point of an obstacle than the clearance is blocked. So a segment is closed where it
passes through a disc round one of the points along the outlines. The discs are noted in the cells that they
touch, and a segment asks those of the cells that it passes (Amanatides and Woo 1987), until one stops it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from planner.path_network.values import FloatArray

IntArray = npt.NDArray[np.int64]

CELL_M = 4.0
"""Of the grid. By hand: a rock's outline is in one or two cells."""

INSIDE = 0.98
"""Part of the clearance that a disc has: what it stops is stopped by the exact geometry too."""

MOST_CELLS = 4_000_000
"""Cells become larger on maps that would have more: 8 km across with the usual ones."""


class Discs:
    """Discs that lie wholly in the margins of obstacles.

    Parameters
    ----------
    bodies
        The obstacles without their margins, site frame, m.
    clearance_m
        What the margins are at least; with 0 no segment is closed by this.
    """

    def __init__(self, bodies: Sequence[BaseGeometry], clearance_m: float) -> None:
        self.radius_m = INSIDE * clearance_m
        self._some = bool(bodies) and self.radius_m > 0.0
        if not self._some:
            return
        outlines = shapely.segmentize(np.array(bodies, dtype=object), self.radius_m)
        self._xy = np.unique(shapely.get_coordinates(outlines), axis=0)
        self._low = self._xy.min(axis=0) - self.radius_m
        size = self._xy.max(axis=0) + self.radius_m - self._low
        self._cell_m = max(CELL_M, float(np.sqrt(size.prod() / MOST_CELLS)))
        self._shape = np.maximum(1, np.ceil(size / self._cell_m).astype(np.int64))
        reach = self.radius_m * np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]])
        corner = (self._xy[:, None] + reach - self._low) // self._cell_m
        inside = np.clip(corner.astype(np.int64), 0, self._shape - 1)
        cell = np.sort(inside[..., 0] * self._shape[1] + inside[..., 1], axis=1)
        new = np.ones(cell.shape, dtype=bool)
        new[:, 1:] = cell[:, 1:] != cell[:, :-1]
        disc = np.broadcast_to(np.arange(len(cell))[:, None], cell.shape)[new]
        order = np.argsort(cell[new], kind="stable")
        self._disc = disc[order]
        self._begin = np.searchsorted(cell[new][order], np.arange(self._shape.prod() + 1))

    def close(self, first: FloatArray, second: FloatArray) -> npt.NDArray[np.bool_]:
        """Return which segments [n] between two points, shapes (n, 2), site frame, m, a disc closes."""
        if not self._some or not len(first):
            return np.zeros(len(first), dtype=bool)
        return np.asarray(
            _closed(
                first - self._low,
                second - self._low,
                self._xy - self._low,
                self.radius_m,
                self._cell_m,
                self._shape,
                self._disc,
                self._begin,
            )
        )


@numba.njit(cache=True, nogil=True)
def _meets(  # pragma: no cover - compiled
    ax: float, ay: float, bx: float, by: float, x: float, y: float, radius: float
) -> bool:
    """Return whether a point is nearer to the segment from a to b than the radius."""
    along_x, along_y = bx - ax, by - ay
    square = along_x * along_x + along_y * along_y
    share = 0.0 if square == 0.0 else ((x - ax) * along_x + (y - ay) * along_y) / square
    share = min(1.0, max(0.0, share))
    east, north = ax + share * along_x - x, ay + share * along_y - y
    return east * east + north * north < radius * radius


@numba.njit(cache=True, nogil=True)
def _closed(  # pragma: no cover - compiled
    first: FloatArray,
    second: FloatArray,
    xy: FloatArray,
    radius: float,
    cell: float,
    shape: IntArray,
    disc: IntArray,
    begin: IntArray,
) -> npt.NDArray[np.bool_]:
    """Return which segments meet a disc; all in metres from the south-western corner of the grid.

    `disc` holds the numbers of the discs of the cells, those of cell c from `begin[c]` on.
    """
    found = np.zeros(len(first), np.bool_)
    for k in range(len(first)):
        ax, ay, bx, by = first[k, 0], first[k, 1], second[k, 0], second[k, 1]
        i, j = int(np.floor(ax / cell)), int(np.floor(ay / cell))
        last_i, last_j = int(np.floor(bx / cell)), int(np.floor(by / cell))
        step_i, step_j = (1 if bx > ax else -1), (1 if by > ay else -1)
        # The share of the segment at which it comes into the next column and the next row.
        per_i = abs(cell / (bx - ax)) if bx != ax else np.inf
        per_j = abs(cell / (by - ay)) if by != ay else np.inf
        to_i = abs(((i + (step_i > 0)) * cell - ax) / (bx - ax)) if bx != ax else np.inf
        to_j = abs(((j + (step_j > 0)) * cell - ay) / (by - ay)) if by != ay else np.inf
        for _ in range(abs(last_i - i) + abs(last_j - j) + 1):
            if 0 <= i < shape[0] and 0 <= j < shape[1]:
                at = i * shape[1] + j
                for d in range(begin[at], begin[at + 1]):
                    if _meets(ax, ay, bx, by, xy[disc[d], 0], xy[disc[d], 1], radius):
                        found[k] = True
                        break
            if found[k]:
                break
            if to_i < to_j:
                i, to_i = i + step_i, to_i + per_i
            else:
                j, to_j = j + step_j, to_j + per_j
    return found
