"""A terrain from a seed.

Two rasters come out, like those of a real site: a fine one round the rover and a coarse one of the
surroundings, both sampled from one `Landscape`, each with its ortho image.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np

from rover_iface.errors import TerrainFormatError
from rover_iface.terrain.geology import Geology
from rover_iface.terrain.grid import HeightLayer, Ortho
from rover_iface.terrain.landscape import Landscape, Recipe
from rover_iface.terrain.ortho import paint
from rover_iface.terrain.rocks import raise_rocks
from rover_iface.terrain.terrain import Terrain


def generate_terrain(
    seed: int = 0,
    size_m: float = 128.0,
    *,
    rock_cover: float = 0.05,
    recipe: Recipe | None = None,
    **options: float | bool | str | Geology | None,
) -> Terrain:
    """Return a terrain made from a seed; the rover's start, the origin of the frame, lies on clear ground.

    `options` are the other members of `Recipe`. The same recipe gives the same terrain, byte for byte.
    """
    if recipe is None:
        try:
            recipe = Recipe(seed=seed, size_m=size_m, rock_cover=rock_cover, **options)  # type: ignore[arg-type]
        except TypeError as err:
            raise TerrainFormatError(f"terrain recipe: {err}") from err
    return _survey(Landscape(recipe))


def _survey(landscape: Landscape) -> Terrain:
    """Return both rasters of a landscape with its rocks, its ortho images and digest."""
    recipe = landscape.recipe
    rocks = landscape.rocks()
    layers: list[HeightLayer] = []
    orthos: list[Ortho] = []
    extents = [(recipe.inner_m, recipe.inner_spacing_m, 2)] if recipe.inner_m < recipe.size_m else []
    extents.append((recipe.size_m, recipe.spacing_m, 2))
    digest = hashlib.sha256()
    for extent, spacing, finer in extents:
        count = round(extent / spacing)
        axis = (np.arange(count) + 0.5) * spacing - extent / 2
        ground = landscape.ground(axis, axis)
        near = [r for r in rocks if max(abs(r.x), abs(r.y)) < extent / 2 + r.diameter]
        surface = raise_rocks(ground, float(axis[0]), float(axis[0]), spacing, near)
        # Millimetres, as in the files: what is generated and what is read back are the same.
        ground, surface = np.round(ground, 3), np.round(surface, 3)
        layers.append(
            HeightLayer(
                surface.astype(np.float32),
                float(axis[0]),
                float(axis[0]),
                spacing,
                ground=ground.astype(np.float32),
                name=f"{extent:g}m",
            )
        )
        digest.update(layers[-1].heights.tobytes())
        if recipe.ortho:
            pixel = spacing / finer
            pixels = paint(landscape, near, extent, pixel)
            half = extent / 2
            orthos.append(Ortho((-half, -half, half, half), pixels=pixels))
    name = recipe.name or f"generated-{recipe.seed}"
    return Terrain(
        name,
        tuple(layers),
        tuple(orthos),
        rocks,
        credits="Generated terrain, no real place",
        origin={"seed": float(recipe.seed)},
        sha256=digest.hexdigest(),
        surface=None
        if recipe.geology is None
        else replace(recipe.geology.surface, geology=recipe.geology.name, wind_rad=landscape.wind_rad),
    )
