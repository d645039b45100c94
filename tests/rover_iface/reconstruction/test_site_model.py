"""Terrain from pictures against what is known otherwise: rendered sites, structured light, labels."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mission.codec import Codec
from rover_iface.cameras.calibrated import CALIBRATIONS, PARAMETERS, CalibratedCamera, CalibratedPair
from rover_iface.cameras.model import pinhole
from rover_iface.cameras.panorama import load_panorama
from rover_iface.frames import Transform
from rover_iface.reconstruction.described_pairs import PAIRS
from rover_iface.reconstruction.frames_of_labels import frame_of_product
from rover_iface.reconstruction.pair_surface import SurfaceOptions, pair_surface
from rover_iface.reconstruction.picture_pairs import pair_of
from rover_iface.reconstruction.row_check import check_rows
from rover_iface.reconstruction.site_model import SiteModel, SiteOptions, reconstruct
from rover_iface.terrain import load_terrain, write_terrain
from rover_iface.terrain.load import TERRAINS
from tests.rover_iface.reconstruction.products import devon_folder, rendered, rendered_folder, site
from tests.shared import ROOT, shared


@pytest.fixture(scope="module")
def rendered_site(tmp_path_factory: pytest.TempPathFactory) -> SiteModel:
    folder = rendered_folder(tmp_path_factory.mktemp("rendered"))
    return reconstruct(folder, SiteOptions(spacing_m=0.05))


def test_labelled_pairs_of_a_tilted_rover_give_the_ground_where_it_is(rendered_site: SiteModel) -> None:
    assert len(rendered_site.surfaces) == 2
    assert not rendered_site.refused
    layer = rendered_site.terrain.layers[0]
    rows, columns = np.nonzero(np.isfinite(layer.heights))
    x, y = layer.west + columns * layer.spacing, layer.south + rows * layer.spacing
    base = rendered()[0][0].z
    off = layer.heights[rows, columns] + base - site().height(x, y)
    assert layer.sigma is not None
    times = np.abs(off) / layer.sigma[rows, columns]
    assert len(off) > 20_000
    assert abs(float(np.median(off))) < 0.01
    # stones that the terrain does not list stand up to 9 cm over it; they are the tail
    assert float(np.mean(times < 1.0)) > 0.68
    assert float(np.mean(times < 2.0)) > 0.93
    assert float(np.mean(times < 3.0)) > 0.96
    assert rendered_site.terrain.start_heading_rad == pytest.approx(0.7, abs=1e-6)


def test_what_a_rock_hides_stays_a_hole(rendered_site: SiteModel) -> None:
    terrain = rendered_site.terrain
    eye = rendered_site.surfaces[0].pair.left_camera.C
    base = rendered()[0][0].z
    for rock in site().rocks:
        away = math.hypot(rock.x, rock.y)
        if not (rock.height > 0.25 and 3.0 < away < 7.0):
            continue
        behind = np.array([rock.x, rock.y]) * (1.0 + (rock.diameter / 2 + 0.2) / away)
        target = np.array([*behind, float(site().height(*behind))])
        start = np.array([*eye[:2], eye[2] + base])
        if not bool(site().line_of_sight(start, target, end_gap_m=0.02)):
            assert np.isnan(terrain.height(*behind)), f"height behind {rock.id} at {behind}"


def test_an_ortho_image_is_black_exactly_where_nothing_was_seen(rendered_site: SiteModel) -> None:
    terrain = rendered_site.terrain
    ortho, layer = terrain.orthos[0].rgb, terrain.layers[0]
    assert ortho.shape[:2] == tuple(2 * n for n in layer.heights.shape)
    unseen = np.repeat(np.repeat(np.isnan(layer.heights)[::-1], 2, axis=0), 2, axis=1)
    assert not ortho[unseen].any()
    assert float((ortho[~unseen].max(axis=1) > 0).mean()) > 0.9


def test_a_terrain_folder_keeps_holes_uncertainty_and_pictures(
    rendered_site: SiteModel, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    rendered_site.panorama.save(out)
    write_terrain(rendered_site.terrain_in(out), out)
    again = load_terrain(write_terrain(load_terrain(out), tmp_path / "copy"))
    made, kept = rendered_site.terrain.layers[0], again.layers[0]
    assert np.array_equal(np.isnan(made.heights), np.isnan(kept.heights))
    assert made.sigma is not None
    assert kept.sigma is not None
    assert np.allclose(made.sigma, kept.sigma, atol=6e-4, equal_nan=True)
    assert len(load_panorama(tmp_path / "copy").wedges) == 2


def test_a_target_picked_in_the_pictures_lies_on_the_ground(rendered_site: SiteModel) -> None:
    base = rendered()[0][0].z
    for wedge in rendered_site.panorama.wedges:
        match = wedge.pick((256.0, 330.0))
        x, y, z = match.point
        assert abs(float(site().height(x, y)) - base - z) < 0.06


def test_ground_round_the_rover_is_filled_only_when_asked(tmp_path: Path) -> None:
    folder = rendered_folder(tmp_path / "in", pairs=1)
    plain = reconstruct(folder)
    assert np.isnan(plain.terrain.height(0.0, 0.0))
    assert plain.assumed_posts == 0
    filled = reconstruct(folder, SiteOptions(under_rover_m=2.0))
    terrain = filled.terrain
    assert filled.assumed_posts > 1000
    assert abs(float(terrain.height(0.0, 0.0))) < 1e-6
    assert not bool(terrain.observed(0.0, 0.0))
    truth = site().height(0.8, 0.8) - rendered()[0][0].z
    assert abs(float(terrain.height(0.8, 0.8)) - float(truth)) < 3 * float(terrain.sigma(0.8, 0.8))
    # what was seen is left as it was seen
    before, after = plain.terrain.layers[0], filled.terrain.layers[0]
    row, column = (
        round((a - b) / before.spacing)
        for a, b in zip((before.south, before.west), (after.south, after.west), strict=True)
    )
    rows, columns = before.heights.shape
    same = after.heights[row : row + rows, column : column + columns]
    seen = np.isfinite(before.heights)
    assert np.array_equal(same[seen], before.heights[seen])


@pytest.mark.parametrize(
    "product",
    [
        "mer/2n292280938effb100p0703l0m1.img.gz",
        "mer/1n579700548ffld2fcp1981l0m1.img.gz",
        "msl/NRB_701384494RAD_F0933408NCAM00200M1.LBL",
    ],
)
def test_the_pose_of_a_flight_label_takes_its_rover_pointing_to_its_site_pointing(product: str) -> None:
    from rover_iface.cameras.labels import read_product
    from rover_iface.frames import FRD_FROM_FLU, NED_FROM_ENU

    path = shared(f"data/imagery/{product}")
    frame = frame_of_product(path)
    label = read_product(path).label
    rays = []
    for group in ("ROVER_DERIVED_GEOMETRY_PARMS", "SITE_DERIVED_GEOMETRY_PARMS"):
        azimuth, elevation = (math.radians(label[group][f"INSTRUMENT_{a}"]) for a in ("AZIMUTH", "ELEVATION"))
        level = math.cos(elevation)
        rays.append((level * math.cos(azimuth), level * math.sin(azimuth), -math.sin(elevation)))
    there = frame.site_from_rover.rotate(FRD_FROM_FLU @ rays[0])
    assert np.degrees(np.arccos(np.clip(there @ (NED_FROM_ENU @ rays[1]), -1, 1))) < 0.15


def test_disparities_are_as_good_as_they_say_where_structured_light_knows_them() -> None:
    folder = shared("data/imagery/opencv")
    pictures = [np.asarray(Image.open(folder / f"aloe{side}.jpg").convert("RGB")) for side in "LR"]
    truth = np.asarray(Image.open(folder / "aloeGT.png")).astype(np.float64)
    rows, columns = truth.shape
    cameras = [
        pinhole(
            focal_px=3740.0, width=columns, height=rows, center=(x, 0, 5), forward=(0, 0, -1), up=(0, 1, 0)
        )
        for x in (0.0, 0.16)
    ]
    pair = pair_of("aloe", (pictures[0], pictures[1]), (cameras[0], cameras[1]), Transform.identity())
    check = check_rows(pair)
    surface = pair_surface(pair, check, SurfaceOptions())
    known = np.isfinite(surface.disparities)
    samples, lines = np.round(cameras[0].project(surface.points[known])).astype(int).T
    there = truth[lines, samples]
    off = np.abs(surface.disparities[known] - there)[there > 0] / math.hypot(
        surface.disparity_px, surface.row_px
    )
    assert known.sum() > 0.75 * truth.size
    assert 0.6 < float(np.mean(off < 1.0)) < 0.85
    assert float(np.mean(off < 2.0)) > 0.9


def test_a_real_pair_keeps_its_rows_and_ranges_most_of_the_ground(tmp_path: Path) -> None:
    made = reconstruct(devon_folder(shared("data/imagery"), tmp_path, 1))
    check = made.surfaces[0].check
    assert check.matches > 1500
    assert check.apart_px < 0.7
    assert made.surfaces[0].matched > 0.6
    layer = made.terrain.layers[0]
    assert float(np.isfinite(layer.heights).sum()) * layer.spacing**2 > 120.0
    # the plain before the camera: smooth to centimetres
    assert float(made.terrain.roughness(5.0, 3.0)) < 0.03


@pytest.mark.parametrize(
    ("codec", "name"),
    [(TERRAINS, "terrain-1"), (PAIRS, "image-pairs-1"), (CALIBRATIONS, "stereo-calibration-1")],
)
def test_the_published_schema_is_that_of_the_code(codec: Codec[Any], name: str) -> None:
    published = json.loads((ROOT / f"docs/formats/{name}.schema.json").read_text(encoding="utf-8"))
    assert published == json.loads(json.dumps(codec.schema()))


def test_the_error_of_a_calibration_is_carried_into_heights(tmp_path: Path) -> None:
    folder = devon_folder(shared("data/imagery"), tmp_path, 1)
    text = (folder / "pairs.toml").read_text()
    start, end = text.index("[rig.pinhole]"), text.index("[[pairs]]")
    (folder / "pairs.toml").write_text(text[:start] + '[rig]\ncalibration = "stereo.json"\n' + text[end:])
    focal, principal = (968.999694824, 968.999694824), (635.139038086, 463.537109375)
    baseline, sigma = 0.239977002, 0.004
    covariance = np.zeros((len(PARAMETERS), len(PARAMETERS)))
    covariance[PARAMETERS.index("shift.x"), PARAMETERS.index("shift.x")] = sigma**2
    pair = CalibratedPair(
        CalibratedCamera(1280, 960, focal, principal),
        CalibratedCamera(1280, 960, focal, principal, center_m=(baseline, 0.0, 0.0)),
        tuple(tuple(float(v) for v in row) for row in covariance),
    )
    (folder / "stereo.json").write_text(CALIBRATIONS.write(pair))
    surface = reconstruct(folder).surfaces[0]
    plain = reconstruct(devon_folder(shared("data/imagery"), tmp_path / "plain", 1)).surfaces[0]
    places = surface.points[np.isfinite(surface.disparities)][::5000]
    flat = np.zeros((len(places), 2))
    more = surface.height_variance(places, flat) - plain.height_variance(places, flat)
    # a baseline that is longer by a share makes all ranges longer by that share
    told = ((places[:, 2] - surface.eye.C[2]) * sigma / baseline) ** 2
    assert np.median(np.abs(more / told - 1.0)) < 0.03
