"""Rasters of a site as Cloud Optimized GeoTIFF, in the reference of the site's place."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from neighbours.geodata.errors import GeodataError

MAX_PIXELS = 400_000_000
"""Of one raster: 1.6 GB of heights, held in memory twice while it is written."""


@dataclass(frozen=True, slots=True)
class GridPlace:
    """Where site metres lie in a projection: x and y of the origin, and the turn from grid to site axes."""

    wkt: str
    x: float
    y: float
    rotation_rad: float = 0.0

    def transform(self, west: float, north: float, spacing: float) -> tuple[float, ...]:
        """Return (a, b, c, d, e, f) with x = a column + b row + c, y = d column + e row + f.

        `west` and `north` are the outer corner of the first pixel, site metres; rows go south.
        """
        c, s = math.cos(self.rotation_rad), math.sin(self.rotation_rad)
        return (
            c * spacing,
            s * spacing,
            self.x + c * west - s * north,
            s * spacing,
            -c * spacing,
            self.y + s * west + c * north,
        )


SITE = GridPlace(
    'LOCAL_CS["site, metres east and north",UNIT["metre",1],AXIS["East",EAST],AXIS["North",NORTH]]', 0.0, 0.0
)
"""For a site that has no place on a body."""


def write_cog(
    path: Path,
    pixels: NDArray[Any],
    place: GridPlace,
    west: float,
    north: float,
    spacing: float,
    *,
    tags: Mapping[str, str] | None = None,
) -> None:
    """Write a raster [bands, rows, columns], row 0 in the north, as a Cloud Optimized GeoTIFF.

    Floating point has NaN where nothing is known; it is compressed without loss, and so are bytes.

    Raises
    ------
    GeodataError
        If the raster is empty or too large, or GDAL does not take the reference.
    """
    import rasterio
    from rasterio.crs import CRS
    from rasterio.errors import RasterioError

    bands, rows, columns = pixels.shape
    if not 0 < rows * columns * bands <= MAX_PIXELS:
        raise GeodataError(
            f"a raster of {bands} x {rows} x {columns} is asked; at most {MAX_PIXELS} pixels go"
        )
    floats = np.issubdtype(pixels.dtype, np.floating)
    options = {
        "compress": "deflate",
        "predictor": "YES",
        "blocksize": 256,
        "overview_resampling": "average",
        "bigtiff": "IF_SAFER",
        "num_threads": "1",
    }
    try:
        with rasterio.open(
            path,
            "w",
            driver="COG",
            width=columns,
            height=rows,
            count=bands,
            dtype=pixels.dtype,
            crs=CRS.from_wkt(place.wkt),
            transform=rasterio.Affine(*place.transform(west, north, spacing)),
            nodata=math.nan if floats else None,
            **options,
        ) as file:
            file.write(pixels)
            file.update_tags(**(tags or {}))
            if floats:
                file.units = ("metre",) * bands
    except RasterioError as err:
        raise GeodataError(f"{path.name} cannot be written as a COG: {err}") from err
