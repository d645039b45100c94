"""Height grids and ortho images: regular rasters in the site frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rover_iface.errors import TerrainFormatError
from rover_iface.terrain.outside import opened_image

Floats = NDArray[np.floating]
Array = NDArray[np.floating]
Bounds = tuple[float, float, float, float]
"""West, south, east, north in site metres."""


@dataclass(frozen=True, slots=True)
class HeightGrid:
    """Plain heights for other rooms: `heights_m[row, column]`, row 0 in the south, column 0 in the west.

    The post [r, c] stands at (`west_m` + c `spacing_m`, `south_m` + r `spacing_m`); NaN where nothing is
    known.
    """

    heights_m: Array
    west_m: float
    south_m: float
    spacing_m: float


@dataclass(frozen=True)
class HeightLayer:
    """One raster of heights.

    Parameters
    ----------
    heights
        [rows, columns] metres, row 0 in the south, column 0 in the west, NaN = unknown. Rocks included.
    west, south
        Place of the first post, site metres.
    spacing
        Distance between posts, metres.
    ground
        The same without rocks, where that is known.
    mask
        [rows, columns] true where the ground was seen by the rover's own cameras; None = everywhere.
    sigma
        [rows, columns] metres, standard deviation of the heights; None = not told.
    """

    heights: NDArray[np.float32]
    west: float
    south: float
    spacing: float
    ground: NDArray[np.float32] | None = None
    mask: NDArray[np.bool_] | None = None
    name: str = ""
    sigma: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        if self.heights.ndim != 2 or min(self.heights.shape) < 2:
            raise TerrainFormatError(
                f"height grid {self.name!r} has shape {self.heights.shape}; at least 2 x 2 is needed"
            )
        if not (self.spacing > 0 and math.isfinite(self.spacing)):
            raise TerrainFormatError(
                f"height grid {self.name!r} has a spacing of {self.spacing} m; it must be positive"
            )

    @property
    def bounds(self) -> Bounds:
        """Return the area of the cells: half a spacing beyond the outer posts."""
        rows, columns = self.heights.shape
        half = self.spacing / 2
        return (
            self.west - half,
            self.south - half,
            self.west + (columns - 0.5) * self.spacing,
            self.south + (rows - 0.5) * self.spacing,
        )

    def covers(self, x: Array, y: Array) -> NDArray[np.bool_]:
        """Return where points lie inside the raster and heights are known; shape of x.

        `x` and `y` [...] are site coordinates, m.
        """
        west, south, east, north = self.bounds
        within = (x >= west) & (x <= east) & (y >= south) & (y <= north)
        if self._has_holes:
            within &= np.isfinite(self.sample(x, y))
        covered: NDArray[np.bool_] = within
        return covered

    @cached_property
    def _has_holes(self) -> bool:
        return not bool(np.isfinite(self.heights).all())

    def sample(self, x: Array, y: Array, *, ground: bool = False) -> Array:
        """Return bilinear heights at points; the outer half cell continues its post; no test for inside.

        `x`, `y` and the heights [...] are in m, site frame.
        """
        # Only who asks for heights pays for the compiler: 0.2 s and 60 MB of a process.
        from rover_iface.terrain.height_kernels import bilinear

        data = self.ground if ground and self.ground is not None else self.heights
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        flat = bilinear(data, self.west, self.south, self.spacing, x.ravel(), y.ravel())
        value: Array = flat.reshape(x.shape)
        return value

    def nearest_post(self, x: Array, y: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return row and column [...] of the posts nearest to `x`, `y` [...], site frame, m."""
        rows, columns = self.heights.shape
        r = np.clip(np.rint((y - self.south) / self.spacing), 0, rows - 1).astype(np.int64)
        c = np.clip(np.rint((x - self.west) / self.spacing), 0, columns - 1).astype(np.int64)
        return r, c

    def fill(self, value: Array, x: Array, y: Array, *, ground: bool = False) -> int:
        """Put heights into `value` [n], m, where it is NaN and the raster knows them at `x`, `y` [n], site
        frame, m; return for how many points there is still none.
        """
        from rover_iface.terrain.height_kernels import fill

        data = self.ground if ground and self.ground is not None else self.heights
        return fill(data, self.heights, self.west, self.south, self.spacing, x, y, value)


@dataclass(frozen=True)
class Ortho:
    """An ortho image, north up: `bounds` are the outer edges of its pixels. Pixels are read at first use."""

    bounds: Bounds
    path: Path | None = None
    pixels: NDArray[np.uint8] | None = field(default=None, repr=False)

    @cached_property
    def rgb(self) -> NDArray[np.uint8]:
        """Return pixels [rows, columns, 3], row 0 in the north."""
        if self.pixels is not None:
            return np.ascontiguousarray(self.pixels)
        if self.path is None:
            raise TerrainFormatError("ortho image has neither pixels nor a file")
        with opened_image(self.path, "ortho image") as image:
            return np.asarray(image.convert("RGB"))

    @property
    def spacing(self) -> float:
        """Return the size of a pixel, metres."""
        return (self.bounds[2] - self.bounds[0]) / self.rgb.shape[1]

    def colour(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.uint8]:
        """Return the colour [..., 3] of the pixels that hold the points `x`, `y` [...], site metres, nearest
        inside the image.
        """
        rows, columns = self._pixels_of(x, y)
        found: NDArray[np.uint8] = self.rgb[rows, columns]
        return found

    def crop(self, x: float, y: float, size_m: float, pixels: int = 128) -> NDArray[np.uint8]:
        """Return a square [pixels, pixels, 3] of `size_m` metres round a point, north up."""
        step = (np.arange(pixels) + 0.5) / pixels * size_m - size_m / 2
        rows, columns = self._pixels_of(x + step, y - step)
        flat = rows[:, None] * self.rgb.shape[1] + columns  # a fifth of the time of an index for each axis
        found: NDArray[np.uint8] = self.rgb.reshape(-1, 3).take(flat, axis=0)
        return found

    def _pixels_of(self, x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the rows that hold `y` and the columns that hold `x`, each of its own shape."""
        west, south, east, north = self.bounds
        rows, columns = self.rgb.shape[:2]
        c = ((np.asarray(x, dtype=float) - west) / (east - west) * columns).astype(np.int64)
        r = ((north - np.asarray(y, dtype=float)) / (north - south) * rows).astype(np.int64)
        return np.clip(r, 0, rows - 1), np.clip(c, 0, columns - 1)
