"""A DEM as its file holds it, and as heights on square posts in metres, reprojected where it must be.

A DEM on square, north-up posts of a projection in metres is taken as it is. One in degrees, turned, with
oblong posts, or in another reference than the first of its folder is resampled (bilinear) on square posts:
those of the first DEM's projection, or, for degrees, of an azimuthal equidistant projection round its middle,
on the same datum. Its posts are as far apart as the geometric mean of the file's.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rover_iface.errors import TerrainFormatError
from rover_iface.terrain.outside import require_size

if TYPE_CHECKING:
    from affine import Affine
    from rasterio.crs import CRS

FEET = {"ft", "feet", "foot", "us survey foot", "km", "kilometre", "kilometer"}
TOLERANCE_PX = 0.01
"""How far the warp may place a pixel from where the projection puts it; the library's own is 0.125."""


@dataclass(frozen=True, slots=True)
class RawDem:
    """A DEM as its file holds it: `heights` [rows, columns] in its order, NaN unknown, `crs` None if none."""

    path: Path
    heights: NDArray[np.float32]
    transform: Affine
    crs: CRS | None

    @property
    def plain(self) -> bool:
        """Return whether its posts are square, north up (or south up) and in metres."""
        step = self.transform.a
        square = step > 0 and abs(step - abs(self.transform.e)) <= 1e-6 * step
        return square and not self.turned and (self.crs is None or not self.crs.is_geographic)

    @property
    def turned(self) -> bool:
        """Return whether its columns do not lead north."""
        size = math.hypot(self.transform.a, self.transform.d)
        return max(abs(self.transform.b), abs(self.transform.d)) > 1e-9 * max(size, 1e-9)

    def middle(self) -> tuple[float, float]:
        """Return the middle of the raster in its own coordinates."""
        rows, columns = self.heights.shape
        x, y = self.transform @ (columns / 2, rows / 2)
        return float(x), float(y)


@dataclass(frozen=True, slots=True)
class Dem:
    """Heights [rows, columns] (row 0 south, NaN = unknown); the first post stands at (`west`, `south`).

    `crs` is the projection in which these are metres, None where the file names none. `source` is the file as
    it was, for what was made on the same grid; None if nothing was resampled.
    """

    heights: NDArray[np.float32]
    west: float
    south: float
    spacing: float
    crs: CRS | None
    source: RawDem | None = None

    @property
    def place(self) -> tuple[float, float, float]:
        """Return west, south and spacing, m."""
        return self.west, self.south, self.spacing


def read_dem(path: Path, onto: CRS | None = None) -> Dem:
    """Return a DEM on square posts in metres, in the projection `onto` if the file names any reference.

    Raises
    ------
    TerrainFormatError
        If the file is not a raster, has no geotransform, is rotated or has oblong posts without naming a
        reference, counts in feet, has no known height, or lies on another body than `onto`.
    """
    raw = _read(path)
    if not np.isfinite(raw.heights).any():
        raise TerrainFormatError(f"DEM {path} holds no known height")
    if raw.plain and (onto is None or raw.crs is None or same_reference(raw.crs, onto)):
        return _as_it_is(raw)
    if raw.crs is None:
        raise TerrainFormatError(_why_not_plain(raw))
    return _resampled(raw, onto or site_projection(raw.crs, raw.middle(), f"DEM {path}"))


def crs_text(crs: CRS) -> str:
    """Return a reference as `AUTHORITY:CODE` where a registry has it, else as WKT."""
    known = crs.to_authority()
    return ":".join(known) if known else str(crs.to_wkt())


def same_reference(one: CRS, other: CRS) -> bool:
    """Return whether two references are one."""
    return bool(one == other) or one.to_wkt() == other.to_wkt()


def site_projection(crs: CRS, middle: tuple[float, float], what: str) -> CRS:
    """Return the projection in metres for what counts in `crs`: itself, or one round the middle for degrees.

    Raises
    ------
    TerrainFormatError
        If the middle is not a longitude and latitude.
    """
    from rasterio.crs import CRS

    if not crs.is_geographic:
        return crs
    lon, lat = middle
    if not (-360.0 <= lon <= 360.0 and -90.0 <= lat <= 90.0):
        raise TerrainFormatError(
            f"{what} has its middle at longitude {lon:g}, latitude {lat:g}; a latitude is within 90 degrees "
            "(longitude and latitude may be swapped)"
        )
    base = crs.to_wkt(version="WKT1_GDAL")
    return CRS.from_wkt(
        f'PROJCS["site",{base},PROJECTION["Azimuthal_Equidistant"],'
        f'PARAMETER["latitude_of_center",{lat!r}],PARAMETER["longitude_of_center",{lon!r}],'
        'PARAMETER["false_easting",0],PARAMETER["false_northing",0],UNIT["metre",1]]'
    )


def _read(path: Path) -> RawDem:
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning, RasterioError

    if not path.is_file():
        raise TerrainFormatError(f"DEM {path} does not exist")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        try:
            with rasterio.open(path, driver="GTiff") as dataset:  # others may name files elsewhere
                require_size(f"DEM {path}", dataset.width, dataset.height)
                transform, crs = dataset.transform, dataset.crs
                band = dataset.read(1, masked=True)
                unit = (dataset.units[0] or "").lower() if dataset.units else ""
        except (RasterioError, ValueError) as err:
            raise TerrainFormatError(f"DEM {path}: {err}") from err
    if transform.is_identity:
        raise TerrainFormatError(
            f"DEM {path} has no georeference: a geotransform (GeoTIFF tags or world file) in metres is needed"
        )
    if not all(math.isfinite(value) for value in transform) or transform.determinant == 0:
        raise TerrainFormatError(f"DEM {path} has a geotransform of no use: {tuple(transform)[:6]}")
    if crs is not None and crs.is_projected:
        factor = float(crs.linear_units_factor[1])
        if abs(factor - 1) > 1e-6:
            raise TerrainFormatError(f"DEM {path} counts in {crs.linear_units}, not in metres")
    if unit in FEET:
        raise TerrainFormatError(f'DEM {path} gives heights in "{unit}", not in metres')
    return RawDem(path, np.ma.filled(band.astype(np.float32), np.nan), transform, crs or None)


def _why_not_plain(raw: RawDem) -> str:
    t = raw.transform
    if raw.turned:
        return f"DEM {raw.path} is rotated (b {t.b:g}, d {t.d:g}) and names no reference; north must be up"
    return f"DEM {raw.path} has posts of {t.a:g} by {-t.e:g} and names no reference; they must be square"


def _as_it_is(raw: RawDem) -> Dem:
    heights, t = raw.heights, raw.transform
    if t.e < 0:
        heights, south = heights[::-1], t.f + (heights.shape[0] - 0.5) * t.e
    else:
        south = t.f + 0.5 * t.e
    heights = np.ascontiguousarray(heights)
    return Dem(heights, float(t.c + 0.5 * t.a), float(south), float(t.a), raw.crs)


def _resampled(raw: RawDem, onto: CRS) -> Dem:
    from affine import Affine
    from rasterio.warp import Resampling

    rows, columns = raw.heights.shape
    west, south, east, north = _edges(raw, onto)
    spacing = math.sqrt((east - west) * (north - south) / (rows * columns))
    if raw.crs is not None and not raw.crs.is_geographic:  # its own posts are metres already
        spacing = math.sqrt(abs(raw.transform.determinant))
    across, up = max(2, round((east - west) / spacing)), max(2, round((north - south) / spacing))
    require_size(f"DEM {raw.path}, reprojected,", across, up)
    target = Affine(spacing, 0.0, west, 0.0, -spacing, south + up * spacing)
    heights = np.full((up, across), np.nan, np.float32)
    warp(raw.heights, raw.transform, raw.crs, heights, target, onto, Resampling.bilinear, f"DEM {raw.path}")
    if not np.isfinite(heights).any():
        raise TerrainFormatError(f"DEM {raw.path} holds no known height after it is reprojected")
    first = west + spacing / 2, south + spacing / 2
    return Dem(np.ascontiguousarray(heights[::-1]), *first, spacing, onto, raw)


def _edges(raw: RawDem, onto: CRS) -> tuple[float, float, float, float]:
    """Return west, south, east and north of a raster's rim in another reference."""
    from rasterio.warp import transform

    rows, columns = raw.heights.shape
    step = np.linspace(0.0, 1.0, 21)
    rim = [(u, v) for u in step for v in (0.0, 1.0)] + [(u, v) for u in (0.0, 1.0) for v in step]
    corners = [raw.transform @ (u * columns, v * rows) for u, v in rim]
    with between(raw.crs, onto, f"DEM {raw.path}"):
        x, y = transform(raw.crs, onto, [c[0] for c in corners], [c[1] for c in corners])
    if not np.isfinite([x, y]).all():
        raise TerrainFormatError(f"DEM {raw.path} does not lie where the terrain's reference is of use")
    return min(x), min(y), max(x), max(y)


def warp(
    source: NDArray[Any],
    transform: Affine,
    crs: CRS,
    target: NDArray[Any],
    onto_transform: Affine,
    onto: CRS,
    method: Any,
    what: str,
) -> None:
    """Fill `target` [rows, columns] or [bands, rows, columns] with `source`; NaN stays unknown.

    Raises
    ------
    TerrainFormatError
        If there is no transformation between the references, as between two bodies.
    """
    from rasterio.warp import reproject

    unknown = math.nan if np.issubdtype(source.dtype, np.floating) else None
    with between(crs, onto, what):
        reproject(
            source,
            target,
            src_transform=transform,
            src_crs=crs,
            dst_transform=onto_transform,
            dst_crs=onto,
            resampling=method,
            src_nodata=unknown,
            dst_nodata=unknown,
            tolerance=TOLERANCE_PX,
            XSCALE=1,  # else a wider kernel, 6 % of a post off
            YSCALE=1,
        )


@contextmanager
def between(crs: CRS, onto: CRS, what: str) -> Iterator[None]:
    """Give the errors of a transformation the names of what was to be transformed.

    Raises
    ------
    TerrainFormatError
        If there is none between the references.
    """
    from rasterio._err import CPLE_BaseError  # what the library lets through is not a RasterioError
    from rasterio.errors import RasterioError

    try:
        yield
    except (RasterioError, CPLE_BaseError, ValueError) as err:
        raise TerrainFormatError(
            f"{what} counts in {_name(crs)}; from there no transformation leads to the terrain's "
            f"reference, {_name(onto)}"
        ) from err


def _name(crs: CRS) -> str:
    """Return what a reference is called: its code, or the first name in its WKT."""
    known = crs.to_authority()
    names = [name for name in re.findall(r'"([^"]+)"', crs.to_wkt()) if name != "site"]
    return ":".join(known) if known else names[0] if names else "a reference without a name"
