"""The safety check's kernels against the same figures made by numpy and scipy."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial import cKDTree

from rover_iface.placement import patch_kernels as kernels

Array = npt.NDArray[np.float64]

NORMAL = np.array([0.2, -0.3, 0.9]) / np.linalg.norm([0.2, -0.3, 0.9])


def patch(seed: int = 0, count: int = 900) -> Array:
    """Points of a rough disc of 5 cm radius across NORMAL, about (0.1, 0.2, 0.3)."""
    rng = np.random.default_rng(seed)
    first = np.cross(NORMAL, [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(NORMAL, first)
    u, v = rng.uniform(-0.05, 0.05, (2, count))
    h = rng.normal(0.0, 0.002, count)
    return np.asarray([0.1, 0.2, 0.3] + u[:, None] * first + v[:, None] * second + h[:, None] * NORMAL)


def test_the_ball_holds_what_is_near() -> None:
    points, at = patch(), np.array([0.11, 0.2, 0.3])
    expected = np.flatnonzero(np.linalg.norm(points - at, axis=1) < 0.03)
    assert 50 < len(expected) < len(points)
    assert kernels.in_ball(points, at, 0.03).tolist() == expected.tolist()


def test_the_plane_ignores_wrong_matches_and_faces_outward() -> None:
    points = patch()
    points[:40] += 0.08 * NORMAL
    middle, normal = kernels.fit_plane(points, np.ones(len(points)), NORMAL)
    assert np.degrees(np.arccos(normal @ NORMAL)) < 1.0
    assert abs((middle - [0.1, 0.2, 0.3]) @ NORMAL) < 0.001
    assert kernels.fit_plane(points, np.ones(len(points)), -NORMAL)[1] @ NORMAL < -0.99


def test_relief_is_that_of_numpy() -> None:
    points, at = patch(), np.array([0.1, 0.2, 0.3])
    across, height = kernels.across_and_height(points, at, NORMAL)
    away = points - at
    assert height == pytest.approx(away @ NORMAL)
    assert across == pytest.approx(np.linalg.norm(np.cross(away, NORMAL), axis=1))
    under, highest, deepest, rms = kernels.relief(across, height, 0.03, 0.004)
    expected = (across < 0.03) & (height < 0.004)
    assert (under == expected).all()
    assert highest == pytest.approx(np.quantile(height[expected], 0.98))
    assert deepest == pytest.approx(-np.quantile(height[expected], 0.005))
    assert rms == pytest.approx(np.sqrt(np.mean(height[expected] ** 2)))


def test_what_lies_behind_the_surface_is_covered_and_what_lies_beyond_its_rim_is_not() -> None:
    rng = np.random.default_rng(4)
    normal = np.array([-0.6, 0.0, 0.8])
    along, aside = np.array([0.8, 0.0, 0.6]), np.array([0.0, 1.0, 0.0])
    at = np.array([1.0, -0.3, 0.2])

    def face(low: float, high: float, deep: float) -> Array:
        u, v = rng.uniform(low, high, 4000), rng.uniform(-0.04, 0.04, 4000)
        return at + u[:, None] * along + v[:, None] * aside - deep * normal

    surface, behind, beyond = face(-0.04, 0.02, 0.0), face(-0.04, 0.01, 0.12), face(0.03, 0.04, 0.12)
    near = face(-0.04, 0.02, 0.02)
    points = np.vstack((surface, behind, beyond, near))
    every = np.ones(len(points), bool)
    found = kernels.covered(points, every, at, normal, 0.005, 0.03)
    assert not found[:4000].any()
    assert found[4000:8000].mean() > 0.99
    assert not found[8000:].any()
    assert not kernels.covered(points, ~every, at, normal, 0.005, 0.03).any()


def test_what_stands_in_the_way_is_seen_beside_and_above() -> None:
    points, at = patch(), np.array([0.1, 0.2, 0.3])
    across, height = kernels.across_and_height(points, at, NORMAL)
    rim = (across >= 0.03) & (across < 0.038)
    lowest = np.quantile(height[rim], 0.98)
    assert kernels.obstruction(across, height, 0.03, 0.008, 0.14, 8) == pytest.approx(lowest, abs=0.002)
    height[rim] += 0.05
    beside = kernels.obstruction(across, height, 0.03, 0.008, 0.14, 8)
    assert beside == pytest.approx(np.quantile(height[rim], 0.98), abs=0.002)
    height[rim] -= 0.05
    high = np.r_[height, np.full(9, 0.13)]
    wide = np.r_[across, np.full(9, 0.01)]
    assert kernels.obstruction(wide, high, 0.03, 0.008, 0.14, 8) == pytest.approx(0.13)
    assert kernels.obstruction(wide[:-1], high[:-1], 0.03, 0.008, 0.14, 8) < 0.02
    assert kernels.obstruction(wide, high, 0.03, 0.008, 0.12, 8) < 0.02


def test_gaps_are_those_of_a_search_tree() -> None:
    points, at = patch(count=300), np.array([0.1, 0.2, 0.3])
    points = points[np.linalg.norm(points - at - 0.012 * np.cross(NORMAL, [0.0, 0.0, 1.0]), axis=1) > 0.014]
    share, hole = kernels.disc_gaps(points, at, NORMAL, 0.03, 0.004)
    first = np.cross(NORMAL, [1.0, 0.0, 0.0])
    first /= np.linalg.norm(first)
    axes = np.vstack((first, np.cross(NORMAL, first)))
    line = np.arange(-12, 13) * 0.0025
    disc = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    disc = disc[np.linalg.norm(disc, axis=1) <= 0.03 + 1e-12]
    away = cKDTree((points - at) @ axes.T).query(disc)[0]
    assert share == pytest.approx((away <= 0.004).mean(), abs=0.01)
    assert hole == pytest.approx(2.0 * away.max(), rel=0.02)
    assert hole > 0.02


def test_middle_lever_is_the_smaller_spread_along_the_plane() -> None:
    points = patch()
    index = np.arange(0, len(points), 2)
    away = points[index] - (points[index] @ NORMAL)[:, None] * NORMAL
    expected = np.linalg.eigvalsh(np.cov(away.T))[1]
    assert kernels.middle_lever(points, index, NORMAL) == pytest.approx(expected)
