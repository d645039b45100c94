"""Hazards of the same ground are kept; the ground itself is not."""

from __future__ import annotations

import tracemalloc

import numpy as np

from mission import TerrainGrid
from planner.path_network.hazards import KEPT, hazard_polygons
from planner.path_network.values import NetworkOptions, RoverParameters


def outlines(heights_m: np.ndarray, east_m: float = 0.0) -> list[str]:
    grid = TerrainGrid(east_m, 0.0, 0.1, heights_m)
    return [p.wkt for p in hazard_polygons(grid, RoverParameters(), NetworkOptions())]


def with_wall(height_m: float) -> np.ndarray:
    heights = np.zeros((120, 120))
    heights[50:70, 50:70] = height_m
    return heights


def test_each_ground_has_its_own_hazards_however_often_it_is_asked_for() -> None:
    wall, low = with_wall(1.0), with_wall(0.01)
    first = outlines(wall)
    assert first
    assert outlines(low) == []
    assert outlines(wall) == first
    moved = outlines(wall, east_m=5.0)
    assert moved
    assert moved != first
    wall[50:70, 50:70] = 0.0  # the caller's array is not what was kept
    assert outlines(wall) == []


def test_no_heights_are_kept() -> None:
    size = 500
    outlines(np.zeros((size, size)))  # imports
    tracemalloc.start()
    for k in range(KEPT):
        outlines(np.full((size, size), float(k)))
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert kept < size * size * 8
