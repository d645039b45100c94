"""Ground that a rover may not drive on, found in the heights."""

from __future__ import annotations

import math
from hashlib import blake2b
from typing import Any

import numpy as np
import shapely
from shapely.geometry import Polygon

from mission import TerrainGrid
from planner.path_network.values import FloatArray, NetworkOptions, RoverParameters

KEPT = 4
"""Grounds whose hazards are kept, by the digest of their heights. By hand: some hundred kilobytes each."""
_kept: dict[tuple[Any, ...], tuple[Polygon, ...]] = {}


def hazard_polygons(grid: TerrainGrid, rover: RoverParameters, options: NetworkOptions) -> list[Polygon]:
    """Return outlines of ground that is too steep, has too high a step or is unknown.

    Heights are averaged to cells of at least `terrain_cell_m`; the slope of a cell is that of the plane
    through its surroundings of the rover's size, the step is what the heights in the cell's 3x3 (or finer)
    neighbourhood span beyond that slope. They are kept for the same ground: a keep-out that is dragged asks
    for them again and again.
    """
    heights = np.ascontiguousarray(grid.heights_m, dtype=np.float64)
    ground = (blake2b(heights.data).digest(), heights.shape, grid.origin_east_m, grid.origin_north_m)
    key = (*ground, grid.spacing_m, rover, options)
    found = _kept.get(key)
    if found is None:
        found = _kept[key] = _outlines(grid, heights, rover, options)
        for old in list(_kept)[:-KEPT]:
            _kept.pop(old, None)
    return list(found)


def _outlines(
    grid: TerrainGrid, heights: FloatArray, rover: RoverParameters, options: NetworkOptions
) -> tuple[Polygon, ...]:
    from scipy import ndimage

    known = np.isfinite(heights)
    if not known.all():
        nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
        heights = heights[tuple(nearest)]
    block = max(1, round(options.terrain_cell_m / grid.spacing_m))
    rows, columns = heights.shape[0] // block, heights.shape[1] // block
    if min(rows, columns) < 3:
        block, rows, columns = 1, *heights.shape
    cut = heights[: rows * block, : columns * block].reshape(rows, block, columns, block)
    mean = cut.mean(axis=(1, 3))
    cell = grid.spacing_m * block
    width = max(3, 2 * round(max(rover.clearance_m, cell) / cell) + 1)
    smooth = ndimage.uniform_filter(mean, width, mode="nearest")
    north, east = np.gradient(smooth, cell)
    slope = np.hypot(east, north)
    if block >= 2:
        span = cut.max(axis=(1, 3)) - cut.min(axis=(1, 3))
        reach = cell
    else:
        span = ndimage.maximum_filter(mean, 3) - ndimage.minimum_filter(mean, 3)
        reach = 2 * cell
    step = span - slope * reach * math.sqrt(2.0)
    bad = (slope > math.tan(rover.maximum_slope_rad)) | (step > rover.maximum_step_m)
    if options.unknown_is_hazard and not known.all():
        dark = ~known[: rows * block, : columns * block].reshape(rows, block, columns, block).all(axis=(1, 3))
        hole = max(1, round(rover.clearance_m / cell))
        bad |= ndimage.binary_opening(dark, np.ones((hole + 1, hole + 1), dtype=bool))
    if not bad.any():
        return ()
    west = grid.origin_east_m - grid.spacing_m / 2
    top = grid.origin_north_m + grid.spacing_m / 2
    edges = np.diff(np.pad(bad.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    begin_row, begin = np.nonzero(edges == 1)
    _, end = np.nonzero(edges == -1)
    boxes = shapely.box(
        west + begin * cell, top - (begin_row + 1) * cell, west + end * cell, top - begin_row * cell
    )
    united = shapely.union_all(boxes)
    return tuple(g for g in shapely.get_parts(united).tolist() if isinstance(g, Polygon))
