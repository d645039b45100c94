"""Terrain: queries, files, the generator, rocks."""

from __future__ import annotations

import errno
import json
import math
import os
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rover_iface.errors import OutsideTerrainError, TerrainFormatError
from rover_iface.terrain import (
    HeightLayer,
    Ortho,
    Recipe,
    Rock,
    Terrain,
    generate_terrain,
    load,
    load_terrain,
    stereo_covariance,
    write_terrain,
)
from rover_iface.terrain.landscape import Landscape
from rover_iface.terrain.rocks import golombek_rapp_cover, rock_density, rock_meshes
from tests.rover_iface.worlds import bumpy, generated, plane
from tests.shared import shared

place = st.floats(-9, 9)
grade = st.floats(-0.5, 0.5)


# ---- queries


@given(grade, grade, place, place)
def test_a_plane_has_its_height_normal_and_slope_everywhere(a: float, b: float, x: float, y: float) -> None:
    ground = plane(a, b)
    assert float(ground.height(x, y)) == pytest.approx(a * x + b * y, abs=1e-5)
    expected = np.array([-a, -b, 1.0]) / math.sqrt(a * a + b * b + 1)
    assert np.allclose(ground.normal(x, y), expected, atol=1e-4)
    assert float(ground.slope(x, y)) == pytest.approx(math.atan(math.hypot(a, b)), abs=1e-4)


def test_a_plane_is_not_rough_and_a_wave_is_by_its_rms() -> None:
    assert float(plane(0.2, -0.1).roughness(1.0, 1.0)) < 1e-4
    wave = bumpy(lambda x, y: 0.05 * np.sin(2 * np.pi * x / 0.4))
    assert float(wave.roughness(0.0, 0.0)) == pytest.approx(0.05 / math.sqrt(2), rel=0.1)


def test_heights_of_many_points_are_those_of_each() -> None:
    ground = generated()
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-20, 20, (2, 50))
    each = [float(ground.height(a, b)) for a, b in zip(x, y, strict=True)]
    assert np.allclose(ground.height(x, y), each)


def test_outside_is_nan_or_an_error_that_names_the_place() -> None:
    ground = plane()
    assert np.isnan(ground.height(50.0, 0.0))
    assert not bool(ground.inside(50.0, 0.0))
    with pytest.raises(OutsideTerrainError, match=r"target T-3 \(50.00, 0.00\) lies outside the terrain"):
        ground.height_at(50.0, 0.0, "target T-3")


def test_the_finest_layer_answers_where_it_reaches() -> None:
    fine = HeightLayer(np.full((21, 21), 1.0, np.float32), -1.0, -1.0, 0.1)
    coarse = HeightLayer(np.zeros((21, 21), np.float32), -10.0, -10.0, 1.0)
    both = Terrain("two", (fine, coarse))
    assert both.height([0.0, 5.0], [0.0, 5.0]).tolist() == [1.0, 0.0]
    assert both.bounds == (-10.5, -10.5, 10.5, 10.5)


def test_unknown_posts_fall_through_to_the_next_layer() -> None:
    holed = np.ones((21, 21), np.float32)
    holed[10, 10] = np.nan
    ground = Terrain(
        "holed",
        (HeightLayer(holed, -1, -1, 0.1), HeightLayer(np.zeros((5, 5), np.float32), -2.0, -2.0, 1.0)),
    )
    assert float(ground.height(0.0, 0.0)) == 0.0
    assert float(ground.height(0.5, 0.5)) == 1.0


def test_line_of_sight_is_blocked_by_a_wall_and_free_over_it() -> None:
    wall = bumpy(lambda x, y: np.where(np.abs(x) < 0.2, 1.0, 0.0))
    assert not bool(wall.line_of_sight([-3, 0, 0.5], [3, 0, 0.0]))
    assert bool(wall.line_of_sight([-3, 0, 2.5], [3, 0, 0.0]))
    assert bool(wall.line_of_sight([-3, 0, 0.5], [-1, 0, 0.0]))


def test_a_ray_meets_the_plane_where_geometry_says() -> None:
    hit = plane(0.1, 0.0).intersect_rays([0, 0, 2.0], [1.0, 0.5, -0.5])
    t = 2.0 / 0.6
    assert np.allclose(hit, [t, 0.5 * t, 2 - 0.5 * t], atol=0.01)
    assert np.isnan(plane().intersect_rays([0, 0, 2.0], [1.0, 0.0, 0.5], 5.0)).all()


@pytest.mark.parametrize("coarsening", [0.0, 0.01])
def test_rays_stop_at_the_first_ridge_that_is_not_thinner_than_a_step(coarsening: float) -> None:
    ground = bumpy(lambda x, y: 0.3 * np.sin(x) * np.cos(1.3 * y))
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    print(f"seed {seed}")
    ways = np.random.default_rng(seed).normal(size=(300, 3))
    ways[:, 2] = -np.abs(ways[:, 2])
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    eye = np.array([0.0, 0.0, float(ground.height(0.0, 0.0)) + 2.0])
    found = ground.intersect_rays(eye, ways, 30.0, coarsening=coarsening)
    t = np.arange(0.0, 30.0, 0.002)
    for way, hit in zip(ways, found, strict=True):
        line = eye + t[:, None] * way
        below = line[:, 2] <= ground.height(line[:, 0], line[:, 1])
        if np.isnan(hit).any():
            reached = 30.0
        else:
            reached = float(np.linalg.norm(hit - eye))
            assert hit[2] == pytest.approx(float(ground.height(hit[0], hit[1])), abs=1e-6)
        longest = max(0.02, ground.spacing / 2, coarsening * reached) + 0.004
        for thin in np.split(t, np.flatnonzero(~below)):  # a stretch of the ray below ground, before the hit
            assert not thin.size or thin[0] >= reached - 0.01 or thin[-1] - thin[0] <= longest


def test_a_height_grid_holds_the_terrain_south_row_first() -> None:
    grid = plane(0.1, 0.3).as_height_grid(0.5)
    rows, columns = grid.heights_m.shape
    y = grid.south_m + np.arange(rows) * grid.spacing_m
    x = grid.west_m + np.arange(columns) * grid.spacing_m
    assert np.allclose(grid.heights_m, 0.1 * x[None, :] + 0.3 * y[:, None], atol=1e-4)
    with pytest.raises(TerrainFormatError, match="spacing of a height grid is -1 m"):
        plane().as_height_grid(-1)


def test_the_mesh_of_the_ground_faces_up_and_lies_on_it() -> None:
    ground = plane(0.2, 0.1)
    mesh = ground.mesh((-2, -2, 2, 2), 0.25)
    a, b, c = (mesh.vertices[mesh.triangles[:, k]].astype(float) for k in range(3))
    up = np.cross(b - a, c - a)
    assert (up[:, 2] > 0).all()
    assert np.allclose(mesh.vertices[:, 2], 0.2 * mesh.vertices[:, 0] + 0.1 * mesh.vertices[:, 1], atol=1e-5)


def test_covariance_of_a_picked_point_follows_the_published_error_model() -> None:
    """Kim et al. 2009, Table I: pancam (16 mm, 300 mm baseline, 7.4 um pixels) 9.7 cm 3-sigma at 10 m."""
    focal = 16.0e-3 / 4.65e-6
    covariance = stereo_covariance(
        [0, 0, 0], [10, 0, 0], focal_px=focal, baseline_m=0.3, sigma_px=1 / 3 / math.sqrt(2)
    )
    assert 3 * math.sqrt(covariance[0, 0]) == pytest.approx(0.097, rel=0.01)
    assert np.linalg.eigvalsh(covariance).min() > 0
    with pytest.raises(TerrainFormatError, match="positive range"):
        stereo_covariance([0, 0, 0], [0, 0, 0], focal_px=1, baseline_m=1)


# ---- rocks


@given(st.floats(0.01, 0.3), st.floats(0.05, 1.0))
def test_cover_falls_with_size_by_the_published_law(total: float, size: float) -> None:
    q = 1.79 + 0.152 / total
    assert golombek_rapp_cover(size, total) == pytest.approx(total * math.exp(-q * size))


def test_rocks_of_all_sizes_together_cover_what_the_law_says() -> None:
    total, share, size = rock_density(0.05, 5.0, 0.05)
    mean_area = np.trapezoid(size**2 * math.pi / 4, share)
    assert total * mean_area == pytest.approx(golombek_rapp_cover(0.05, 0.05), rel=0.02)


def test_generated_rocks_follow_the_law_in_number() -> None:
    ground = generate_terrain(
        5, 64.0, rock_cover=0.08, inner_m=63.0, ortho=False, crater=False, ripples=False, inner_spacing_m=0.1
    )
    big = sum(1 for r in ground.rocks if r.diameter >= 0.3)
    total, share, size = rock_density(0.1, 2.0, 0.08)
    expected = total * (1 - np.interp(0.3, size, share)) * 64**2
    assert 0.85 * expected < big < 1.1 * expected


rocks = st.builds(
    Rock,
    id=st.just("R1"),
    x=st.floats(-5, 5),
    y=st.floats(-5, 5),
    z=st.floats(-1, 1),
    diameter=st.floats(0.1, 2.0),
    height=st.floats(0.05, 1.0),
    yaw=st.floats(0, 6.28),
    elongation=st.floats(0.6, 1.0),
    burial=st.floats(0.1, 0.5),
    seed=st.integers(0, 2**31 - 1),
)


@given(rocks)
def test_a_rock_mesh_is_closed_faces_out_and_has_the_size_it_claims(rock: Rock) -> None:
    (mesh,) = rock_meshes([rock])
    v = mesh.vertices.astype(float)
    edges = np.sort(
        np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [2, 0]]])
    )
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert (count == 2).all()
    a, b, c = (v[mesh.triangles[:, k]] for k in range(3))
    assert np.einsum("ni,ni->n", a - [rock.x, rock.y, rock.z], np.cross(b - a, c - a)).sum() > 0
    wide = np.hypot(v[:, 0] - rock.x, v[:, 1] - rock.y).max()
    assert wide <= rock.diameter / 2 + 1e-3
    assert v[:, 2].max() == pytest.approx(rock.z + rock.height, abs=1e-3)
    assert v[:, 2].min() < rock.z


def test_a_rock_looks_the_same_in_every_scene() -> None:
    ground = generated()
    alone = rock_meshes([ground.rocks[5]])[0]
    among = rock_meshes(list(ground.rocks[:40]))[5]
    assert among.id == alone.id
    assert np.array_equal(alone.vertices, among.vertices)


def test_rocks_stand_on_the_ground_and_show_in_the_heights() -> None:
    ground = generated()
    for rock in [r for r in ground.rocks if r.diameter > 0.4 and max(abs(r.x), abs(r.y)) < 11][:20]:
        top = ground.height(rock.x, rock.y) - ground.height(rock.x, rock.y, ground=True)
        assert 0.4 * rock.height < float(top) < 1.15 * rock.height
        found = ground.nearest_rock(rock.x, rock.y)
        assert found is not None
        assert found[1] == 0.0


def test_the_nearest_rock_is_the_nearest_by_its_edge() -> None:
    ground = generated()
    rock, distance = ground.nearest_rock(1.0, -2.0) or (None, 0.0)
    assert rock is not None
    edges = [math.hypot(r.x - 1, r.y + 2) - r.diameter / 2 for r in ground.rocks]
    assert distance == pytest.approx(max(0.0, min(edges)))
    assert ground.rocks_near(1.0, -2.0, 3.0)[0] is rock
    assert plane().nearest_rock(0, 0) is None


# ---- generator and files


def test_the_same_seed_gives_the_same_terrain_and_another_seed_another() -> None:
    one, two = (generate_terrain(7, 32.0, inner_m=16.0) for _ in range(2))
    assert one.sha256 == two.sha256
    assert np.array_equal(one.orthos[0].rgb, two.orthos[0].rgb)
    assert one.rocks == two.rocks
    assert generate_terrain(8, 32.0, inner_m=16.0, ortho=False).sha256 != one.sha256


def test_both_layers_agree_where_they_overlap() -> None:
    ground = generated()
    axis = np.linspace(-11, 11, 60)
    x, y = np.meshgrid(axis, axis)
    fine = ground.layers[0].sample(x, y, ground=True)
    coarse = ground.layers[1].sample(x, y, ground=True)
    assert float(np.median(np.abs(fine - coarse))) < 0.015
    assert float(np.percentile(np.abs(fine - coarse), 95)) < 0.04


def test_the_start_lies_on_clear_level_ground_at_height_zero() -> None:
    for seed in range(4):
        ground = generate_terrain(seed, 48.0, inner_m=24.0, ortho=False)
        assert abs(ground.height_at(0, 0)) < 0.02
        nearest = ground.nearest_rock(0, 0)
        assert nearest is not None
        assert nearest[1] > 1.0


@pytest.mark.parametrize("heading", ["north", math.nan, math.inf, 90.0, None, True, [0.1]])
def test_a_start_heading_that_is_no_angle_is_refused(heading: object, tmp_path: Path) -> None:
    write_terrain(plane(), tmp_path)
    told = json.loads((tmp_path / "terrain.json").read_text())
    for good in (0, 1.57, -math.pi):
        (tmp_path / "terrain.json").write_text(json.dumps({**told, "origin": {"heading_rad": good}}))
        assert load_terrain(tmp_path).start_heading_rad == good
    (tmp_path / "terrain.json").write_text(json.dumps({**told, "origin": {"heading_rad": heading}}))
    with pytest.raises(TerrainFormatError, match="heading_rad"):
        load_terrain(tmp_path)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"size_m": 2}, "terrain size is 2 m"),
        ({"rock_cover": 0.9}, "rock cover is 0.9"),
        ({"spacing_m": 0.01}, "post spacings"),
        ({"inner_m": 500}, "inner size is 500 m"),
    ],
)
def test_an_impossible_recipe_is_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(TerrainFormatError, match=message):
        Recipe(**options)  # type: ignore[arg-type]
    with pytest.raises(TerrainFormatError, match="unexpected keyword"):
        generate_terrain(1, colour="green")


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    ground = generate_terrain(4, 32.0, inner_m=16.0)
    write_terrain(ground, tmp_path / "site")
    again = load_terrain(tmp_path / "site")
    assert again.rocks == ground.rocks
    assert again.bounds == pytest.approx(ground.bounds)
    for one, two in zip(ground.layers, again.layers, strict=True):
        assert np.array_equal(one.heights, two.heights)
        assert one.ground is not None
        assert two.ground is not None
        assert np.array_equal(one.ground, two.ground)
        assert (one.west, one.south, one.spacing) == pytest.approx((two.west, two.south, two.spacing))
    assert np.array_equal(again.orthos[0].rgb, ground.orthos[0].rgb)
    assert load_terrain(tmp_path / "site" / "terrain.json").sha256 == again.sha256


def test_a_colour_is_looked_up_north_up() -> None:
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 1] = (9, 8, 7)
    ortho = Ortho((0, 0, 2, 2), pixels=pixels)
    assert ortho.colour(1.5, 1.5).tolist() == [9, 8, 7]
    assert ortho.colour(1.5, 0.5).tolist() == [0, 0, 0]
    assert ortho.crop(1.5, 1.5, 0.5, 4)[0, 0].tolist() == [9, 8, 7]


def test_the_onsight_sites_load_by_their_file_names_with_the_published_relief() -> None:
    """Table of the data's README: relief of the inner 32 m and median slopes."""
    expected = {"murray_buttes": (-2.9, 3.3, 9.7), "landing_site": (-2.0, 1.6, 4.4)}
    for site, (low, high, slope) in expected.items():
        ground = load_terrain(shared(f"data/terrain/msl_onsight/{site}"))
        assert [layer.spacing for layer in ground.layers] == pytest.approx([0.05, 0.25])
        inner = ground.layers[0].heights
        assert float(inner.min()) == pytest.approx(low, abs=0.06)
        assert float(inner.max()) == pytest.approx(high, abs=0.06)
        axis = np.linspace(-15, 15, 120)
        grid = np.meshgrid(axis, axis)
        assert math.degrees(float(np.median(ground.slope(*grid, 0.25)))) == pytest.approx(slope, abs=1.2)
        assert 0.78 < float(ground.observed(*grid).mean()) < 0.93
        assert len(ground.orthos) == 2


def from_origin(west: float, north: float, dx: float, dy: float) -> object:
    from affine import Affine

    return Affine(dx, 0, west, 0, -dy, north)


def geotiff(path: Path, data: np.ndarray, **profile: object) -> Path:
    import rasterio

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(
            path,
            "w",
            driver="GTiff",
            height=data.shape[0],
            width=data.shape[1],
            count=1,
            dtype="float32",
            **profile,
        ) as dataset:
            dataset.write(data.astype(np.float32), 1)
    return path


def test_a_dem_without_georeference_is_refused(tmp_path: Path) -> None:
    path = geotiff(tmp_path / "dem.tif", np.zeros((4, 4)))
    with pytest.raises(TerrainFormatError, match="has no georeference: a geotransform"):
        load_terrain(path)
    with pytest.raises(TerrainFormatError, match="has no georeference"):
        load_terrain(tmp_path)


def test_tracks_lead_to_the_start_and_nowhere_else() -> None:
    recipe = Recipe(seed=5, size_m=24.0, inner_m=20.0, crater=False, ripples=False, outcrop=False)
    plain, driven = (generate_terrain(recipe=replace(recipe, tracks=t)) for t in (False, True))
    fine, rutted = plain.layers[0], driven.layers[0]
    assert fine.ground is not None
    assert rutted.ground is not None
    sunk = fine.ground - rutted.ground
    assert 0.010 < sunk.max() <= 0.017
    rows, columns = np.nonzero(sunk > 0.008)
    x, y = fine.west + columns * fine.spacing, fine.south + rows * fine.spacing
    # A section across the way, 2 m before the start, meets two ruts a wheelbase apart.
    away = np.hypot(x, y)
    section = np.abs(away - 2.0) < 0.06
    spread = np.ptp(np.column_stack((x[section], y[section])), axis=0)
    assert np.hypot(*spread) == pytest.approx(0.73 + 0.12, abs=0.1)
    # The half of the site that lies ahead of the start is untouched.
    ahead = np.array([x.mean(), y.mean()])
    assert (-(x * ahead[0] + y * ahead[1]) / np.hypot(*ahead)).max() < 1.2
    # No rock stands in the way of the wheels, and the image shows them darker than the soil.
    assert len(driven.rocks) < len(plain.rocks)
    before, after = (t.orthos[0].colour(x, y).mean() for t in (plain, driven))
    assert after < before - 5


def test_a_dem_in_feet_or_oblong_or_turned_without_a_reference_is_refused(tmp_path: Path) -> None:
    from affine import Affine
    from rasterio.crs import CRS

    data = np.zeros((4, 4))
    feet = geotiff(tmp_path / "b.tif", data, transform=from_origin(0, 0, 1, 1), crs=CRS.from_epsg(2263))
    with pytest.raises(TerrainFormatError, match="not in metres"):
        load_terrain(feet)
    oblong = geotiff(tmp_path / "c.tif", data, transform=from_origin(0, 0, 1, 2))
    with pytest.raises(TerrainFormatError, match="posts of 1 by 2 and names no reference"):
        load_terrain(oblong)
    turned = geotiff(tmp_path / "d.tif", data, transform=Affine(1, 0.5, 0, 0.5, -1, 0))
    with pytest.raises(TerrainFormatError, match="is rotated"):
        load_terrain(turned)
    empty = geotiff(
        tmp_path / "e.tif", np.full((4, 4), np.nan), transform=from_origin(0, 0, 1, 1), nodata=np.nan
    )
    with pytest.raises(TerrainFormatError, match="holds no known height"):
        load_terrain(empty)


def test_a_projected_dem_gets_its_origin_in_the_middle(tmp_path: Path) -> None:
    path = geotiff(
        tmp_path / "far.tif", np.arange(100.0).reshape(10, 10), transform=from_origin(5e5, 4e6, 1, 1)
    )
    ground = load_terrain(path)
    assert ground.bounds == (-5, -5, 5, 5)
    assert ground.origin["east_m"] == 500005.0
    assert float(ground.height(-4.5, 4.5)) == 0.0


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ("{", "terrain.json"),
        ({"format": "terrain/9"}, '"terrain/9"'),
        ({"format": "terrain/1"}, "layers has 0 entries; it needs at least 1"),
        ({"format": "terrain/1", "layers": [{"ortho": "x.png"}]}, r"layers\[0\].dem is missing"),
        ({"format": "terrain/1", "dem": "nothing.tif"}, "does not exist"),
    ],
)
def test_a_broken_description_is_refused(tmp_path: Path, document: object, message: str) -> None:
    text = document if isinstance(document, str) else json.dumps(document)
    (tmp_path / "terrain.json").write_text(text)
    with pytest.raises(TerrainFormatError, match=message):
        load_terrain(tmp_path)


def test_a_folder_without_terrain_and_a_missing_one_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TerrainFormatError, match="holds no terrain"):
        load_terrain(tmp_path)
    with pytest.raises(TerrainFormatError, match="does not exist"):
        load_terrain(tmp_path / "nowhere")


def test_a_terrain_of_before_with_members_of_its_own_opens(tmp_path: Path) -> None:
    folder = write_terrain(plane(), tmp_path / "old")
    description = folder / "terrain.json"
    document = json.loads(description.read_text())
    document["made_by"] = "a tool"
    document["layers"][0]["note"] = "from stereo"
    description.write_text(json.dumps(document))
    assert load_terrain(folder).name == document["name"]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("cover", [5e-324, 1e-310, 1e-9, 1e-5, 2e-5])
def test_hardly_any_rock_cover_is_ground_without_rocks(cover: float) -> None:
    total, share, _size = rock_density(0.1, 2.0, cover)
    assert 0.0 <= total < 1e-300
    assert np.all(np.isfinite(share))


def test_heights_between_posts_are_bilinear_to_the_bit() -> None:
    rng = np.random.default_rng(8)
    data = rng.normal(0.0, 3.0, (7, 9)).astype(np.float32)
    data[2, 3] = np.nan
    layer = HeightLayer(data, -2.0, 1.0, 0.3)
    x = np.concatenate([rng.uniform(-3.0, 2.0, 500), [np.nan, 0.0, np.inf, -2.0]])
    y = np.concatenate([rng.uniform(0.5, 4.0, 500), [1.2, np.nan, 2.0, 1.0]])
    c, r = np.clip((x - -2.0) / 0.3, 0.0, 8.0), np.clip((y - 1.0) / 0.3, 0.0, 6.0)
    c0 = np.minimum(np.nan_to_num(c).astype(int), 7)
    r0 = np.minimum(np.nan_to_num(r).astype(int), 5)
    lower = data[r0, c0] + (data[r0, c0 + 1] - data[r0, c0]) * (c - c0)
    upper = data[r0 + 1, c0] + (data[r0 + 1, c0 + 1] - data[r0 + 1, c0]) * (c - c0)
    np.testing.assert_array_equal(layer.sample(x, y), lower + (upper - lower) * (r - r0))
    assert layer.sample(x.reshape(4, -1), y.reshape(4, -1)).shape == (4, 126)
    assert float(layer.sample(np.float64(-2.0), np.float64(1.0))) == data[0, 0]


def test_a_disk_that_fills_up_leaves_the_terrain_that_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "site"
    write_terrain(generate_terrain(1, 16.0, inner_m=16.0), folder)
    before = {file.name: file.read_bytes() for file in folder.iterdir()}

    def full(*_given: object) -> str:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(load, "rocks_text", full)
    with pytest.raises(OSError, match="No space left") as told:
        write_terrain(generate_terrain(2, 16.0, inner_m=16.0), folder)
    assert told.value.filename == str(folder)
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before


def test_parts_of_a_landscape_that_are_kept_are_those_of_the_raster_that_is_asked() -> None:
    recipe = Recipe(seed=3, size_m=32.0, inner_m=16.0)
    site, coarse, fine = Landscape(recipe), np.arange(-8.0, 8.0, 0.5), np.arange(-8.0, 8.0, 0.25)
    for axis in (coarse, fine, fine, coarse):
        new = Landscape(recipe)
        assert np.array_equal(site.ground(axis, axis), new.ground(axis, axis))
        assert all(map(np.array_equal, site.cracks(axis, axis), new.cracks(axis, axis)))
        assert np.array_equal(site.outcrop_mask(axis, axis[::2]), new.outcrop_mask(axis, axis[::2]))
