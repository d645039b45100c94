"""A map to find the rover on: heights and brightness of the ground on one raster, however it was made.

It is cut from a stored terrain (`relief_map`), an orbital DEM with its ortho image or a finer one, or made of
what the rover saw from earlier stops (`relief_map_of_views`). Its posts stand `spacing_m` apart whatever the
source has; what the source does not resolve is smooth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.errors import LocalizationError
from rover_iface.localization.stop_relief import StopView, stop_cells
from rover_iface.terrain.terrain import Terrain

Array = npt.NDArray[np.float64]
F32 = npt.NDArray[np.float32]
SPACING_M = 0.25
"""Posts of the map: a pixel of the best orbital images (HiRISE), and what navcam stereo fills to 20 m."""


@dataclass(frozen=True, eq=False, slots=True)
class ReliefMap:
    """Heights and brightness on square posts, site frame (east-north-up).

    Attributes
    ----------
    heights_m
        (rows, columns), m, row 0 in the south, NaN where unknown.
    brightness
        Of the same posts, any positive unit, NaN where unknown; None where there is no image.
    west_m, south_m, spacing_m
        Place of the first post and distance between posts, m.
    """

    heights_m: F32
    west_m: float
    south_m: float
    spacing_m: float = SPACING_M
    brightness: F32 | None = None

    def __post_init__(self) -> None:
        if self.heights_m.ndim != 2 or min(self.heights_m.shape) < 8:
            raise LocalizationError(f"a map has heights {self.heights_m.shape}; at least 8 x 8 are needed")
        if not (self.spacing_m > 0 and math.isfinite(self.spacing_m)):
            raise LocalizationError(f"posts of a map are {self.spacing_m} m apart; it must be positive")
        if self.brightness is not None and self.brightness.shape != self.heights_m.shape:
            raise LocalizationError(
                f"a map has heights {self.heights_m.shape} and brightness {self.brightness.shape}; "
                "both must be of the same posts"
            )
        if not np.isfinite(self.heights_m).any():
            raise LocalizationError("a map has no known height")

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Return west, south, east, north of its posts, m."""
        rows, columns = self.heights_m.shape
        return (
            self.west_m,
            self.south_m,
            self.west_m + (columns - 1) * self.spacing_m,
            self.south_m + (rows - 1) * self.spacing_m,
        )

    def coarser(self, factor: int) -> ReliefMap:
        """Return the map on blocks of `factor` x `factor` posts, each the mean of what is known in it."""
        middle = 0.5 * (factor - 1) * self.spacing_m
        return ReliefMap(
            _block_mean(self.heights_m, factor),
            self.west_m + middle,
            self.south_m + middle,
            factor * self.spacing_m,
            None if self.brightness is None else _block_mean(self.brightness, factor),
        )


def _block_mean(values: F32, factor: int) -> F32:
    rows, columns = (n // factor for n in values.shape)
    cut = values[: rows * factor, : columns * factor].reshape(rows, factor, columns, factor)
    known = np.isfinite(cut)
    count = known.sum(axis=(1, 3))
    total = np.where(known, cut, 0.0).sum(axis=(1, 3))
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).astype(np.float32)


def relief_map(
    terrain: Terrain, centre: tuple[float, float], half_m: float, *, spacing_m: float = SPACING_M
) -> ReliefMap:
    """Return the map of a square of 2 `half_m` round `centre`, site frame, m, cut from a terrain.

    A post is the mean over its square where the terrain is finer. Brightness is that of the finest ortho
    image over each post.

    Raises
    ------
    LocalizationError
        If the terrain has no height there.
    """
    count = 2 * math.ceil(half_m / spacing_m) + 1
    finer = min(4, max(1, round(spacing_m / terrain.spacing)))  # 16 samples tell a mean of what is smooth
    step = spacing_m / finer
    first = -0.5 * (count - 1) * spacing_m - 0.5 * (finer - 1) * step
    along = first + step * np.arange(count * finer)
    xs, ys = centre[0] + along, centre[1] + along
    x, y = np.meshgrid(xs, ys)
    heights = _block_mean(terrain.height(x, y).astype(np.float32), finer)
    if not np.isfinite(heights).any():
        raise LocalizationError(
            f'the terrain "{terrain.name}" has no height within {half_m:g} m of '
            f"({centre[0]:.1f}, {centre[1]:.1f})"
        )
    half = 0.5 * (count - 1) * spacing_m
    return ReliefMap(
        heights, centre[0] - half, centre[1] - half, spacing_m, _brightness(terrain, xs, ys, finer)
    )


def _brightness(
    terrain: Terrain, xs: npt.NDArray[np.floating], ys: npt.NDArray[np.floating], finer: int
) -> F32 | None:
    """Return the brightness on posts of `finer` x `finer` samples, NaN where no ortho image shows them."""
    if not terrain.orthos:
        return None
    found = np.full((len(ys), len(xs)), np.nan, np.float32)
    for ortho in reversed(terrain.orthos):  # the finest last: it stays
        west, south, east, north = ortho.bounds
        columns = np.flatnonzero((xs >= west) & (xs <= east))
        rows = np.flatnonzero((ys >= south) & (ys <= north))
        if len(columns) and len(rows):
            x, y = np.meshgrid(xs[columns], ys[rows])
            found[np.ix_(rows, columns)] = ortho.colour(x, y).mean(axis=-1, dtype=np.float32)
    return _block_mean(found, finer) if np.isfinite(found).any() else None


def relief_map_of_views(
    views: Sequence[StopView], *, farthest_m: float = 25.0, spacing_m: float = SPACING_M
) -> ReliefMap:
    """Return the map that earlier stops of the rover make, all in one frame; a post is the mean of its cell.

    Gaps with three known neighbours are closed, twice; ground that no stop saw stays unknown. Brightness of
    each stop counts against its own mean, as exposures differ.

    Raises
    ------
    LocalizationError
        If there is no stop, or none saw ground within `farthest_m` of it.
    """
    if not views:
        raise LocalizationError("a map of earlier stops needs at least one stop")
    eyes = np.array([view.seen.eye for view in views])
    low = np.floor((eyes[:, :2].min(axis=0) - farthest_m) / spacing_m).astype(np.int64)
    high = np.ceil((eyes[:, :2].max(axis=0) + farthest_m) / spacing_m).astype(np.int64)
    columns, rows = high - low + 1
    total, weight = np.zeros((rows, columns)), np.zeros((rows, columns))
    light, lit = np.zeros((rows, columns)), np.zeros((rows, columns))
    for view in views:
        cells = stop_cells(view, spacing_m, farthest_m=farthest_m)
        site = cells.places + view.seen.eye
        at = np.rint(site[:, :2] / spacing_m).astype(np.int64) - low
        inside = ((at >= 0) & (at < (columns, rows))).all(axis=1)
        where = at[inside, 1], at[inside, 0]
        near = 1.0 / (cells.sigma_m[inside] ** 2 + 0.01**2)  # a cell close by is known to 1 cm at best
        np.add.at(total, where, near * site[inside, 2])
        np.add.at(weight, where, near)
        if cells.brightness is not None:
            bright = cells.brightness[inside]
            known = np.isfinite(bright)
            at_known = where[0][known], where[1][known]
            np.add.at(light, at_known, near[known] * bright[known] / bright[known].mean())
            np.add.at(lit, at_known, near[known])
    heights = np.where(weight > 0, total / np.maximum(weight, 1e-12), np.nan)
    shine = np.where(lit > 0, light / np.maximum(lit, 1e-12), np.nan)
    west, south = (float(v) for v in low * spacing_m)
    brightness = _closed(shine) if np.isfinite(shine).any() else None
    return ReliefMap(_closed(heights), west, south, spacing_m, brightness)


def _closed(values: Array) -> F32:
    """Return a raster with gaps closed that have three known neighbours of eight, twice."""
    from scipy.ndimage import convolve

    out = values.copy()
    for _ in range(2):
        known = np.isfinite(out)
        count = convolve(known.astype(float), np.ones((3, 3)), mode="constant")
        total = convolve(np.where(known, out, 0.0), np.ones((3, 3)), mode="constant")
        out = np.where(known, out, np.where(count >= 3, total / np.maximum(count, 1.0), np.nan))
    return out.astype(np.float32)
