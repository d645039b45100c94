"""A folder of pictures of a real site as terrain and panorama: `reconstruct(folder)`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.cameras.panorama import Panorama, StereoWedge
from rover_iface.errors import PicturesError
from rover_iface.frames import Transform, rpy_of
from rover_iface.reconstruction.described_pairs import DESCRIPTION, described_pairs
from rover_iface.reconstruction.fusion import FusedHeights, Grid, fuse, grid_over, ortho_of
from rover_iface.reconstruction.outcomes import Refusal, RefusedError
from rover_iface.reconstruction.pair_surface import PairSurface, SurfaceOptions, pair_surface
from rover_iface.reconstruction.picture_pairs import PicturePair, labelled_pairs
from rover_iface.reconstruction.row_check import RowLimits, check_rows
from rover_iface.terrain.grid import HeightLayer, Ortho
from rover_iface.terrain.panorama_files import panorama_files
from rover_iface.terrain.terrain import Terrain

Mask = npt.NDArray[np.bool_]
Progress = Callable[[str], None]

WHEELS_SIGMA_M = 0.05
"""What ground under the wheels may be off the plane that they stand on: a stone of half a wheel's radius."""

UNDER_ROVER_SLOPE = 0.05
"""How fast the plane of the wheels is trusted less outside the wheels: 3 degrees of ground that bends
away."""


@dataclass(frozen=True, slots=True)
class SiteOptions:
    """How a site is made from pictures.

    `most_sigma_m`: a height that may be off by more than half of what a rover can climb decides nothing.
    `under_rover_m`: radius of ground round the rover, which no camera sees, that is taken as the plane of
    its wheels; 0 leaves the hole.
    """

    spacing_m: float = 0.05
    most_sigma_m: float = 0.15
    under_rover_m: float = 0.0
    surface: SurfaceOptions = field(default_factory=SurfaceOptions)
    rows: RowLimits = field(default_factory=RowLimits)

    def __post_init__(self) -> None:
        if not 0.005 <= self.spacing_m <= 10.0:
            raise PicturesError(f"spacing of the posts is {self.spacing_m} m; 0.005 to 10 are possible")
        if not 0.0 <= self.under_rover_m <= 10.0:
            raise PicturesError(
                f"ground under the rover reaches {self.under_rover_m} m; 0 to 10 are possible"
            )


@dataclass(frozen=True, slots=True, eq=False)
class SiteModel:
    """A site made from pictures.

    Attributes
    ----------
    terrain
        Its origin is where the rover stands; the mask tells what cameras saw.
    panorama
        The pictures that were used, with their cameras, in the terrain's frame.
    refused
        What was not used, and why.
    """

    terrain: Terrain
    panorama: Panorama
    surfaces: tuple[PairSurface, ...]
    refused: tuple[Refusal, ...]
    assumed_posts: int

    def terrain_in(self, folder: Path) -> Terrain:
        """Return the terrain with its panorama, which was saved in a folder."""
        return replace(self.terrain, panorama=panorama_files(folder))


def reconstruct(
    folder: Path, options: SiteOptions | None = None, progress: Progress | None = None
) -> SiteModel:
    """Return the terrain and the panorama that a folder of pictures gives.

    Raises
    ------
    PicturesError
        If no pair of the folder can be used; the message names each picture and what is wrong with it.
    """
    options = options or SiteOptions()
    tell = progress or (lambda _: None)
    if not folder.is_dir():
        raise PicturesError(f"{folder} is not a folder")
    refused: list[Refusal] = []
    name, credits = folder.name, ""
    if (folder / DESCRIPTION).is_file():
        told = described_pairs(folder, refused)
        name, credits, pairs = told.name, told.credits, told.pairs
    else:
        pairs = labelled_pairs(folder, refused)
    pairs, start = _about_rover(pairs) if pairs else ([], Transform.identity())
    surfaces = []
    for number, pair in enumerate(pairs, 1):
        tell(f"pair {number} of {len(pairs)}: {pair.name}")
        try:
            check = check_rows(pair, options.rows)
            surfaces.append(pair_surface(pair, check, options.surface))
        except RefusedError as err:
            refused.append(err.refusal)
    if not surfaces:
        raise PicturesError(_nothing_left(folder, refused))
    tell("heights")
    fused = fuse(surfaces, grid_over(surfaces, options.spacing_m), options.most_sigma_m, refused)
    if not np.isfinite(fused.heights).any():
        raise PicturesError(
            f"{folder}: no height is known to {options.most_sigma_m:g} m; what is seen is too far"
        )
    tell("ortho image")
    terrain, assumed = _terrain(fused, options, start, name, credits)
    return SiteModel(terrain, _panorama(fused.used, name), fused.used, tuple(refused), assumed)


def _nothing_left(folder: Path, refused: list[Refusal]) -> str:
    if not refused:
        return f"{folder} holds no pictures: neither {DESCRIPTION} nor products (.img, .lbl, .vic, .json)"
    return "\n".join([f"no pair of {folder} can be used", *(f"  {r}" for r in refused)])


def _about_rover(pairs: list[PicturePair]) -> tuple[list[PicturePair], Transform]:
    """Return pairs in a site frame that begins where the rover stands, and its pose there.

    It stands where the last pictures were taken, by the motion counter.
    """
    last = max(pairs, key=lambda p: p.place).site_from_rover
    shift = Transform(np.eye(3), -last.translation)
    moved = [
        replace(
            p,
            left_camera=p.left_camera.transformed(shift),
            right_camera=p.right_camera.transformed(shift),
            site_from_rover=shift * p.site_from_rover,
            errors=None if p.errors is None else _shifted(p.errors, last.translation),
        )
        for p in pairs
    ]
    return moved, shift * last


def _shifted(errors: Callable[[Array], Array], by: npt.NDArray[np.floating]) -> Callable[[Array], Array]:
    return lambda points: errors(points + by)


def _terrain(
    fused: FusedHeights, options: SiteOptions, start: Transform, name: str, credits: str
) -> tuple[Terrain, int]:
    """Return the terrain, and how many posts of it are the plane of the wheels."""
    seen = np.isfinite(fused.heights)
    image = ortho_of(fused.used, fused.grid, seen)
    grid, heights, sigma = fused.grid, fused.heights, fused.sigma
    if options.under_rover_m > 0:
        grid, heights, sigma, seen, image = _under_rover(fused, image, options.under_rover_m, start)
    assumed = int((np.isfinite(heights) & ~seen).sum())
    layer = HeightLayer(
        heights.astype(np.float32),
        grid.west,
        grid.south,
        grid.spacing,
        mask=seen,
        sigma=sigma.astype(np.float32),
    )
    heading = rpy_of(start.rotation)[2]
    ortho = Ortho(layer.bounds, pixels=image)
    return Terrain(name, (layer,), (ortho,), (), credits, {"heading_rad": float(heading)}), assumed


def _under_rover(
    fused: FusedHeights, image: npt.NDArray[np.uint8], radius_m: float, start: Transform
) -> tuple[Grid, Array, Array, Mask, npt.NDArray[np.uint8]]:
    """Return grid, heights, sigma, what was seen, and ortho, widened to the ground round the rover.

    Holes there become the plane that the wheels stand on, whose uncertainty grows away from them.
    """
    old = fused.grid
    reach = math.ceil(radius_m / old.spacing)
    first = [round(v / old.spacing) for v in (old.west, old.south)]
    last = [first[0] + old.columns - 1, first[1] + old.rows - 1]
    before = [max(0, f + reach) for f in first]
    after = [max(0, reach - v) for v in last]
    pad = ((before[1], after[1]), (before[0], after[0]))
    grid = Grid(
        old.west - before[0] * old.spacing,
        old.south - before[1] * old.spacing,
        old.spacing,
        old.rows + sum(pad[0]),
        old.columns + sum(pad[1]),
    )
    heights, sigma = (np.pad(v, pad, constant_values=np.nan) for v in (fused.heights, fused.sigma))
    seen = np.isfinite(heights)
    x = grid.west + np.arange(grid.columns) * grid.spacing
    y = (grid.south + np.arange(grid.rows) * grid.spacing)[:, None]
    away = np.hypot(x, y)
    up = start.rotation[:, 2]
    plane = -(up[0] * x + up[1] * y) / up[2]
    patch = ~seen & (away <= radius_m)
    heights[patch] = plane[patch]
    sigma[patch] = np.hypot(WHEELS_SIGMA_M, UNDER_ROVER_SLOPE * away)[patch]
    wide = np.pad(image, ((2 * pad[0][1], 2 * pad[0][0]), (2 * pad[1][0], 2 * pad[1][1]), (0, 0)))
    return grid, heights, sigma, seen, wide


def _panorama(surfaces: tuple[PairSurface, ...], name: str) -> Panorama:
    """Return the pictures of the pairs that were used, 8-bit, with their cameras."""
    return Panorama(
        [
            StereoWedge(
                s.pair.name,
                np.round(255.0 * s.pair.left).astype(np.uint8),
                np.round(255.0 * s.pair.right).astype(np.uint8),
                s.pair.left_camera,
                s.check.right_camera,
            )
            for s in surfaces
        ],
        name,
    )
