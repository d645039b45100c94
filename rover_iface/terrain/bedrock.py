"""Bedrock that lies open: plates of a jittered lattice, with sand in the joints between them."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rover_iface.streams import stream
from rover_iface.terrain.geology import Geology
from rover_iface.terrain.rocks import Rock

Array = NDArray[np.floating]

GAP_M = 0.015, 0.05
"""Sand between plates, m; by eye, Opportunity's Navcam frame."""

STEEPEST_BED = 0.15
"""Slope of a plate, 9 degrees: beds of the plains are level within a few degrees, and blocks settle."""


def pavement(
    kind: Geology,
    half_m: float,
    *,
    seed: int,
    open_at: Callable[[Array, Array], Array],
    ground_at: Callable[[Array, Array], Array],
    clear_m: float,
) -> tuple[Rock, ...]:
    """Return plates of bedrock in the square of `half_m` round the origin: cells of a jittered lattice, less
    the gaps between them.

    `open_at` gives how bare places x, y [n] are, 0..1: plates lie where it exceeds a half. `ground_at` gives
    heights, m, of such places. A plate leans as the ground does, but no more than `STEEPEST_BED`: on steeper
    ground it is a step. None lies within `clear_m` of the origin.
    """
    from scipy.spatial import Voronoi

    rng = stream("pavement", seed)
    count = math.ceil(2 * half_m / kind.plate_m) + 2
    lattice = (np.stack(np.meshgrid(np.arange(count), np.arange(count)), -1).reshape(-1, 2)).astype(float)
    lattice[:, 0] += 0.5 * (lattice[:, 1] % 2)
    points = (lattice + rng.uniform(-0.42, 0.42, lattice.shape) - count / 2) * kind.plate_m
    draws = rng.random((len(points), 5))
    gauss = rng.normal(size=len(points))
    seeds = rng.integers(0, 2**31 - 1, len(points))
    bare = open_at(points[:, 0], points[:, 1]) > 0.5
    bare &= np.hypot(points[:, 0], points[:, 1]) > clear_m + kind.plate_m
    bare &= np.abs(points).max(axis=1) < half_m - kind.plate_m
    cells = Voronoi(points)
    joints: dict[int, list[tuple[float, float]]] = {}
    for a, b in cells.ridge_points:
        gap = float(np.interp(draws[a, 1] * draws[b, 1], (0, 1), GAP_M))
        for here, there in ((a, b), (b, a)):
            east, north = points[there] - points[here]
            distance = 0.5 * (math.hypot(east, north) - gap)
            joints.setdefault(int(here), []).append((math.atan2(north, east), max(0.02, distance)))
    made: list[Rock] = []
    for k in np.flatnonzero(bare):
        region = cells.regions[cells.point_region[k]]
        if -1 in region or not region:
            continue
        corners = cells.vertices[region]
        reach = float(np.hypot(*(corners - points[k]).T).max())
        if reach > 1.5 * kind.plate_m:
            continue
        heights = ground_at(corners[:, 0], corners[:, 1])
        if not np.isfinite(heights).all():
            continue
        east, north = (corners - points[k]).T
        plane = np.linalg.lstsq(np.column_stack((east, north, np.ones(len(east)))), heights, rcond=None)[0]
        steep = float(np.hypot(plane[0], plane[1]))
        lean = plane[:2] * min(1.0, STEEPEST_BED / max(steep, 1e-9))
        over = heights - lean[0] * east - lean[1] * north
        low, high = float(over.min()), float(over.max())
        top = low + 0.6 * (high - low) + 0.004 + 0.035 * float(draws[k, 2]) ** 2
        of = kind.plate_albedo
        made.append(
            Rock(
                id=f"B{len(made) + 1:05d}",
                x=round(float(points[k, 0]), 4),
                y=round(float(points[k, 1]), 4),
                z=round(low, 4),
                diameter=round(2 * reach, 4),
                height=round(top - low, 4),
                elongation=1.0,
                burial=0.45,
                seed=int(seeds[k]),
                family="plate",
                albedo=round(float(np.clip(of.mean + of.spread * gauss[k], 0.04, 0.6)), 4),
                dust=round(float(kind.dust[0] + (kind.dust[1] - kind.dust[0]) * 0.6 * draws[k, 3]), 4),
                sides=tuple((round(a, 4), round(d, 4)) for a, d in joints[int(k)]),
                lean=(round(float(lean[0]), 4), round(float(lean[1]), 4)),
            )
        )
    return tuple(made)
