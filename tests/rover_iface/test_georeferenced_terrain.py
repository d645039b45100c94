"""DEMs and orthos in any reference, against geodesics that pyproj works out."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from PIL import Image

from rover_iface.errors import TerrainFormatError
from rover_iface.terrain import load_terrain, write_terrain
from tests.rover_iface.test_terrain import geotiff
from tests.shared import needed

pyproj = needed("pyproj")

BODIES = [("EPSG:4326", 38.4, -110.8), ("IAU_2015:49900", 18.4, 77.5), ("IAU_2015:30100", -72.0, 31.0)]
POSTS = 120


def from_origin(west: float, north: float, across: float, down: float) -> Affine:
    """Return the transform of a raster that is north up."""
    return Affine(across, 0.0, west, 0.0, -down, north)


def in_degrees(folder: Path, crs: str, lat: float, lon: float, east: bool) -> tuple[Path, float, float]:
    """Write a DEM in degrees whose heights are metres east (or north) of its middle; return its posts."""
    geod = pyproj.CRS(crs).get_geod()
    step = 1e-4
    _, _, across = geod.inv(lon, lat, lon + step, lat)
    _, _, up = geod.inv(lon, lat, lon, lat + step)
    west, north = lon - step * POSTS / 2, lat + step * POSTS / 2
    lons, lats = np.meshgrid(west + (np.arange(POSTS) + 0.5) * step, north - (np.arange(POSTS) + 0.5) * step)
    azimuth, _, metres = geod.inv(np.full_like(lons, lon), np.full_like(lons, lat), lons, lats)
    heights = metres * (np.sin if east else np.cos)(np.radians(azimuth))
    path = geotiff(
        folder / f"dem_{east}.tif", heights, transform=from_origin(west, north, step, step), crs=crs
    )
    return path, across, up


@pytest.mark.parametrize(("crs", "lat", "lon"), BODIES)
def test_a_dem_in_degrees_lies_within_half_a_post_of_the_geodesics(
    tmp_path: Path, crs: str, lat: float, lon: float
) -> None:
    for east in (True, False):
        path, across, up = in_degrees(tmp_path, crs, lat, lon, east)
        ground = load_terrain(path)
        assert ground.spacing == pytest.approx(math.sqrt(across * up), rel=1e-3)
        reach = 0.4 * POSTS * min(across, up)
        x, y = np.meshgrid(np.linspace(-reach, reach, 31), np.linspace(-reach, reach, 31))
        off = np.abs(ground.height(x, y) - (x if east else y)).max()
        assert off < 0.05 * ground.spacing  # half a post is asked for
        assert (ground.origin["crs"], ground.origin["x"], ground.origin["y"]) == (
            crs, pytest.approx(lon), pytest.approx(lat),
        )  # fmt: skip


def test_a_dem_in_degrees_is_stored_and_read_again_in_metres(tmp_path: Path) -> None:
    path, _, _ = in_degrees(tmp_path, *BODIES[0], True)
    ground = load_terrain(path)
    again = load_terrain(write_terrain(ground, tmp_path / "stored"))
    assert again.origin == ground.origin
    assert float(again.height(30.0, 20.0)) == pytest.approx(float(ground.height(30.0, 20.0)), abs=0.002)


def test_a_turned_and_oblong_dem_with_a_reference_is_laid_north_up(tmp_path: Path) -> None:
    """Heights say how far east a post lies; a quarter of them would be wrong if the turn were lost."""
    turn = Affine.translation(500_000, 4_000_000) @ Affine.rotation(30) @ Affine.scale(1.0, -2.0)
    columns, rows = np.meshgrid(np.arange(80) + 0.5, np.arange(40) + 0.5)
    east = turn.a * columns + turn.b * rows + turn.c
    path = geotiff(tmp_path / "d.tif", east - 500_000, transform=turn, crs="EPSG:32612")
    ground = load_terrain(path)
    assert ground.spacing == pytest.approx(math.sqrt(2))
    x = np.linspace(-15, 15, 11)
    found = ground.height(x, np.zeros(11)) + 500_000 - ground.origin["x"]
    assert np.abs(found - x).max() < 0.02


def test_layers_in_two_references_lie_over_each_other(tmp_path: Path) -> None:
    """The second layer, in degrees, is brought into the UTM zone of the first."""
    x, _ = np.meshgrid(np.arange(100) + 0.5, 100 - (np.arange(100) + 0.5))
    utm = from_origin(499_950, 4_250_050, 1, 1)
    geotiff(tmp_path / "dem_100m.tif", x - 50, transform=utm, crs="EPSG:32612")
    to_utm = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:32612", always_xy=True)
    lon, lat = to_utm.transform(500_000, 4_250_000, direction="INVERSE")
    step = 2e-5
    lons, lats = np.meshgrid(lon + (np.arange(200) - 99.5) * step, lat - (np.arange(200) - 99.5) * step)
    east, _ = to_utm.transform(lons, lats)
    degrees = from_origin(lon - 100 * step, lat + 100 * step, step, step)
    geotiff(tmp_path / "dem_400m.tif", east - 500_000, transform=degrees, crs="EPSG:4326")
    document = {"format": "terrain/1", "layers": [{"dem": "dem_100m.tif"}, {"dem": "dem_400m.tif"}]}
    (tmp_path / "terrain.json").write_text(json.dumps(document))
    ground = load_terrain(tmp_path)
    at = np.array([-120.0, -80.0, 80.0, 120.0])
    assert np.abs(ground.height(at, np.full(4, 30.0)) - at).max() < 0.1
    assert float(ground.height(20.0, 20.0)) == pytest.approx(20.0, abs=1e-3)


def test_layers_on_two_bodies_are_refused_with_the_reason(tmp_path: Path) -> None:
    geotiff(tmp_path / "a.tif", np.zeros((4, 4)), transform=from_origin(77, 18, 1e-4, 1e-4), crs="EPSG:4326")
    geotiff(
        tmp_path / "b.tif", np.zeros((4, 4)), transform=from_origin(77, 18, 1e-4, 1e-4), crs="IAU_2015:49900"
    )
    document = {"format": "terrain/1", "layers": [{"dem": "a.tif"}, {"dem": "b.tif"}]}
    (tmp_path / "terrain.json").write_text(json.dumps(document))
    with pytest.raises(
        TerrainFormatError, match=r"b\.tif counts in IAU_2015:49900.* no transformation .* WGS 84"
    ):
        load_terrain(tmp_path)


def test_swapped_axes_of_a_dem_are_named(tmp_path: Path) -> None:
    path = geotiff(
        tmp_path / "a.tif", np.zeros((4, 4)), transform=from_origin(38, -110.8, 1e-4, 1e-4), crs="EPSG:4326"
    )
    with pytest.raises(TerrainFormatError, match="longitude and latitude may be swapped"):
        load_terrain(path)


@pytest.mark.parametrize("form", ["png", "tif"])
def test_an_ortho_goes_along_with_its_dem(tmp_path: Path, form: str) -> None:
    """A white square east of the middle stays there, in an image with the DEM's extent or tags of its own."""
    dem, across, _ = in_degrees(tmp_path, *BODIES[1], True)
    dem.rename(tmp_path / "dem.tif")
    pixels = np.zeros((240, 240, 3), np.uint8)
    pixels[110:130, 190:210] = 255
    if form == "png":
        Image.fromarray(pixels).save(tmp_path / "ortho.png")
    else:
        import rasterio

        step, (_, lat, lon) = 1e-4, BODIES[1]
        place = from_origin(lon - step * POSTS / 2, lat + step * POSTS / 2, step / 2, step / 2)
        with rasterio.open(
            tmp_path / "ortho.tif", "w", driver="GTiff", height=240, width=240, count=3, dtype="uint8",
            transform=place, crs="IAU_2015:49900",
        ) as out:  # fmt: skip
            out.write(np.moveaxis(pixels, 2, 0))
    ground = load_terrain(write_terrain(load_terrain(tmp_path), tmp_path / "stored"))
    east = 80 / 2 * across
    assert ground.orthos[0].colour(east, 0.0).min() > 250
    assert ground.orthos[0].colour(-east, 0.0).max() < 5
    assert ground.orthos[0].colour(0.0, east).max() < 5


def test_a_mask_goes_along_with_its_dem(tmp_path: Path) -> None:
    dem, across, _ = in_degrees(tmp_path, *BODIES[0], True)
    dem.rename(tmp_path / "dem.tif")
    seen = np.zeros((POSTS, POSTS), np.uint8)
    seen[:, POSTS // 2 :] = 255
    Image.fromarray(seen).save(tmp_path / "mask.png")
    ground = load_terrain(tmp_path)
    assert ground.observed(20 * across, 10.0).all()
    assert not ground.observed(-20 * across, 10.0).any()
