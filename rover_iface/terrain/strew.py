"""Rocks strewn on a terrain that has none, or more of them: on a real DEM, or where the map does not show
them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rover_iface.streams import stream
from rover_iface.terrain.banks import wind_of
from rover_iface.terrain.geology import Geology, dressed
from rover_iface.terrain.rocks import Rock, draw_rocks, raise_rocks
from rover_iface.terrain.terrain import Terrain


def strew_rocks(
    terrain: Terrain,
    *,
    seed: int,
    half_m: float = 16.0,
    total_cover: float = 0.05,
    smallest_m: float = 0.12,
    largest_m: float = 1.5,
    keep_clear: Sequence[tuple[float, float, float]] = (),
    prefix: str = "S",
    geology: Geology | None = None,
) -> Terrain:
    """Return the terrain with rocks by the Golombek-Rapp law in the square of `half_m` round the origin.

    `keep_clear` are circles (x, y, radius) in which none may lie. Heights include the new rocks; `ground`
    heights stay without any. The picture is left as it was. A `geology` gives the rocks its families and
    colours, and the ground its surface with no sand banked.
    """
    rng = stream("strewn rocks", seed)
    table = draw_rocks(
        rng,
        west=-half_m,
        south=-half_m,
        east=half_m,
        north=half_m,
        total_cover=total_cover,
        smallest_m=smallest_m,
        largest_m=largest_m,
    )
    return add_rocks(terrain, table, seed=seed, keep_clear=keep_clear, prefix=prefix, geology=geology)


def add_rocks(
    terrain: Terrain,
    table: np.ndarray[tuple[int, int], np.dtype[np.floating]],
    *,
    seed: int,
    keep_clear: Sequence[tuple[float, float, float]] = (),
    prefix: str = "S",
    geology: Geology | None = None,
) -> Terrain:
    """Return the terrain with rocks at places and of diameters [n, 3], m, site frame, as in `strew_rocks`."""
    rng = stream("shapes of rocks", seed)
    numbers = rng.random((len(table), 5))
    seeds = rng.integers(0, 2**31 - 1, len(table))
    feet = terrain.height(table[:, 0], table[:, 1], ground=True)
    rocks = []
    for k, ((x, y, d), z, n, s) in enumerate(zip(table.tolist(), feet, numbers, seeds, strict=True)):
        if not math.isfinite(z):
            continue
        if any(math.hypot(x - cx, y - cy) < radius + d / 2 for cx, cy, radius in keep_clear):
            continue
        rocks.append(
            Rock(
                id=f"{prefix}{k + 1:05d}",
                x=round(x, 4),
                y=round(y, 4),
                z=round(float(z), 4),
                diameter=round(d, 4),
                height=round(float(d * (0.32 + 0.42 * n[0])), 4),
                yaw=round(float(n[1] * 2 * math.pi), 4),
                elongation=round(float(0.6 + 0.4 * n[2]), 4),
                burial=round(float(0.15 + 0.4 * n[3]), 4),
                seed=int(s),
            )
        )
    surface = terrain.surface
    if geology is not None:
        wind = wind_of(seed)
        rocks = list(dressed(rocks, geology, seed=seed, wind_rad=wind))
        surface = replace(geology.surface, geology=geology.name, wind_rad=wind, banks=0.0)
    layers = []
    for layer in terrain.layers:
        west, south, east, north = layer.bounds
        near = [r for r in rocks if west - 2 < r.x < east + 2 and south - 2 < r.y < north + 2]
        heights = raise_rocks(
            layer.heights.astype(np.float64), layer.west, layer.south, layer.spacing, near
        ).astype(np.float32)
        ground = layer.ground if layer.ground is not None else layer.heights
        layers.append(replace(layer, heights=heights, ground=ground))
    return replace(terrain, layers=tuple(layers), rocks=(*terrain.rocks, *rocks), surface=surface)
