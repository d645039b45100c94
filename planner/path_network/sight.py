"""Segments that the outline of blocked ground stops, found on a grid.

A segment between two points outside passes through the inside exactly where it crosses the outline. The
outline's pieces are noted in the cells that they touch, and a segment asks those of the cells that it passes
(Amanatides and Woo 1987), until one stops it.
"""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from planner.path_network.values import FloatArray, IntArray

CELL_M = 4.0
"""Of the grid, and of the outline's pieces at most. By hand: a rock's outline is in one or two cells."""

MOST_CELLS = 4_000_000
"""Cells become larger on maps that would have more: 8 km across with the usual ones."""

_HAIR_M = 1e-6  # pieces so near to a cell count as in it: what rounding may move a crossing is far less


class Outline:
    """The outline of blocked ground.

    Parameters
    ----------
    ground
        Polygons, site frame, m. May be empty.
    """

    def __init__(self, ground: BaseGeometry) -> None:
        self._some = not ground.is_empty
        if not self._some:
            return
        west, south, east, north = ground.bounds
        self._low = np.array([west, south]) - _HAIR_M
        size = np.array([east, north]) + _HAIR_M - self._low
        self._cell_m = max(CELL_M, float(np.sqrt(size.prod() / MOST_CELLS)))
        self._shape = np.maximum(1, np.ceil(size / self._cell_m).astype(np.int64))
        rings = shapely.get_rings(shapely.get_parts(shapely.segmentize(ground, self._cell_m)))
        xy, ring = shapely.get_coordinates(rings, return_index=True)
        same = np.flatnonzero(ring[1:] == ring[:-1])
        self._piece = np.stack([xy[same], xy[same + 1]], axis=1) - self._low
        # No piece is longer than a cell, so it touches none but those of the corners of its box.
        west_south = self._piece.min(axis=1) - _HAIR_M
        east_north = self._piece.max(axis=1) + _HAIR_M
        box = np.stack([west_south, east_north], axis=1) // self._cell_m
        box = np.clip(box.astype(np.int64), 0, self._shape - 1)
        cell = box[:, [0, 0, 1, 1], 0] * self._shape[1] + box[:, [0, 1, 0, 1], 1]
        new = np.ones(cell.shape, dtype=bool)
        new[:, 1] = box[:, 0, 1] != box[:, 1, 1]
        new[:, 2] = box[:, 0, 0] != box[:, 1, 0]
        new[:, 3] = new[:, 1] & new[:, 2]
        piece = np.broadcast_to(np.arange(len(cell))[:, None], cell.shape)[new]
        order = np.argsort(cell[new], kind="stable")
        self._number = piece[order]
        self._begin = np.searchsorted(cell[new][order], np.arange(self._shape.prod() + 1))

    def stops(self, first: FloatArray, second: FloatArray) -> npt.NDArray[np.bool_]:
        """Return which segments [n] between two points, shapes (n, 2), site frame, m, meet the outline."""
        if not self._some or not len(first):
            return np.zeros(len(first), dtype=bool)
        return np.asarray(
            _stopped(
                first - self._low,
                second - self._low,
                self._cell_m,
                self._shape,
                self._piece,
                self._number,
                self._begin,
            )
        )


@numba.njit(cache=True, nogil=True)
def _beside(ax: float, ay: float, bx: float, by: float, px: float, py: float) -> float:
    """Return on which side of the line from a to b a point lies: positive on the left."""
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)


@numba.njit(cache=True, nogil=True)
def _meets(ax: float, ay: float, bx: float, by: float, piece: FloatArray) -> bool:
    """Return whether the segment from a to b meets a piece, shape (2, 2)."""
    px, py, qx, qy = piece[0, 0], piece[0, 1], piece[1, 0], piece[1, 1]
    if max(px, qx) < min(ax, bx) or min(px, qx) > max(ax, bx):
        return False
    if max(py, qy) < min(ay, by) or min(py, qy) > max(ay, by):
        return False
    if _beside(ax, ay, bx, by, px, py) * _beside(ax, ay, bx, by, qx, qy) > 0.0:
        return False
    return _beside(px, py, qx, qy, ax, ay) * _beside(px, py, qx, qy, bx, by) <= 0.0


@numba.njit(cache=True, nogil=True)
def _stopped(
    first: FloatArray,
    second: FloatArray,
    cell: float,
    shape: IntArray,
    piece: FloatArray,
    number: IntArray,
    begin: IntArray,
) -> npt.NDArray[np.bool_]:
    """Return which segments meet a piece; all in metres from the south-western corner of the grid.

    `number` holds the numbers of the pieces of the cells, those of cell c from `begin[c]` on.
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
                    if _meets(ax, ay, bx, by, piece[number[d]]):
                        found[k] = True
                        break
            if found[k]:
                break
            if to_i < to_j:
                i, to_i = i + step_i, to_i + per_i
            else:
                j, to_j = j + step_j, to_j + per_j
    return found
