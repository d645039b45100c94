"""Surfaces of pairs as one raster of heights with its uncertainty, and the ortho image of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.errors import PicturesError
from rover_iface.reconstruction.outcomes import Reason, Refusal
from rover_iface.reconstruction.pair_surface import PairSurface

MOST_POSTS = 25_000_000
"""250 m x 250 m at 5 cm."""

SLOPE_POSTS = 2.0
"""Deviation, posts, of the smoothing before slopes are taken: the slope of single posts is their noise."""

LEAST_SHARED = 200
"""Fewest posts of two pairs from which it is told that they contradict each other."""

MOST_APART = 3.0
"""By how many standard deviations the heights of two pairs may differ in the median."""


@dataclass(frozen=True, slots=True)
class Grid:
    """A raster of posts in the site frame; the first stands at (west, south), m."""

    west: float
    south: float
    spacing: float
    rows: int
    columns: int

    def places(self, rows: npt.NDArray[np.int64], columns: npt.NDArray[np.int64], heights: Array) -> Array:
        """Return points (n, 3) of posts (n,) with heights (n,)."""
        return np.column_stack(
            (self.west + columns * self.spacing, self.south + rows * self.spacing, heights)
        )


@dataclass(frozen=True, slots=True, eq=False)
class FusedHeights:
    """Heights and their standard deviation, m, [rows, columns], row 0 south; NaN where no pair saw the
    ground.
    """

    grid: Grid
    heights: Array
    sigma: Array
    used: tuple[PairSurface, ...]


def grid_over(surfaces: Sequence[PairSurface], spacing_m: float) -> Grid:
    """Return the smallest grid on whole multiples of the spacing that holds all surfaces.

    Raises
    ------
    PicturesError
        If it would hold too many posts.
    """
    low = np.min([np.nanmin(s.points[..., :2], axis=(0, 1)) for s in surfaces], axis=0)
    high = np.max([np.nanmax(s.points[..., :2], axis=(0, 1)) for s in surfaces], axis=0)
    first, last = np.floor(low / spacing_m), np.ceil(high / spacing_m)
    columns, rows = (max(2, int(n) + 1) for n in last - first)
    if columns * rows > MOST_POSTS:
        raise PicturesError(
            f"the ground that the pairs see has {columns} x {rows} posts of {spacing_m:g} m; at most "
            f"{MOST_POSTS} are made: give a wider spacing or a shorter reach"
        )
    return Grid(float(first[0] * spacing_m), float(first[1] * spacing_m), spacing_m, rows, columns)


def draped(surface: PairSurface, grid: Grid) -> Array:
    """Return the heights [rows, columns], m, of a pair on a grid; NaN where it saw nothing."""
    from rover_iface.reconstruction.surface_kernels import drape_pixels

    heights = np.full((grid.rows, grid.columns), np.nan)
    counts = np.zeros(heights.shape)
    ray = surface.points - surface.eye.C
    error = math.hypot(surface.disparity_px, surface.row_px)
    slack = 3.0 * error * np.abs(ray[..., 2]) / surface.disparities + grid.spacing
    drape_pixels(
        surface.points,
        surface.disparities,
        slack,
        surface.options.jump_px,
        surface.options.neighbour_px,
        1.0 / (surface.eye.hs * surface.options.least_grazing_rad),
        grid.west,
        grid.south,
        grid.spacing,
        heights,
        counts,
    )
    return heights


def fuse(
    surfaces: Sequence[PairSurface], grid: Grid, most_sigma_m: float, refused: list[Refusal]
) -> FusedHeights:
    """Return the weighted mean of what pairs saw; a pair that contradicts those before it is added to
    `refused`.

    Posts whose height is known worse than `most_sigma_m` are left unknown.
    """
    total, weights, squares, count = (np.zeros((grid.rows, grid.columns)) for _ in range(4))
    used = []
    for surface in surfaces:
        heights = draped(surface, grid)
        rows, columns = np.nonzero(np.isfinite(heights))
        slopes = slopes_of(heights, grid.spacing)[rows, columns]
        variance = surface.height_variance(grid.places(rows, columns, heights[rows, columns]), slopes)
        good = variance <= most_sigma_m**2
        rows, columns, variance = rows[good], columns[good], variance[good]
        found = heights[rows, columns]
        if (
            against := _contradiction(found, variance, total[rows, columns], weights[rows, columns])
        ) is not None:
            refused.append(Refusal(Reason.SURFACES_APART, surface.pair.name, against))
            continue
        weight = 1.0 / variance
        total[rows, columns] += weight * found
        weights[rows, columns] += weight
        squares[rows, columns] += weight * found**2
        count[rows, columns] += 1.0
        used.append(surface)
    known = weights > 0
    heights, sigma = np.full(total.shape, np.nan), np.full(total.shape, np.nan)
    heights[known] = total[known] / weights[known]
    # pairs of one rig err alike in rows and calibration: a second one does not make the first better.
    # Pairs that differ by more than they tell are known no better than they agree
    between = np.maximum(squares[known] / weights[known] - heights[known] ** 2, 0.0)
    sigma[known] = np.sqrt(np.maximum(count[known] / weights[known], between))
    return FusedHeights(grid, heights, sigma, tuple(used))


def _contradiction(found: Array, variance: Array, total: Array, weights: Array) -> str | None:
    """Return how heights (n,) with variances (n,) contradict the weighted sums (n,) so far; None if not."""
    shared = weights > 0
    if shared.sum() < LEAST_SHARED:
        return None
    off = np.abs(found[shared] - total[shared] / weights[shared])
    times = float(np.median(off / np.sqrt(variance[shared] + 1.0 / weights[shared])))
    if times <= MOST_APART:
        return None
    return (
        f"over {int(shared.sum())} posts it lies {float(np.median(off)):.2f} m (median) from what the pairs "
        f"before it saw, {times:.1f} standard deviations; the limit is {MOST_APART:g}"
    )


def slopes_of(heights: Array, spacing: float) -> Array:
    """Return slopes [rows, columns, 2], east and north, of heights [rows, columns], m, over what is known."""
    from scipy import ndimage

    known = np.isfinite(heights)
    share = ndimage.gaussian_filter(known.astype(np.float64), SLOPE_POSTS)
    smooth = ndimage.gaussian_filter(np.where(known, heights, 0.0), SLOPE_POSTS)
    with np.errstate(invalid="ignore", divide="ignore"):
        smooth = np.where(known, smooth / share, np.nan)
    slopes = np.zeros((*heights.shape, 2))
    for axis, k in ((1, 0), (0, 1)):
        ahead = np.diff(smooth, axis=axis, append=np.nan) / spacing
        behind = np.diff(smooth, axis=axis, prepend=np.nan) / spacing
        both = np.isfinite(ahead) & np.isfinite(behind)
        slopes[..., k] = np.where(both, (ahead + behind) / 2, np.where(np.isfinite(ahead), ahead, behind))
    return np.nan_to_num(slopes)


def ortho_of(
    surfaces: Sequence[PairSurface], grid: Grid, shown: npt.NDArray[np.bool_]
) -> npt.NDArray[np.uint8]:
    """Return the ortho image [2 rows, 2 columns, 3], row 0 north, half a post a pixel; black where not
    `shown`.

    Each pixel is of the pair that saw its ground from nearest. `shown` [rows, columns] tells the known posts.
    """
    import cv2

    half = grid.spacing / 2
    fine = Grid(grid.west - half / 2, grid.south - half / 2, half, 2 * grid.rows, 2 * grid.columns)
    image = np.zeros((fine.rows, fine.columns, 3), np.uint8)
    nearest = np.full((fine.rows, fine.columns), np.inf)
    allowed = np.repeat(np.repeat(shown, 2, axis=0), 2, axis=1)
    for surface in surfaces:
        heights = draped(surface, fine)
        rows, columns = np.nonzero(np.isfinite(heights) & allowed)
        places = fine.places(rows, columns, heights[rows, columns])
        away = np.linalg.norm(places - surface.eye.C, axis=1)
        better = away < nearest[rows, columns]
        rows, columns, places = rows[better], columns[better], places[better]
        pixels = surface.pair.left_camera.project(places).astype(np.float32)
        picture = surface.pair.colour
        if picture is None:
            picture = np.repeat(np.round(255.0 * surface.pair.left).astype(np.uint8)[..., None], 3, axis=2)
        # remap takes no column longer than 32767: the points are folded to lines
        lines = -(-len(pixels) // 1024)
        padded = np.full((lines * 1024, 2), -1.0, np.float32)
        padded[: len(pixels)] = np.nan_to_num(pixels, nan=-1.0)
        mapped = padded.reshape(lines, 1024, 2)
        seen = cv2.remap(np.ascontiguousarray(picture), mapped[..., 0], mapped[..., 1], cv2.INTER_LINEAR)
        image[rows, columns] = seen.reshape(-1, 3)[: len(pixels)]
        nearest[rows, columns] = away[better]
    return np.ascontiguousarray(image[::-1])
