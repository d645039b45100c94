"""A landscape from a recipe: fractal ground, rocks, a crater, an outcrop of layered slabs, ripples, ruts.

All of it are functions of place, so that rasters of different spacing agree where they meet.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rover_iface.errors import TerrainFormatError
from rover_iface.streams import stream
from rover_iface.terrain.banks import bank_depth, wind_of
from rover_iface.terrain.bedrock import pavement
from rover_iface.terrain.fractal import Field, smooth_step, spectral_noise
from rover_iface.terrain.geology import Geology, dressed
from rover_iface.terrain.grid import HeightLayer
from rover_iface.terrain.rocks import Rock, draw_rocks

Array = NDArray[np.floating]
T = TypeVar("T")


def _kept_of_a_raster(part: Callable[[Landscape, Array, Array], T]) -> Callable[[Landscape, Array, Array], T]:
    """Keep what a part of the ground was on the raster that was asked last: ground, colours and other parts
    ask for the same one in turn.
    """

    @wraps(part)
    def asked(site: Landscape, xs: Array, ys: Array) -> T:
        key = xs.tobytes(), ys.tobytes()
        known = site.last.get(part.__name__)
        if known is None or known[0] != key:
            known = key, part(site, xs, ys)
            site.last[part.__name__] = known
        return known[1]

    return asked


GAUGE_M, RUT_M, RUT_DEPTH_M = 0.73, 0.12, 0.015
"""Ruts: distance between the two, width and depth; those of the K9 and MER class."""


SLAB_M = 0.85
"""Size of the slabs of an outcrop."""


@dataclass(frozen=True, slots=True)
class Recipe:
    """What to generate. Lengths in metres; `rock_cover` is the share of ground under rocks, `relief_m` twice
    the deviation of heights that 128 m of such ground have, `rough` a factor on the bumps below half a metre.
    `tracks` are the ruts of an earlier drive that ended at the start, `geology` the families of rocks, the
    bedrock and the banked sand; without it all rocks are boulders, and slabs are part of the heights.
    """

    seed: int = 0
    size_m: float = 128.0
    spacing_m: float = 0.25
    inner_m: float = 32.0
    inner_spacing_m: float = 0.05
    relief_m: float = 1.6
    rough: float = 1.0
    rock_cover: float = 0.05
    smallest_rock_m: float = 0.10
    crater: bool = True
    outcrop: bool = True
    ripples: bool = True
    tracks: bool = False
    clear_start_m: float = 1.6
    ortho: bool = True
    name: str = ""
    geology: Geology | None = None

    def __post_init__(self) -> None:
        if not 16 <= self.size_m <= 1024:
            raise TerrainFormatError(f"terrain size is {self.size_m} m; 16 to 1024 m are possible")
        if not 0.02 <= self.inner_spacing_m <= self.spacing_m <= 2:
            raise TerrainFormatError(
                f"post spacings are {self.inner_spacing_m} m inside and {self.spacing_m} m outside; "
                "0.02 to 2 m, the inner not coarser, are possible"
            )
        if not 0 <= self.rock_cover <= 0.4:
            raise TerrainFormatError(f"rock cover is {self.rock_cover}; 0 to 0.4 is possible")
        if not 4 <= self.inner_m <= self.size_m:
            raise TerrainFormatError(f"inner size is {self.inner_m} m; 4 m to the whole size are possible")


class Landscape:
    """Everything drawn once; `ground(xs, ys)` then gives heights on any raster.

    A raster is asked by its axes `xs` [columns] and `ys` [rows], site frame, m; answered is [rows, columns].
    """

    def __init__(self, recipe: Recipe) -> None:
        self.recipe = recipe
        self.last: dict[str, tuple[tuple[bytes, bytes], Any]] = {}
        size = recipe.size_m
        streams = {
            name: np.random.default_rng([recipe.seed, k])
            for k, name in enumerate(
                ("relief", "detail", "warp", "cover", "tone", "place", "rocks", "grain", "crack")
            )
        }
        self.streams = streams
        coarse = 512
        self.relief = Field(spectral_noise(streams["relief"], coarse, 3.6), size)
        self.detail = Field(spectral_noise(streams["detail"], 1024, 2.9), size)
        self.warp = Field(spectral_noise(streams["warp"], coarse, 3.0), size)
        self.cover = Field(spectral_noise(streams["cover"], coarse, 3.2), size)
        self.tone = Field(spectral_noise(streams["tone"], coarse, 2.2), size)
        place = streams["place"]
        start = float(place.uniform(0, 2 * math.pi))
        inner = recipe.inner_m / 2
        # The features lie round the start, in reach of a day's drive but off the start itself.
        self.crater_xy = _polar(start, 0.95 * inner)
        self.crater_radius = 0.28 * inner * float(place.uniform(0.9, 1.2))
        self.outcrop_xy = _polar(start + 2.2 + float(place.uniform(-0.2, 0.2)), 0.72 * inner)
        self.outcrop_angle = float(place.uniform(0, 2 * math.pi))
        self.outcrop_radius = 0.42 * inner
        self.ripple_xy = _polar(start + 4.2 + float(place.uniform(-0.2, 0.2)), 0.85 * inner)
        self.ripple_angle = float(place.uniform(0, math.pi))
        self.ripple_radius = 0.45 * inner
        self.track_angle = float(place.uniform(0, 2 * math.pi))
        self.wind_rad = wind_of(recipe.seed)
        self.banked: tuple[Rock, ...] = ()
        self.level = 0.0
        self.level = float(self.ground(np.zeros(1), np.zeros(1))[0, 0])

    # ---- parts of the ground, each on the raster xs x ys

    @_kept_of_a_raster
    def outcrop_mask(self, xs: Array, ys: Array) -> Array:
        """Return where slabs lie open, 0..1."""
        x, y = self.outcrop_xy
        distance = np.hypot(xs[None, :] - x, (ys[:, None] - y) * 1.25)
        edge = self.outcrop_radius * (1 + 0.22 * self.warp.at(xs, ys))
        # bodies need no cliff in the ground where an outcrop ends
        rim = 0.16 if self.recipe.geology is None else 0.6
        return smooth_step((edge - distance) / (rim * self.outcrop_radius))

    @_kept_of_a_raster
    def ripple_mask(self, xs: Array, ys: Array) -> Array:
        """Return where sand lies in ripples, 0..1."""
        x, y = self.ripple_xy
        distance = np.hypot(xs[None, :] - x, ys[:, None] - y)
        edge = self.ripple_radius * (1 + 0.3 * self.warp.at(xs, ys))
        return smooth_step((edge - distance) / (0.5 * self.ripple_radius))

    @_kept_of_a_raster
    def _ripple(self, xs: Array, ys: Array) -> Array:
        """Return crests from -1 to 1, steeper on the lee side."""
        c, s = math.cos(self.ripple_angle), math.sin(self.ripple_angle)
        along = (
            c * xs[None, :] + s * ys[:, None] + 0.55 * self.warp.at(xs, ys) + 0.10 * self.detail.at(xs, ys)
        )
        phase = 2 * math.pi * along / 1.15
        return (np.sin(phase) + 0.33 * np.sin(2 * phase + 0.7)) / 1.2

    def _crater(self, xs: Array, ys: Array) -> Array:
        x, y = self.crater_xy
        radius = self.crater_radius * (1 + 0.06 * self.warp.at(xs, ys))
        r = np.hypot(xs[None, :] - x, ys[:, None] - y) / radius
        rim, depth = 0.055 * self.crater_radius, 0.17 * self.crater_radius
        bowl = -depth + (depth + rim) * smooth_step(r**1.5)
        shape: Array = np.where(r < 1, bowl, rim * np.exp(-((r - 1) ** 2) / 0.16))
        return shape

    @_kept_of_a_raster
    def ruts(self, xs: Array, ys: Array) -> Array:
        """Return how deep wheels have pressed the ground, 0..1: two ruts on a winding way to the origin."""
        c, s = math.cos(self.track_angle), math.sin(self.track_angle)
        u = c * xs[None, :] + s * ys[:, None]
        bend = 1.4 * (np.cos(u / 5.0) - 1.0)
        lean = -0.28 * np.sin(u / 5.0)
        aside = (c * ys[:, None] - s * xs[None, :] - bend) / np.sqrt(1 + lean**2)
        rut = smooth_step((RUT_M / 2 + 0.03 - np.abs(np.abs(aside) - GAUGE_M / 2)) / 0.05)
        cleats = 0.85 + 0.15 * np.sin(2 * math.pi * u / 0.09)
        went = smooth_step((0.4 - u) / 0.2)
        mask = rut * cleats * went
        if self.recipe.outcrop:
            mask = mask * (1 - self.outcrop_mask(xs, ys))
        return np.asarray(mask, dtype=float)

    def _layers(self, xs: Array, ys: Array) -> Array:
        """Return ledges: beds that step down across the dip, with ragged edges."""
        c, s = math.cos(self.outcrop_angle), math.sin(self.outcrop_angle)
        x, y = self.outcrop_xy
        across = c * (xs[None, :] - x) + s * (ys[:, None] - y)
        bare = self.recipe.geology is None
        # where bodies make the steps, the ground below them is a ramp
        ragged, ramp, high = (0.22, 0.16, 1.0) if bare else (0.05, 0.6, 0.8)
        across = across + 0.9 * self.warp.at(xs, ys) + ragged * self.detail.at(xs, ys)
        height = np.zeros_like(across)
        rng = stream("ledges", self.recipe.seed)
        for edge in np.linspace(-0.75, 0.75, 6) * self.outcrop_radius:
            step = high * (0.10 + 0.12 * float(rng.random()))
            height += step * (smooth_step((across - edge) / ramp) - 0.5)
        return height

    @_kept_of_a_raster
    def cracks(self, xs: Array, ys: Array) -> tuple[Array, Array]:
        """Return distance to the nearest crack between slabs, metres, and a number per slab, inside the
        outcrop.
        """
        from rover_iface.terrain.raster import cell_borders

        wobble = self.detail.at(xs, ys)
        x = xs[None, :] + 0.16 * self.warp.at(xs, ys) + 0.05 * wobble
        y = ys[:, None] + 0.16 * self.tone.at(xs, ys) - 0.05 * wobble
        where = self.outcrop_mask(xs, ys) > 0
        distance, label = cell_borders(x / SLAB_M, y / SLAB_M, where, self.recipe.seed)
        return distance * SLAB_M, label

    def ground(self, xs: Array, ys: Array) -> Array:
        """Return heights, m, without rocks on the raster [len(ys), len(xs)]."""
        recipe = self.recipe
        # The same roughness whatever the size: a fractal of this slope grows by size^0.8.
        h = recipe.relief_m * 0.5 * (recipe.size_m / 128.0) ** 0.8 * self.relief.at(xs, ys)
        rough = 0.012 + 0.010 * smooth_step(0.5 + 0.6 * self.cover.at(xs, ys))
        rough = rough * recipe.rough * (recipe.size_m / 128.0) ** 0.45
        h = h + rough * self.detail.at(xs, ys)
        if recipe.outcrop:
            mask = self.outcrop_mask(xs, ys)
            beds = self._layers(xs, ys) + 0.12
            if recipe.geology is None:  # else its plates are bodies
                crack, slab = self.cracks(xs, ys)
                groove = np.minimum(crack / 0.07, 1.0)
                beds = beds + 0.05 * (groove - 1) + 0.05 * (slab - 0.5)
            h = h + mask * beds
        if recipe.ripples:
            mask = self.ripple_mask(xs, ys)
            if recipe.outcrop:
                mask = mask * (1 - self.outcrop_mask(xs, ys))
            h = h + mask * 0.045 * self._ripple(xs, ys)
        if recipe.crater:
            h = h + self._crater(xs, ys)
        if recipe.tracks:
            h = h - RUT_DEPTH_M * self.ruts(xs, ys)
        if recipe.geology is not None and self.banked:
            h = h + bank_depth(xs, ys, self.banked, recipe.geology.surface.banks, self.wind_rad)
        return h - self.level

    # ---- rocks

    def rocks(self) -> tuple[Rock, ...]:
        """Return the rocks, largest first, with their feet on the ground."""
        recipe = self.recipe
        if recipe.rock_cover <= 0:
            return () if recipe.geology is None else self._weathered((), recipe.geology)
        rng = self.streams["rocks"]
        half, inner = recipe.size_m / 2, recipe.inner_m / 2 + 2
        inner = min(inner, half)
        near = draw_rocks(
            rng,
            west=-inner,
            south=-inner,
            east=inner,
            north=inner,
            total_cover=recipe.rock_cover,
            smallest_m=recipe.smallest_rock_m,
        )
        table = near
        if half > inner:
            far = draw_rocks(
                rng,
                west=-half,
                south=-half,
                east=half,
                north=half,
                total_cover=recipe.rock_cover,
                smallest_m=max(recipe.smallest_rock_m, recipe.spacing_m),
            )
            outside = np.maximum(np.abs(far[:, 0]), np.abs(far[:, 1])) > inner
            table = np.concatenate([near, far[outside]])
        keep = np.hypot(table[:, 0], table[:, 1]) > recipe.clear_start_m + table[:, 2] / 2
        keep &= np.maximum(np.abs(table[:, 0]), np.abs(table[:, 1])) < half - table[:, 2]
        if recipe.ripples:
            x, y = self.ripple_xy
            sandy = np.exp(-(np.hypot(table[:, 0] - x, table[:, 1] - y) ** 2) / (self.ripple_radius**2))
            keep &= rng.random(len(table)) > 0.9 * sandy
        if recipe.tracks:
            # Nobody drove over rocks that a wheel does not climb.
            keep &= ~self._in_ruts(table)
        if recipe.crater:
            x, y = self.crater_xy
            bowl = np.hypot(table[:, 0] - x, table[:, 1] - y) < 0.7 * self.crater_radius
            keep &= ~(bowl & (rng.random(len(table)) < 0.6))
        table = table[keep]
        order = np.argsort(-table[:, 2], kind="stable")
        table = _apart(table[order])
        numbers = rng.random((len(table), 5))
        seeds = rng.integers(0, 2**31 - 1, len(table))
        foot = self.foot_heights(table[:, 0], table[:, 1])
        boulders = tuple(
            Rock(
                id=f"R{k + 1:05d}",
                x=round(float(x), 4),
                y=round(float(y), 4),
                z=round(float(z), 4),
                diameter=round(float(d), 4),
                height=round(float(d * (0.32 + 0.42 * n[0])), 4),
                yaw=round(float(n[1] * 2 * math.pi), 4),
                elongation=round(float(0.6 + 0.4 * n[2]), 4),
                burial=round(float(0.15 + 0.4 * n[3]), 4),
                seed=int(s),
            )
            for k, ((x, y, d), z, n, s) in enumerate(zip(table, foot, numbers, seeds, strict=True))
        )
        return boulders if recipe.geology is None else self._weathered(boulders, recipe.geology)

    def _weathered(self, boulders: tuple[Rock, ...], geology: Geology) -> tuple[Rock, ...]:
        """Return the rocks of a geology and its plates; from now on the ground has its banked sand."""
        recipe = self.recipe
        rocks = dressed(boulders, geology, seed=recipe.seed, wind_rad=self.wind_rad)
        plates = pavement(
            geology,
            recipe.inner_m / 2,
            seed=recipe.seed,
            open_at=self._bare,
            ground_at=self._raster(recipe.inner_m, recipe.inner_spacing_m).sample,
            clear_m=recipe.clear_start_m,
        )
        self.banked = rocks
        return (*rocks, *plates)

    def _bare(self, x: Array, y: Array) -> Array:
        """Return where bedrock lies open [n], above a half, at places x, y [n], m: the outcrop, and patches
        that together are the geology's share of the middle.
        """
        recipe = self.recipe
        if recipe.geology is None:
            return np.zeros(len(x))
        axis = np.linspace(-recipe.inner_m / 2, recipe.inner_m / 2, 257)
        patches = Field(spectral_noise(stream("bedrock", recipe.seed), 256, 2.4), recipe.inner_m)
        shown = patches.at(axis, axis)
        # a share of it lies above this quantile, by definition
        open_ = (shown > np.quantile(shown, 1.0 - recipe.geology.pavement)).astype(np.float32)
        if recipe.ripples:
            open_ *= self.ripple_mask(axis, axis) < 0.3
        if recipe.outcrop:
            open_ = np.maximum(open_, self.outcrop_mask(axis, axis) > 0.35)
        step = float(axis[1] - axis[0])
        return HeightLayer(open_.astype(np.float32), float(axis[0]), float(axis[0]), step).sample(x, y)

    def _in_ruts(self, table: Array) -> NDArray[np.bool_]:
        """Return which rocks (x, y, diameter) [n, 3] lie on the way of the earlier drive."""
        c, s = math.cos(self.track_angle), math.sin(self.track_angle)
        u = c * table[:, 0] + s * table[:, 1]
        aside = c * table[:, 1] - s * table[:, 0] - 1.4 * (np.cos(u / 5.0) - 1.0)
        blocked: NDArray[np.bool_] = (u < 1.0) & (np.abs(aside) < GAUGE_M / 2 + 0.15 + table[:, 2] / 2)
        return blocked & (table[:, 2] > 0.1)

    def foot_heights(self, x: Array, y: Array) -> Array:
        """Return ground heights [n], m, at scattered points x, y [n], from a raster of the whole site."""
        return self._raster(self.recipe.size_m, 0.125).sample(x, y)

    def _raster(self, size: float, spacing: float) -> HeightLayer:
        """Return ground heights of a square round the origin, of at most 2048 posts a side."""
        count = int(min(2048, size / spacing))
        axis = (np.arange(count) + 0.5) * size / count - size / 2
        return HeightLayer(
            self.ground(axis, axis).astype(np.float32), float(axis[0]), float(axis[0]), size / count
        )


def _polar(angle: float, radius: float) -> tuple[float, float]:
    return radius * math.cos(angle), radius * math.sin(angle)


def _apart(table: Array) -> Array:
    """Return rocks (largest first) without those whose middle lies under a larger one; grid of 2 m cells."""
    kept: list[int] = []
    cells: dict[tuple[int, int], list[int]] = {}
    for k, (x, y, d) in enumerate(table.tolist()):
        i, j = math.floor(x / 2), math.floor(y / 2)
        clash = False
        for a in (i - 1, i, i + 1):
            for b in (j - 1, j, j + 1):
                for other in cells.get((a, b), ()):
                    ox, oy, od = table[other]
                    if (x - ox) ** 2 + (y - oy) ** 2 < (0.42 * (d + od)) ** 2:
                        clash = True
        if not clash:
            kept.append(k)
            cells.setdefault((i, j), []).append(k)
    return table[kept]
