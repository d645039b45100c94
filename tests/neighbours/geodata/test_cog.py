"""Rasters as COG: GDAL opens them where they belong, and their bytes lie as a COG's should."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np
import pytest
import rasterio

from neighbours.geodata.cog import SITE, GridPlace, write_cog
from neighbours.geodata.errors import GeodataError
from tests.shared import needed

pyproj = needed("pyproj")
TILE_OFFSETS, TILE_COUNTS, TILE_WIDTH = 324, 325, 322


def directories(data: bytes) -> list[tuple[int, dict[int, list[int]]]]:
    """Return offset and numbers by tag of each directory of a little-endian classic TIFF, as defined."""
    assert data[:4] == b"II*\0"
    found, at = [], struct.unpack_from("<I", data, 4)[0]
    sizes = {3: ("H", 2), 4: ("I", 4)}
    while at:
        tags = {}
        (count,) = struct.unpack_from("<H", data, at)
        for k in range(count):
            tag, kind, number = struct.unpack_from("<HHI", data, at + 2 + 12 * k)
            if kind in sizes:
                letter, size = sizes[kind]
                inside = at + 2 + 12 * k + 8
                place = inside if size * number <= 4 else struct.unpack_from("<I", data, inside)[0]
                tags[tag] = list(struct.unpack_from(f"<{number}{letter}", data, place))
        found.append((at, tags))
        (at,) = struct.unpack_from("<I", data, at + 2 + 12 * count)
    return found


def assert_cog(path: Path) -> None:
    """Check the layout: all directories first, then tiles, those of the smallest overview first."""
    data = path.read_bytes()
    assert data[8:].startswith(b"GDAL_STRUCTURAL_METADATA_SIZE=")
    found = directories(data)
    first_tiles = []
    for _, tags in found:
        assert tags[TILE_WIDTH] == [256]
        sparse = [(o, n) for o, n in zip(tags[TILE_OFFSETS], tags[TILE_COUNTS], strict=True) if n]
        first_tiles.append(min(o for o, _ in sparse))
        assert [o for o, _ in sparse] == sorted(o for o, _ in sparse)
    assert [at for at, _ in found] == sorted(at for at, _ in found)
    assert max(at for at, _ in found) < min(first_tiles)
    assert first_tiles == sorted(first_tiles, reverse=True)


@pytest.mark.parametrize(
    ("name", "x", "y", "turn"),
    [
        ("EPSG:32612", 518_334.0, 4_251_500.0, 0.4),
        ("IAU_2015:49910", 4_500_000.0, 300_000.0, 0.0),
        ("+proj=aeqd +lon_0=31 +lat_0=-84.6 +R=1737400 +units=m +no_defs", 0.0, 0.0, -1.0),
    ],
)
def test_a_cog_lies_where_pyproj_says_and_holds_every_height(
    tmp_path: Path, name: str, x: float, y: float, turn: float
) -> None:
    heights = np.random.default_rng(2).normal(0, 50, (1, 600, 700)).astype(np.float32)
    heights[0, 3, 5] = np.nan
    crs = pyproj.CRS(name)
    path = tmp_path / "dem.tif"
    write_cog(
        path, heights, GridPlace(crs.to_wkt(), x, y, turn), -35.0, 30.0, 0.1, tags={"HEIGHTS": "areoid"}
    )
    assert_cog(path)
    with rasterio.open(path) as file:
        assert np.array_equal(file.read(), heights, equal_nan=True)
        assert math.isnan(file.nodata)
        assert file.tags()["HEIGHTS"] == "areoid"
        assert file.overviews(1) == [2, 4]
        assert pyproj.CRS.from_wkt(file.crs.to_wkt()).ellipsoid.semi_major_metre == pytest.approx(
            crs.ellipsoid.semi_major_metre
        )
        east, north = -35.0 + 5.5 * 0.1, 30.0 - 3.5 * 0.1  # the middle of the pixel [3, 5]
        across = x + east * math.cos(turn) - north * math.sin(turn)
        up = y + east * math.sin(turn) + north * math.cos(turn)
        assert file.xy(3, 5) == pytest.approx((across, up), abs=1e-5)
        degrees = crs.geodetic_crs
        one = pyproj.Transformer.from_crs(file.crs.to_wkt(), degrees, always_xy=True).transform(
            *file.xy(3, 5)
        )
        two = pyproj.Transformer.from_crs(crs, degrees, always_xy=True).transform(across, up)
        assert one == pytest.approx(two, abs=1e-9)


def test_an_image_of_a_site_without_place_is_in_metres_of_the_site(tmp_path: Path) -> None:
    pixels = np.random.default_rng(1).integers(0, 255, (3, 300, 300), dtype=np.uint8)
    write_cog(tmp_path / "ortho.tif", pixels, SITE, -15.0, 15.0, 0.1)
    assert_cog(tmp_path / "ortho.tif")
    with rasterio.open(tmp_path / "ortho.tif") as file:
        assert np.array_equal(file.read(), pixels)
        assert file.bounds == pytest.approx((-15.0, -15.0, 15.0, 15.0))


def test_a_raster_without_pixels_is_refused(tmp_path: Path) -> None:
    with pytest.raises(GeodataError, match="1 x 0 x 4"):
        write_cog(tmp_path / "no.tif", np.zeros((1, 0, 4), np.float32), SITE, 0.0, 0.0, 1.0)
