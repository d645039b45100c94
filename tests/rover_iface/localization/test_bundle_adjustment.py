"""Bundle adjustment: true poses come back, covariances hold, step by step gives the same as at once."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.errors import LocalizationError
from rover_iface.frames import Transform, rotation_rpy
from rover_iface.localization.bundle_adjustment import (
    BundleAdjustment,
    StereoRig,
    adjoint,
    chained,
    small_motion,
)
from studies.common.localization_drive import speed

TIGHT = 1e-8 * np.eye(6)
MOTION = np.diag([0.01, 0.01, 0.02, 0.3, 0.3, 0.1]) ** 2


def mer_rig() -> StereoRig:
    rig = CameraRig(load_cameras("mer"), (0.3, 0.0, 1.35))
    return StereoRig.of(rig.camera("navcam_left", 0.0, -0.3), rig.camera("navcam_right", 0.0, -0.3))


def drive(seed: int, *, poses: int = 5, stepwise: bool = False):
    """A drive over ground points seen by CAHVOR navcams, odometry off by what its covariance says."""
    rng = np.random.default_rng(seed)
    rig = mer_rig()
    ground = np.column_stack((rng.uniform(3, 14, 90), rng.uniform(-5, 5, 90), rng.uniform(-0.1, 0.3, 90)))
    true = [Transform(rotation_rpy(0, 0, 0.02 * k), (0.8 * k, 0.02 * k, 0.0)) for k in range(poses)]
    adjustment, guess, solution, known = BundleAdjustment(huber=None), Transform.identity(), None, set()
    for k, pose in enumerate(true):
        if k == 0:
            adjustment.add_pose(0, pose, covariance=TIGHT)
        else:
            off = np.linalg.cholesky(MOTION) @ rng.normal(size=6)
            step = true[k - 1].inverse() * pose * Transform(rotation_rpy(*off[:3]), off[3:])
            guess = guess * step
            adjustment.add_pose(k, guess)
            adjustment.add_motion(k - 1, k, step, MOTION)
        local = pose.inverse().apply(ground)
        left, right = rig.left.project(local), rig.right.project(local)
        for j in np.flatnonzero(rig.left.sees(local, 5) & rig.right.sees(local, 5)).tolist():
            noise = rng.normal(0, 0.4, 4)
            if j not in known:
                known.add(j)
                adjustment.add_point(j, ground[j] + rng.normal(0, 0.2, 3))
            measured = rig.measured(left[j] + noise[:2], right[j] + noise[2:])[0]
            adjustment.add_stereo(k, j, rig, measured, sigma_px=0.4)
        if stepwise:
            solution = adjustment.update()
    return true, solution if solution is not None else adjustment.solve()


def test_linearised_cahvor_cameras_measure_what_the_real_ones_see():
    rig = mer_rig()
    points = np.array([[5.0, 0.4, 0.2], [9.0, -1.5, 0.0], [14.0, 2.0, 0.4]])
    measured = rig.measured(rig.left.project(points), rig.right.project(points))
    local = rig.rover_from_camera.inverse().apply(points)
    u = rig.focal_px * local[:, 0] / local[:, 2] + rig.centre_px[0]
    v = rig.focal_px * local[:, 1] / local[:, 2] + rig.centre_px[1]
    disparity = rig.focal_px * rig.base_m / local[:, 2]
    assert measured == pytest.approx(np.column_stack((u, u - disparity, v)), abs=0.01)


def test_poses_come_back_within_their_covariance():
    nees, errors = [], []
    for seed in range(6):
        true, solution = drive(seed)
        assert solution.chi2 / solution.freedom == pytest.approx(1.0, abs=0.25)
        for k in range(1, len(true)):
            off = small_motion(solution.poses[k].site_from_rover, true[k])
            errors.append(float(np.linalg.norm(off[3:])))
            nees.append(float(off @ np.linalg.solve(solution.poses[k].covariance, off)))
    assert np.median(errors) < 0.02
    assert 3.5 < np.mean(nees) < 9.5  # 6 expected of a 6-vector


def test_adjusting_stop_by_stop_gives_what_adjusting_at_once_gives():
    _, at_once = drive(3)
    _, stepwise = drive(3, stepwise=True)
    for key, pose in at_once.poses.items():
        assert np.abs(small_motion(pose.site_from_rover, stepwise.poses[key].site_from_rover)).max() < 2e-3
        assert stepwise.poses[key].covariance == pytest.approx(pose.covariance, rel=0.1, abs=1e-7)


def two_sites(*, rocks: bool, sun: bool = False):
    """Two sites 26 m apart whose odometry is 1.5 m off, and ten rocks between them."""
    rng = np.random.default_rng(0)
    true = Transform(rotation_rpy(0, 0, 0.1), (26.0, 1.0, 0.2))
    claimed = Transform(rotation_rpy(0, 0, 0.14), (27.2, 0.1, 0.2))
    adjustment = BundleAdjustment()
    adjustment.add_pose("a", Transform.identity(), covariance=TIGHT)
    adjustment.add_pose("b", claimed)
    adjustment.add_motion("a", "b", claimed, np.diag([0.01, 0.01, 0.05, 1.3, 1.3, 0.5]) ** 2)
    if sun:
        adjustment.add_attitude("b", Transform(rotation_rpy(0, 0, 0.1), np.zeros(3)), (0.005, 0.005, 0.01))
    for k in range(10 if rocks else 0):
        place = np.array([rng.uniform(6, 20), rng.uniform(-8, 8), -1.4])
        adjustment.add_point(k, place + rng.normal(0, 0.5, 3))
        for name, pose in (("a", Transform.identity()), ("b", true)):
            local = pose.inverse().apply(place)
            sight = local / np.linalg.norm(local)
            spread = 0.05**2 * np.eye(3) + 0.2**2 * np.outer(sight, sight)
            adjustment.add_rock(name, k, local + np.linalg.cholesky(spread) @ rng.normal(size=3), spread)
    return true, adjustment.solve()


def test_rocks_seen_from_both_sites_take_out_the_error_of_odometry():
    true, without = two_sites(rocks=False)
    _, tied = two_sites(rocks=True)
    before = np.linalg.norm(without.poses["b"].site_from_rover.translation - true.translation)
    after = np.linalg.norm(tied.poses["b"].site_from_rover.translation - true.translation)
    assert before > 1.2
    assert after < 0.25
    covariance = tied.poses["b"].covariance
    off = small_motion(tied.poses["b"].site_from_rover, true)
    assert off @ np.linalg.solve(covariance, off) < 20.0
    assert np.trace(tied.poses["b"].position_covariance) < 0.1 * np.trace(
        without.poses["b"].position_covariance
    )


def test_a_sun_sighting_takes_out_the_error_of_heading():
    true, without = two_sites(rocks=False)
    _, sighted = two_sites(rocks=False, sun=True)
    turn = [small_motion(s.poses["b"].site_from_rover, true)[2] for s in (without, sighted)]
    assert abs(turn[0]) > 0.03
    assert abs(turn[1]) < 0.005
    assert sighted.poses["b"].covariance[2, 2] < without.poses["b"].covariance[2, 2]


def test_covariances_of_steps_chain():
    rng = np.random.default_rng(4)
    step, spread = (
        Transform(rotation_rpy(0.02, -0.01, 0.3), (1.0, 0.1, 0.0)),
        np.diag([0.01, 0.01, 0.02, 0.03, 0.02, 0.01]) ** 2,
    )
    total, covariance = chained([(step, spread)] * 4)
    draws = []
    for _ in range(1500):
        walked = Transform.identity()
        for _ in range(4):
            off = np.sqrt(np.diag(spread)) * rng.normal(size=6)
            walked = walked * step * Transform(rotation_rpy(*off[:3]), off[3:])
        draws.append(small_motion(total, walked))
    assert np.cov(np.array(draws).T) == pytest.approx(covariance, abs=0.12 * float(np.abs(covariance).max()))
    assert adjoint(step) @ adjoint(step.inverse()) == pytest.approx(np.eye(6), abs=1e-12)


def test_a_hundred_poses_are_adjusted_to_the_noise():
    figures = speed(20, 400)
    assert figures["observations"] > 1500
    assert figures["chi2_per_freedom"] == pytest.approx(1.0, abs=0.1)


def test_what_cannot_be_adjusted_is_refused():
    rig = mer_rig()
    adjustment = BundleAdjustment()
    with pytest.raises(LocalizationError, match="without poses"):
        adjustment.solve()
    adjustment.add_pose(0, Transform.identity(), covariance=TIGHT)
    with pytest.raises(LocalizationError, match="there already"):
        adjustment.add_pose(0, Transform.identity())
    with pytest.raises(LocalizationError, match="pose 1 is unknown"):
        adjustment.add_motion(0, 1, Transform.identity(), TIGHT)
    with pytest.raises(LocalizationError, match="eigenvalue"):
        adjustment.add_pose(2, Transform.identity(), covariance=-np.eye(6))
    with pytest.raises(LocalizationError, match="6 x 6"):
        adjustment.add_pose(3, Transform.identity(), covariance=np.eye(3))
    with pytest.raises(LocalizationError, match="point 'p' is unknown"):
        adjustment.add_stereo(0, "p", rig, (500.0, 480.0, 400.0))
    adjustment.add_point("p", (5.0, 0.0, 0.0))
    with pytest.raises(LocalizationError, match="disparity -20"):
        adjustment.add_stereo(0, "p", rig, (480.0, 500.0, 400.0))
    with pytest.raises(LocalizationError, match="from the eye"):
        adjustment.add_rock(0, "p", (0.1, 0.0, 0.0), np.eye(3))
    with pytest.raises(LocalizationError, match="finite"):
        adjustment.add_point("q", (math.nan, 0.0, 0.0))
    with pytest.raises(LocalizationError, match="must be positive"):
        adjustment.add_attitude(0, Transform.identity(), (0.0, 1.0, 1.0))
    with pytest.raises(LocalizationError, match="point 'p' was never measured"):
        adjustment.solve()
    with pytest.raises(LocalizationError, match="Huber"):
        BundleAdjustment(huber=0.0)


def test_what_nothing_holds_is_refused():
    adjustment = BundleAdjustment()
    adjustment.add_pose(0, Transform.identity())
    adjustment.add_attitude(0, Transform.identity(), (0.01, 0.01, 0.01))
    with pytest.raises(LocalizationError, match="cannot be adjusted"):
        adjustment.solve()
