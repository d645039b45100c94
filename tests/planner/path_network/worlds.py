"""Random worlds for the path network: targets, observation points short of them, and keep-outs."""

from __future__ import annotations

import math

import numpy as np
import shapely

from mission import TerrainGrid
from planner.path_network import (
    KeepOut,
    NetworkOptions,
    NetworkRequest,
    ObservationPoint,
    Pose,
    RoverParameters,
    Target,
)
from planner.path_network.hazards import hazard_polygons


def random_world(seed: int, *, targets: int = 8, keep_outs: int = 8, size_m: float = 30.0) -> NetworkRequest:
    """Return a request whose start and targets lie outside every keep-out; no terrain."""
    rng = np.random.default_rng(seed)
    middle = np.array([size_m / 2, size_m / 2])
    shapes: list[shapely.Polygon] = []
    regions: list[KeepOut] = []
    while len(regions) < keep_outs:
        centre = rng.uniform(2, size_m - 2, 2)
        corners = int(rng.integers(3, 9))
        angle = np.sort(rng.uniform(0, 2 * math.pi, corners))
        ring = centre + rng.uniform(0.6, 1.0, (corners, 1)) * rng.uniform(0.6, 2.5) * np.column_stack(
            [np.cos(angle), np.sin(angle)]
        )
        shape = shapely.Polygon(ring)
        if not shape.is_valid or shape.area < 0.3 or shape.distance(shapely.Point(*middle)) < 0.8:
            continue
        shapes.append(shape)
        regions.append(KeepOut(f"K{len(regions)}", ring.tolist()))
    solid = shapely.union_all(shapes)
    aims: list[Target] = []
    stands: list[ObservationPoint] = []
    while len(aims) < targets:
        at = rng.uniform(2, size_m - 2, 2)
        if solid.distance(shapely.Point(*at)) < 0.1:
            continue
        back = middle - at
        stand = at + 0.8 * back / np.hypot(*back)
        name = f"T{len(aims)}"
        aims.append(Target(name, float(at[0]), float(at[1]), tracked=bool(rng.random() < 0.7)))
        heading = math.atan2(-back[1], -back[0])
        stands.append(ObservationPoint(f"O{name}", name, Pose(float(stand[0]), float(stand[1]), heading)))
    return NetworkRequest(
        Pose(float(middle[0]), float(middle[1])),
        tuple(aims),
        tuple(stands),
        tuple(regions),
        bounds_m=(0.0, 0.0, size_m, size_m),
    )


def rocky_world(
    seed: int, *, rocks: int, points: int, size_m: float, spacing_m: float = 0.25
) -> NetworkRequest:
    """Return a request on flat ground with rocks; every other observation point stands close to one."""
    rng = np.random.default_rng(seed)
    cells = int(size_m / spacing_m)
    heights = np.zeros((cells, cells))
    north, east = (np.mgrid[0:cells, 0:cells] + 0.5) * spacing_m
    for _ in range(rocks):
        at, radius = rng.uniform(3.0, size_m - 3.0, 2), rng.uniform(0.3, 1.5)
        heights[np.hypot(north - at[1], east - at[0]) < radius] = rng.uniform(0.4, 1.0)
    grid = TerrainGrid(spacing_m / 2, size_m - spacing_m / 2, spacing_m, heights[::-1])
    solid = shapely.union_all(hazard_polygons(grid, RoverParameters(), NetworkOptions()))

    def stand(least_m: float) -> tuple[float, float]:
        while True:
            at = rng.uniform(3.0, size_m - 3.0, 2)
            if solid.distance(shapely.Point(*at)) > least_m:
                return float(at[0]), float(at[1])

    places = [stand(0.25 if k % 2 else 0.7) for k in range(points)]
    return NetworkRequest(
        Pose(*stand(0.7)),
        tuple(Target(f"T{k}", *at, tracked=False) for k, at in enumerate(places)),
        tuple(ObservationPoint(f"O{k}", f"T{k}", Pose(*at)) for k, at in enumerate(places)),
        terrain=grid,
    )
