"""Ortho images and masks on the posts of a DEM that was reprojected, or in a reference of their own."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rover_iface.errors import TerrainFormatError
from rover_iface.terrain.dem import Dem, RawDem, between, same_reference, warp
from rover_iface.terrain.outside import opened_image, require_size

if TYPE_CHECKING:
    from affine import Affine
    from rasterio.crs import CRS


@dataclass(frozen=True, slots=True)
class Georeference:
    """Where an image's pixels lie."""

    transform: Affine
    crs: CRS


def own_georeference(image: Path) -> Georeference | None:
    """Return where a GeoTIFF says that it lies; None for any other image, and where it does not say it."""
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning, RasterioError

    if image.suffix.lower() not in {".tif", ".tiff"}:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        try:
            with rasterio.open(image, driver="GTiff") as dataset:
                transform, crs = dataset.transform, dataset.crs
        except RasterioError:
            return None
    return None if crs is None or transform.is_identity else Georeference(transform, crs)


def extent_of(raw: RawDem, columns: int, rows: int) -> Georeference:
    """Return where the pixels of an image lie that has the extent of a DEM."""
    from affine import Affine

    assert raw.crs is not None
    height, width = raw.heights.shape
    return Georeference(raw.transform @ Affine.scale(width / columns, height / rows), raw.crs)


def image_on_dem(image: Path, dem: Dem, world: Affine | None = None) -> NDArray[np.uint8] | None:
    """Return the pixels [rows, columns, 3] of an ortho image, row 0 in the north, on exactly a DEM's extent.

    None if the image lies in the DEM's own reference and on its extent already, or nobody says where it lies.
    Pixels without colour are black.

    Raises
    ------
    TerrainFormatError
        If it cannot be read, is too large, lies on another body or nowhere on the DEM.
    """
    from rasterio.warp import Resampling

    if dem.crs is None:
        return None
    with opened_image(image, "ortho image") as opened:
        columns, rows = opened.size
        own = own_georeference(image)
        if own is None and dem.source is not None:
            own = extent_of(dem.source, columns, rows)
            if world is not None:
                own = Georeference(world, own.crs)
        if own is None or _covers(own, columns, rows, dem):
            return None
        pixels = np.ascontiguousarray(np.moveaxis(np.asarray(opened.convert("RGB")), 2, 0))
    transform, across, up = _pixels_on(own, dem, columns, rows)
    require_size(f"ortho image {image}, reprojected,", across, up)
    target = np.zeros((3, up, across), np.uint8)
    warp(
        pixels,
        own.transform,
        own.crs,
        target,
        transform,
        dem.crs,
        Resampling.bilinear,
        f"ortho image {image}",
    )
    if not target.any() and pixels.any():
        raise TerrainFormatError(f"ortho image {image} lies nowhere on its DEM")
    return np.ascontiguousarray(np.moveaxis(target, 0, 2))


def mask_on_dem(mask: NDArray[np.bool_], dem: Dem) -> NDArray[np.bool_]:
    """Return a mask that was made on the posts of a DEM's file (row 0 north), on those that it has now.

    Row 0 is in the south. What lies outside the file is unknown: false.

    Both masks are [rows, columns].
    """
    from rasterio.warp import Resampling

    assert dem.source is not None
    assert dem.crs is not None
    target = np.zeros(dem.heights.shape, np.uint8)
    transform, _, _ = _raster_of(dem)
    own = dem.source
    warp(
        mask.astype(np.uint8), own.transform, own.crs, target, transform, dem.crs, Resampling.nearest, "mask"
    )
    return np.ascontiguousarray(target[::-1] > 0)


def _raster_of(dem: Dem) -> tuple[Affine, float, float]:
    from affine import Affine

    rows, columns = dem.heights.shape
    west, north = dem.west - dem.spacing / 2, dem.south + (rows - 0.5) * dem.spacing
    return Affine(dem.spacing, 0.0, west, 0.0, -dem.spacing, north), columns * dem.spacing, rows * dem.spacing


def _covers(own: Georeference, columns: int, rows: int, dem: Dem) -> bool:
    """Return whether an image has its DEM's extent in the DEM's own projection."""
    assert dem.crs is not None
    if dem.source is not None or not same_reference(own.crs, dem.crs):
        return False
    transform, width, height = _raster_of(dem)
    given = (*(own.transform @ (0, 0)), *(own.transform @ (columns, rows)))
    there = (transform.c, transform.f, transform.c + width, transform.f - height)
    return bool(np.allclose(given, there, rtol=0.0, atol=1e-6 * max(width, height)))


def _pixels_on(own: Georeference, dem: Dem, columns: int, rows: int) -> tuple[Affine, int, int]:
    """Return the transform, columns and rows of an image on a DEM's extent, as fine as the file's pixels."""
    from affine import Affine
    from rasterio.warp import transform as project

    raster, width, height = _raster_of(dem)
    u, v = columns / 2, rows / 2
    corners = [own.transform @ p for p in ((u, v), (u + 1, v), (u, v + 1))]
    with between(own.crs, dem.crs, "the ortho image"):
        x, y = project(own.crs, dem.crs, [c[0] for c in corners], [c[1] for c in corners])
    pixel_m = math.sqrt(abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])))
    if not (math.isfinite(pixel_m) and pixel_m > 0):
        raise TerrainFormatError("the ortho image does not lie where the terrain's reference is of use")
    across, up = max(1, math.ceil(width / pixel_m)), max(1, math.ceil(height / pixel_m))
    return Affine(width / across, 0.0, raster.c, 0.0, -height / up, raster.f), across, up
