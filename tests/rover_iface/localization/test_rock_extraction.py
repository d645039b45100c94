"""Rock extraction from clouds: half rounds on a plane seen at a slant, rises, what cannot be used."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rover_iface.errors import LocalizationError
from rover_iface.localization.ground_points import CELL_RAD, GroundPoints, direction_raster, read_points
from rover_iface.localization.rock_extraction import ExtractionOptions, extract_rocks, settled_depth

EYE = np.array([0.0, 0.0, 1.5])
FACTOR = 235.4


def seen_field(rocks, *, rises=(), noise_px=0.0, seed=0):
    """Points seen from 1.5 m over level ground with half rounds (x, y, radius, height) and smooth rises."""
    azimuth = np.arange(-0.6, 0.6, CELL_RAD)
    elevation = np.arange(-0.02, -0.32, -CELL_RAD)
    a, e = np.meshgrid(azimuth, elevation)
    rays = np.stack((np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)), axis=-1).reshape(-1, 3)
    best = -EYE[2] / rays[:, 2]
    for x, y, radius, height in rocks:
        # a half ellipsoid: scale it to a unit ball
        scale = np.array([1 / radius, 1 / radius, 1 / height])
        o, d = (EYE - np.array([x, y, 0.0])) * scale, rays * scale
        b, c, dd = (d * o).sum(axis=1), (o * o).sum() - 1.0, (d * d).sum(axis=1)
        root = b * b - dd * c
        hit = (-b - np.sqrt(np.maximum(root, 0.0))) / dd
        best = np.where((root > 0) & (hit > 0) & (hit < best), hit, best)
    for x, y, radius, height in rises:
        t = best.copy()
        for _ in range(60):  # march back towards the eye until above the rise
            p = EYE + rays * t[:, None]
            bump = height * np.exp(-((p[:, 0] - x) ** 2 + (p[:, 1] - y) ** 2) / radius**2)
            t = np.where(p[:, 2] < bump - 1e-3, t * 0.995, t)
        best = t
    rng = np.random.default_rng(seed)
    seen = FACTOR / best + noise_px * rng.normal(size=len(best))
    keep = (best < 40.0) & (seen > 5.0)
    return GroundPoints(EYE + rays[keep] * (FACTOR / seen[keep])[:, None], EYE, FACTOR)


ROCKS = [(6.0, -1.0, 0.3, 0.25), (9.0, 1.5, 0.35, 0.3), (13.0, -2.5, 0.4, 0.35), (16.0, 2.0, 0.45, 0.4)]


@pytest.mark.parametrize("noise_px", [0.0, 0.15])
def test_rocks_are_found_where_they_are_with_their_size(noise_px):
    found = extract_rocks(seen_field(ROCKS, noise_px=noise_px))
    assert len(found) == len(ROCKS)
    for rock, (x, y, radius, height) in zip(found, ROCKS, strict=True):
        assert rock.position[:2] == pytest.approx((x, y), abs=0.35)
        assert rock.height_m == pytest.approx(height, rel=0.25)
        assert rock.width_m == pytest.approx(2 * radius, rel=0.3)
        assert rock.model is not None
        assert rock.radius_m == pytest.approx(radius, rel=0.3)
        assert rock.model.height_m == pytest.approx(height, rel=0.25)
        off = rock.position - np.array([x, y, 0.0])
        assert off @ np.linalg.solve(rock.covariance, off) < 16.0


def test_a_smooth_rise_of_the_ground_is_no_rock():
    assert extract_rocks(seen_field([], rises=[(10.0, 0.0, 1.5, 0.35)])) == []


def test_bare_ground_has_no_rocks():
    assert extract_rocks(seen_field([], noise_px=0.2)) == []


def test_two_rocks_side_by_side_are_two():
    found = extract_rocks(seen_field([(8.0, -0.45, 0.3, 0.3), (8.0, 0.45, 0.3, 0.3)]))
    assert len(found) == 2


def test_a_small_rock_is_left_out_by_the_least_height():
    field = seen_field([(7.0, 0.0, 0.3, 0.2)])
    assert len(extract_rocks(field)) == 1
    assert extract_rocks(field, ExtractionOptions(least_height_m=0.3)) == []


def test_rocks_beyond_reach_are_left_out():
    field = seen_field([(16.0, 0.0, 0.45, 0.4)])
    assert extract_rocks(field, ExtractionOptions(farthest_m=14.0)) == []


def test_depth_of_a_far_rock_is_that_of_its_width():
    rng = np.random.default_rng(0)
    across, up = rng.uniform(-0.3, 0.3, 60), rng.uniform(0.02, 0.3, 60)
    front = -0.3 * np.sqrt(np.clip(1 - (across / 0.3) ** 2 - (up / 0.3) ** 2, 0, None))
    noisy = np.column_stack((front + rng.normal(0, 0.5, 60), across, up))
    depth, axis = settled_depth(noisy, 0.3, 0.5)
    assert np.std((depth - axis) - front) < 0.12
    near, axis = settled_depth(np.column_stack((front, across, up)), 0.3, 0.001)
    assert near - axis == pytest.approx(front, abs=0.05)


def test_the_seam_of_a_full_circle_lies_in_its_widest_gap():
    angle = np.radians(np.concatenate((np.arange(-150, 150, 0.5),)))
    points = np.column_stack((5 * np.cos(angle), 5 * np.sin(angle), np.zeros(len(angle))))
    raster = direction_raster(GroundPoints(points, EYE), step=0.02)
    assert raster.left == pytest.approx(math.radians(-150), abs=0.02)
    assert np.isfinite(raster.inverse).sum() >= 250
    again = raster.points()[np.isfinite(raster.inverse)]
    assert np.hypot(again[:, 0], again[:, 1]) == pytest.approx(5.0, abs=0.1)


@pytest.mark.parametrize("suffix", ["csv", "txt", "npz", "ply"])
def test_points_come_from_files(tmp_path, suffix):
    points = seen_field(ROCKS[:1]).points[:400]
    path = tmp_path / f"cloud.{suffix}"
    if suffix == "npz":
        np.savez(path, points=points, eye=EYE)
    elif suffix == "ply":
        lines = [f"{x} {y} {z}" for x, y, z in points]
        head = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
        head += ["property float x", "property float y", "property float z", "end_header"]
        path.write_text("\n".join(head + lines) + "\n")
    else:
        separator = "," if suffix == "csv" else " "
        text = "\n".join(separator.join(map(repr, map(float, p))) for p in points)
        path.write_text(("x,y,z\n" if suffix == "csv" else "") + text)
    seen = read_points(path, EYE)
    assert seen.points == pytest.approx(points, abs=1e-4)
    assert seen.eye == pytest.approx(EYE)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("cloud.las", "", "is not a point file"),
        ("cloud.csv", "x,y\n1,2\n", "cannot be read|are \\[n, 3\\]"),
        ("cloud.csv", "x,y,z\n1,2,3\n", "1 points were seen; at least 200"),
        ("cloud.csv", "x,y,z\nhere,2,3\n", "cannot be read"),
        ("cloud.npz", "no archive", "cannot be read"),
    ],
)
def test_a_file_without_points_is_refused_with_its_name(tmp_path, name, text, message):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(LocalizationError, match=message):
        read_points(path)


def test_points_that_are_no_points_are_refused():
    with pytest.raises(LocalizationError, match="not finite"):
        GroundPoints(np.full((300, 3), np.nan), EYE)
    with pytest.raises(LocalizationError, match="must be positive"):
        GroundPoints(np.ones((300, 3)), EYE, 0.0)
    with pytest.raises(LocalizationError, match="lie within"):
        extract_rocks(GroundPoints(np.full((300, 3), 900.0), EYE))
    with pytest.raises(LocalizationError, match="at least 8 cells"):
        ExtractionOptions(least_cells=3)
