"""What a stop saw, as cells of ground: height and brightness, in the axes in which the rover believed to be.

The points are those of `ground_points`; brightness comes from the left images. A cell is the mean of the
points in it and stands where they stand in the mean.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.panorama import Panorama
from rover_iface.errors import LocalizationError
from rover_iface.localization.ground_points import GroundPoints, points_of_panorama

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False, slots=True)
class StopView:
    """Points seen from one place, and how bright the ground is there.

    Attributes
    ----------
    seen
        The points, in the frame in which the rover believed to be, level.
    brightness
        (n,), of each point, any positive unit, NaN where no image shows it; None without images.
    """

    seen: GroundPoints
    brightness: Array | None = None

    def __post_init__(self) -> None:
        if self.brightness is None:
            return
        given = np.asarray(self.brightness, dtype=float)
        if given.shape != (len(self.seen.points),):
            raise LocalizationError(
                f"{len(self.seen.points)} points were seen with brightness {given.shape}; one each is needed"
            )
        object.__setattr__(self, "brightness", given)


def view_of_panorama(panorama: Panorama) -> StopView:
    """Return the dense stereo points of a panorama with the brightness of its left images.

    Wedges are exposed each for itself; what they differ by is taken out with all that varies over metres.
    """
    import cv2

    seen = points_of_panorama(panorama)
    brightness = np.full(len(seen.points), np.nan)
    for wedge in panorama.wedges:
        camera = wedge.left_camera
        ahead = (seen.points - camera.C) @ camera.A > 0.0
        pixels = np.full((len(seen.points), 2), np.nan)
        pixels[ahead] = camera.project(seen.points[ahead])
        inside = (
            (pixels[:, 0] >= 0)
            & (pixels[:, 1] >= 0)
            & (pixels[:, 0] <= camera.width - 1)
            & (pixels[:, 1] <= camera.height - 1)
        )
        take = inside & np.isnan(brightness)
        # the points stand 3 pixels apart: each is the mean of its own
        image = cv2.blur(wedge.left.astype(np.float32) + 1.0, (3, 3))
        at = np.rint(pixels[take]).astype(np.int64)
        brightness[take] = image[at[:, 1], at[:, 0]]
    return StopView(seen, brightness)


@dataclass(frozen=True, eq=False, slots=True)
class StopCells:
    """Cells of ground seen from a stop, counted from its eye, in the believed axes.

    Attributes
    ----------
    places
        (n, 3), m.
    sigma_m
        (n,), deviation of the height, m: what the error of range makes of it at this slant.
    stretch
        (n, 3), m / px: where the cell goes per pixel of disparity that all ranges are short of.
    brightness
        (n,), NaN where not known; None without images.
    cell_m
        Side of a cell.
    """

    places: Array
    sigma_m: Array
    stretch: Array
    brightness: Array | None
    cell_m: float

    @property
    def second_half(self) -> npt.NDArray[np.bool_]:
        """Return which cells (n,) are of the second half: every other sector of 22.5 degrees.

        Eight sectors each look every way, so that either half knows all of a pose.
        """
        azimuth = np.arctan2(self.places[:, 1], self.places[:, 0])
        return np.asarray(np.floor(azimuth / (math.pi / 8.0)).astype(np.int64) % 2 == 1)

    def raster(self) -> tuple[Indices, Indices, tuple[int, int]]:
        """Return row and column of each cell (n,), and the shape of the raster that holds them."""
        index = np.floor(self.places[:, :2] / self.cell_m).astype(np.int64)
        index -= index.min(axis=0)
        rows, columns = index.max(axis=0) + 1
        return index[:, 1], index[:, 0], (int(columns), int(rows))


def stop_cells(
    view: StopView, cell_m: float, *, farthest_m: float, nearest_m: float = 2.0, sigma_px: float = 0.38
) -> StopCells:
    """Return the cells of `cell_m` in which at least 2 points lie, none of them beyond `farthest_m`.

    `sigma_px` is the error of disparity of ground seen at a slant, as measured on rendered pairs.

    Raises
    ------
    LocalizationError
        If no cell is left.
    """
    rays = view.seen.points - view.seen.eye
    level = np.hypot(rays[:, 0], rays[:, 1])
    good = (level > nearest_m) & (level < farthest_m)
    rays, level = rays[good], level[good]
    if not len(rays):
        raise LocalizationError(f"no point lies between {nearest_m:g} and {farthest_m:g} m of the stop's eye")
    side = math.ceil(farthest_m / cell_m)
    across = 2 * side + 1
    column = np.floor(rays[:, 0] / cell_m).astype(np.int64) + side
    row = np.floor(rays[:, 1] / cell_m).astype(np.int64) + side
    each = row * across + column
    held = np.bincount(each, minlength=across * across)
    at = np.flatnonzero(held)
    cell, count, total = (np.cumsum(held > 0) - 1)[each], held[at], len(at)

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(cell, weights=values, minlength=total) / count)

    places = np.column_stack([mean(rays[:, axis]) for axis in range(3)])
    away = np.linalg.norm(places, axis=1)
    # a range that errs slides the point along its ray: of the error, the ray's slant shows as height
    per_px = away / view.seen.range_factor
    stretch = places * per_px[:, None]
    sigma = np.abs(stretch[:, 2]) * sigma_px
    shine = None
    if view.brightness is not None:
        bright = view.brightness[good]
        known = np.isfinite(bright)
        seen = np.bincount(cell[known], minlength=total)
        shine = np.bincount(cell[known], weights=bright[known], minlength=total) / np.maximum(seen, 1)
        shine = np.where(seen > 0, shine, np.nan)
    keep = count >= 2
    if not keep.any():
        raise LocalizationError(f"no cell of {cell_m:g} m within {farthest_m:g} m holds 2 points")
    return StopCells(
        places[keep],
        sigma[keep],
        stretch[keep],
        None if shine is None else np.asarray(shine[keep]),
        cell_m,
    )
