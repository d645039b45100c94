"""Turn and shift of an odometry frame from fixes some of which are wrong, against the simulated truth."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from rover_iface.errors import LocalizationError
from rover_iface.localization.fix_alignment import FixAlignment, align_fixes

Floats = NDArray[np.float64]


def covariance(rng: np.random.Generator, sigma: float) -> Floats:
    """Return a full random covariance (3, 3) of about this standard deviation."""
    a, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.asarray(a @ np.diag((sigma * rng.uniform(0.5, 2.0, 3)) ** 2) @ a.T)


def day(
    rng: np.random.Generator, fixes: int, wrong: int, away: Floats | float = 0.0
) -> tuple[FixAlignment, Floats, set[int]]:
    """Return the answer for a simulated way, the truth (east, north, up, yaw), and the fixes made wrong."""
    yaw, shift = rng.uniform(-math.pi, math.pi), rng.normal(0, 300, 3)
    poses = np.cumsum(rng.normal(0, 12, (fixes, 3)) * [1, 1, 0.1], axis=0) + away
    turn = np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
    spread = np.array([covariance(rng, rng.uniform(0.3, 1.5)) for _ in range(fixes)])
    odometry = np.array([covariance(rng, 0.2) for _ in range(fixes)])
    seen = poses @ turn.T + shift + [rng.multivariate_normal(np.zeros(3), c) for c in spread]
    told = poses + [rng.multivariate_normal(np.zeros(3), c) for c in odometry]
    bad = set(map(int, rng.choice(fixes, wrong, replace=False)))
    for k in bad:
        seen[k] += rng.choice([-1, 1], 3) * rng.uniform(25, 400, 3)
    return align_fixes(seen, spread, told, odometry), np.array([*shift, yaw]), bad


def test_the_covariance_is_as_large_as_the_error_and_every_outlier_is_named() -> None:
    entropy = int(np.random.SeedSequence().entropy) % 2**63  # type: ignore[call-overload]
    print(f"seed {entropy}")
    rng = np.random.default_rng(entropy)
    trials, nees, false, good = 150, 0.0, 0, 0
    for _ in range(trials):
        fixes = int(rng.integers(10, 25))
        found, truth, bad = day(rng, fixes, int(0.3 * fixes))
        error = np.array([*(found.shift_m - truth[:3]), math.remainder(found.yaw_rad - truth[3], math.tau)])
        nees += float(error @ np.linalg.solve(found.covariance, error))
        left_out = set(map(int, np.flatnonzero(~found.agrees)))
        assert bad <= left_out
        false += len(left_out - bad)
        good += fixes - len(bad)
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 4 * trials) / trials
    print(f"NEES {nees / trials:.2f} in {low:.2f} to {high:.2f}; good fixes left out: {false} of {good}")
    assert low <= nees / trials <= high
    assert false <= 0.01 * good


def test_an_exact_way_is_found_exactly_and_its_outlier_by_number() -> None:
    poses = np.array([[0.0, 0, 0], [10, 0, 1], [10, 8, 2], [-3, 5, 1], [4, 4, 0]])
    fixes = np.stack([-poses[:, 1], poses[:, 0], poses[:, 2]], axis=1) + np.array([100.0, -50.0, 7.0])
    fixes[3] += [5.0, 0.0, 0.0]
    found = align_fixes(fixes, np.tile(np.eye(3) * 0.01, (5, 1, 1)), poses)
    assert found.yaw_rad == pytest.approx(math.pi / 2)
    assert found.shift_m == pytest.approx([100.0, -50.0, 7.0])
    assert list(found.agrees) == [True, True, True, False, True]
    assert found.residuals_m[3] == pytest.approx([5.0, 0.0, 0.0])
    assert found.distances[3] == pytest.approx(50.0)
    assert found.apply(poses)[0] == pytest.approx([100.0, -50.0, 7.0])


def test_fixes_without_heights_leave_the_height_open() -> None:
    rng = np.random.default_rng(4)
    poses = rng.normal(0, 20, (6, 3))
    fixes = poses + np.array([3.0, 4.0, np.nan])
    found = align_fixes(fixes, np.tile(np.diag([0.04, 0.04, np.nan]), (6, 1, 1)), poses)
    assert found.shift_m[:2] == pytest.approx([3.0, 4.0])
    assert math.isnan(found.shift_m[2])
    assert math.isnan(found.covariance[2, 2])
    assert np.isfinite(found.covariance[np.ix_([0, 1, 3], [0, 1, 3])]).all()


def test_what_cannot_be_aligned_is_refused_with_the_figure() -> None:
    rng = np.random.default_rng(5)
    spread = np.tile(np.eye(3) * 0.01, (6, 1, 1))
    poses = rng.normal(0, 20, (6, 3))
    with pytest.raises(LocalizationError, match="2 fixes"):
        align_fixes(poses[:2], spread[:2], poses[:2])
    with pytest.raises(LocalizationError, match=r"only \d of 6 fixes agree"):
        align_fixes(rng.normal(0, 500, (6, 3)), spread, poses)
    near = rng.normal(0, 0.01, (6, 3))
    with pytest.raises(LocalizationError, match="too close together"):
        align_fixes(near + rng.normal(0, 0.05, (6, 3)), spread, near)
    with pytest.raises(LocalizationError, match="covariance of fix 2"):
        align_fixes(poses, spread * np.array([1, -1, 1, 1, 1, 1])[:, None, None], poses)


def test_far_from_the_origin_the_covariance_still_tells_the_error() -> None:
    rng, middle = np.random.default_rng(6), np.array([5e5, 4e6, 0.0])
    trials, nees = 60, 0.0
    for _ in range(trials):
        found, truth, _ = day(rng, 12, 2, middle)
        c, s = math.cos(truth[3]), math.sin(truth[3])
        where = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ middle + truth[:3]
        turned = math.remainder(found.yaw_rad - truth[3], math.tau)
        error = np.array([*(found.apply(middle[None])[0] - where), turned])  # at the way, where it is linear
        arm = found.apply(middle[None])[0] - found.shift_m
        back = np.eye(4)
        back[0, 3], back[1, 3] = -arm[1], arm[0]
        nees += float(error @ np.linalg.solve(back @ found.covariance @ back.T, error))
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 4 * trials) / trials
    assert low <= nees / trials <= high


@pytest.mark.parametrize("at", [(0.0, 0.0), (3.0, 4.0), (100.0, 50.0), (5e5, 4e6)])
def test_poses_in_one_place_tell_no_turn_wherever_it_is(at: tuple[float, float]) -> None:
    poses = np.tile([*at, 0.0], (6, 1))
    fixes = np.random.default_rng(7).normal(0, 0.1, (6, 3))
    with pytest.raises(LocalizationError, match="too close together"):
        align_fixes(fixes, np.tile(np.eye(3) * 0.01, (6, 1, 1)), poses)


def test_many_fixes_are_sampled_and_too_many_refused() -> None:
    rng = np.random.default_rng(8)
    poses = rng.normal(0, 50, (2000, 3))
    fixes = poses + np.array([10.0, 20.0, 0.0]) + rng.normal(0, 0.1, (2000, 3))
    found = align_fixes(fixes, np.tile(np.eye(3) * 0.01, (2000, 1, 1)), poses)
    assert found.shift_m == pytest.approx([10.0, 20.0, 0.0], abs=0.03)
    with pytest.raises(LocalizationError, match="20001 fixes with a pose; at most 20000"):
        align_fixes(np.zeros((20_001, 3)), np.tile(np.eye(3), (20_001, 1, 1)), np.zeros((20_001, 3)))
