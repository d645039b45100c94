"""The feature tracker on rendered pairs."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_iface.errors import TrackerError
from rover_iface.frames import Pose, Transform
from rover_iface.simulator.render.picture import Frame
from rover_iface.vision.sift import SiftOptions, SiftTracker, _Anchored, horn
from rover_iface.vision.sift_features import detect, mutual
from rover_iface.vision.sift_motion import settle
from rover_iface.vision.tracker import StereoView, Tracker, TrackState
from tests.rover_iface.render.scenes import picture

HALF = 150


@lru_cache(maxsize=16)
def frames(x: float) -> tuple[Frame, Frame]:
    pose = Pose(x, 0.0, 0.0)
    left = picture(pose, half=HALF, seed=round(-x * 100))
    return left, picture(pose, "navcam_right", half=HALF, exposure=left.exposure, seed=round(-x * 100) + 1)


def view(x: float, error: Transform | None = None) -> StereoView:
    left, right = frames(x)
    cameras = [f.camera.transformed(error or Transform.identity()) for f in (left, right)]
    return StereoView(left.unit, right.unit, cameras[0], cameras[1])


def surface() -> np.ndarray:
    return np.asarray(frames(-6.0)[0].truth.point_site[HALF, HALF])


@pytest.mark.parametrize("method", ["shipped", "published"])
def test_targets_are_carried_with_a_pose_estimate_that_drifts(
    method: Literal["shipped", "published"],
) -> None:
    tracker: Tracker = SiftTracker(SiftOptions(method=method))
    points = {"A": surface(), "B": surface() + np.array([0.0, 0.05, -0.1])}
    first = view(-6.0)
    for name, point in points.items():
        tracker.start(name, point, first)
    error = Transform.identity()
    for x in (-5.4, -4.86, -4.37):
        error = Transform.from_rpy(0.0, 0.0, 0.004, (0.03, -0.04, 0.01)) * error
        now = view(x, error)
        for name, point in points.items():
            update = tracker.update(name, now)
            assert update.state is TrackState.TRACKED
            assert update.confidence > 0.9
            off = update.position - error.apply(point)
            assert np.linalg.norm(off) < 0.015
            assert off @ np.linalg.solve(update.covariance, off) < 16.0


def test_a_spot_that_was_ranged_badly_at_first_is_known_once_it_is_ranged_well() -> None:
    # its depth against its surroundings was taken to be as unsure for good: 4 cm across, at 2 m, and lost
    tracker = SiftTracker()
    tracker.start("A", surface(), view(-6.0))
    track = tracker._targets["A"]
    assert isinstance(track, _Anchored)
    track.anchor.key = replace(track.anchor.key, depth_m2=0.5**2)
    track.covariance = track.covariance + 0.5**2 * np.outer(track.anchor.normal, track.anchor.normal)
    for x in (-5.4, -4.86):
        update = tracker.update("A", view(x))
    assert update.confidence > 0.9
    assert math.sqrt(np.linalg.eigvalsh(update.covariance)[1]) < 0.01


def test_confidence_is_one_half_at_thirty_features() -> None:
    options = SiftOptions()
    values = [1 / (1 + math.exp(-options.slope * (n - options.half_count))) for n in (0, 30, 60)]
    assert values == pytest.approx([0.047, 0.5, 0.953], abs=0.001)  # the text of the paper, not its eq. 7


def test_without_matches_the_target_coasts_and_comes_back_or_fails() -> None:
    tracker = SiftTracker(SiftOptions(lost_updates=2))
    tracker.start("A", surface(), view(-6.0))
    now = view(-5.4)
    for state in (TrackState.LOST, TrackState.LOST):
        blank = replace(now, left=np.zeros_like(now.left))
        update = tracker.update("A", blank)
        assert update.state is state
        assert update.confidence < 0.1
        assert np.linalg.norm(update.position - surface()) < 0.06
        assert np.array_equal(update.position, tracker.predicted("A"))
    back = tracker.update("A", view(-4.86))
    assert back.state is TrackState.TRACKED
    assert np.linalg.norm(back.position - surface()) < 0.015
    for _ in range(3):
        update = tracker.update("A", replace(now, left=np.zeros_like(now.left)))
    assert update.state is TrackState.FAILED
    for x in (-4.37, -3.93, -3.54):
        # given up, it is believed ever less where it was
        later = tracker.update("A", view(x))
        assert later.state is TrackState.FAILED
        assert later.confidence < update.confidence
        assert np.trace(later.covariance) > np.trace(update.covariance)
        update = later


@given(
    angles=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
    shift=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    seed=st.integers(0, 1000),
)
@settings(max_examples=60, deadline=None)
def test_horn_gives_back_the_motion_of_exact_points(
    angles: tuple[float, float, float], shift: tuple[float, float, float], seed: int
) -> None:
    points = np.random.default_rng(seed).normal(size=(5, 3))
    motion = Transform.from_rpy(*angles, shift)
    found = horn(points, motion.apply(points))
    assert found is not None
    assert np.allclose(found.rotation, motion.rotation, atol=1e-8)
    assert np.allclose(found.translation, motion.translation, atol=1e-8)
    assert horn(np.outer(np.arange(4.0), [1, 2, 3]), np.outer(np.arange(4.0), [1, 2, 3])) is None


def test_a_designated_pixel_is_ranged_and_its_range_gets_sharper_on_the_way() -> None:
    tracker = SiftTracker()
    first = tracker.start("A", None, view(-6.0), pixel=(HALF, HALF))
    assert np.linalg.norm(first.position - surface()) < 0.06
    for x in (-5.4, -4.86, -4.37):
        update = tracker.update("A", view(x))
    assert np.linalg.norm(update.position - surface()) < 0.012
    assert np.trace(update.covariance) < 0.5 * np.trace(first.covariance)
    now = view(-3.93)
    assert tracker.update("A", now) is tracker.update("A", now)
    near = SiftTracker().start("B", None, view(-3.0), pixel=(HALF, HALF))
    assert np.linalg.norm(near.position - frames(-3.0)[0].truth.point_site[HALF, HALF]) < 0.02


def test_a_prediction_that_is_off_by_more_than_alignment_follows_is_no_measurement_of_itself() -> None:
    looks, at = SiftTracker().looks, view(-6.0)
    point, covariance, anchor = looks.begin("A", at, np.array([150.0, 150.0]), None)
    camera = at.left_camera
    away = float(np.linalg.norm(point - camera.C))
    off = point + 6.0 * away / camera.hs * camera.horizontal
    wide = covariance + (3.0 * away / camera.hs) ** 2 * np.eye(3)
    found, _ = looks.take(at, off, wide, anchor)
    assert np.abs(camera.project(found) - 150.0).max() < 1.0
    # where nothing like it is near, the position stays and is not made surer
    lost = point + 60.0 * away / camera.hs * camera.horizontal
    anchor.key = replace(anchor.key, point=lost)
    kept, spread = looks.take(at, lost, wide, anchor)
    across = camera.horizontal
    assert across @ spread @ across > 0.5 * (across @ wide @ across)
    assert np.linalg.norm((kept - lost) @ across) < 0.05


def test_few_matches_that_find_the_target_again_renew_the_features() -> None:
    # every stop counts as one of few matches; old features alone would match less and less on the way
    tracker = SiftTracker(SiftOptions(half_count=10_000.0))
    tracker.start("A", surface(), view(-6.0))
    inliers = [tracker.update("A", view(x)).scores["inliers"] for x in (-5.4, -4.86, -4.37)]
    assert inliers[2] > 0.7 * inliers[0]


def test_while_coasting_the_covariance_grows_and_confidence_falls() -> None:
    tracker = SiftTracker()
    tracker.start("A", surface(), view(-6.0))
    before = tracker.update("A", view(-5.4))
    lost = []
    for x in (-4.86, -4.37, -3.93):
        now = view(x)
        lost.append(tracker.update("A", replace(now, left=np.zeros_like(now.left))))
    traces = [np.trace(u.covariance) for u in (before, *lost)]
    assert traces == sorted(traces)
    assert traces[-1] > 4 * traces[0]
    assert all(u.confidence < 0.5 for u in lost)


def test_what_the_rover_carries_along_does_not_fool_it() -> None:
    """A panel 2 m before the cameras, which stays in the pictures, has more features than the scene."""
    panel = np.random.default_rng(1).uniform(0.1, 0.9, (40, 40)).repeat(8, axis=0).repeat(8, axis=1)
    tracker = SiftTracker()
    update = None
    for x in (-6.0, -5.4, -4.86):
        now = view(x)
        left, right = now.left.copy(), now.right.copy()
        shift = round(1123.5 * 0.2 / 2.0 + now.left_camera.hc - now.right_camera.hc)
        left[200:], right[200:] = panel[:101, :301], np.roll(panel, -shift, axis=1)[:101, :301]
        covered = replace(now, left=left.astype(np.float32), right=right.astype(np.float32))
        update = tracker.start("A", surface(), covered) if update is None else tracker.update("A", covered)
    assert update is not None
    assert update.state is TrackState.TRACKED
    assert np.linalg.norm(update.position - surface()) < 0.02


def test_gates_keep_rivals_out_of_the_ratio_test() -> None:
    base = np.eye(4, 128, dtype=np.float32)
    twin = np.concatenate((base, base))
    assert len(mutual(base, twin, 0.8)) == 0
    gate = np.zeros((4, 8), dtype=bool)
    gate[np.arange(4), np.arange(4)] = True
    gate[0, 1] = True
    assert [tuple(p) for p in mutual(base, twin, 0.8, gate)] == [(0, 0), (1, 1), (2, 2), (3, 3)]


def test_features_are_kept_from_all_parts_of_the_image() -> None:
    rng = np.random.default_rng(0)
    image = rng.uniform(0.4, 0.6, (60, 60)).repeat(4, axis=0).repeat(4, axis=1).astype(np.float32)
    image[:80, :80] = rng.uniform(0, 1, (20, 20)).repeat(4, axis=0).repeat(4, axis=1)
    pixels, _ = detect(image, 100)
    assert len(pixels) == 100
    assert ((pixels > 80).any(axis=1)).sum() > 60


def test_features_lie_where_a_half_turn_of_the_picture_puts_them() -> None:
    image = frames(-6.0)[0].unit
    pixels, _ = detect(image, 800)
    turned, _ = detect(np.ascontiguousarray(image[::-1, ::-1]), 800)
    back = np.array([image.shape[1] - 1.0, image.shape[0] - 1.0]) - turned
    away = pixels[:, None, :] - back[None]
    nearest = away[np.arange(len(pixels)), np.abs(away).max(axis=2).argmin(axis=1)]
    both = nearest[np.abs(nearest).max(axis=1) < 2.0]
    assert len(both) > 0.5 * len(pixels)
    assert np.abs(np.median(both, axis=0)) == pytest.approx([0.0, 0.0], abs=0.02)


def test_a_motion_is_as_unsure_as_its_features_whether_they_err_alone_or_together() -> None:
    together, alone = [], []
    for seed in range(40):
        alone.append(_squared_error_of_a_motion(seed, together_px=0.0))
        together.append(_squared_error_of_a_motion(seed, together_px=0.3))
    # 6 expected, 0.55 the deviation of a mean of 40; residuals taken one by one would tell 21 of the second:
    # patches that lie across the border of two parts are seen only in half
    assert 4.0 < np.mean(alone) < 7.5
    assert 4.0 < np.mean(together) < 11.0


def _squared_error_of_a_motion(seed: int, *, together_px: float) -> float:
    """Return squared error over what is told: features err by 0.3 px, patches of them by `together_px`."""
    rng = np.random.default_rng([seed, 0xE1])
    first = view(-6.0)
    cameras = (first.left_camera, first.right_camera)
    pixels = rng.uniform(5.0, 2.0 * HALF - 5.0, (240, 2))
    origins, rays = cameras[0].back_project(pixels)
    points = origins + rng.uniform(4.0, 8.0, (240, 1)) * rays
    true = Transform.from_rpy(*rng.normal(0, 0.01, 3), rng.normal(0, 0.1, 3))
    seen = np.hstack([camera.project(true.apply(points)) for camera in cameras])
    patch = (pixels // 30.0).astype(np.int64) @ np.array([1, 10])
    seen += rng.normal(0, 0.3, seen.shape) + together_px * rng.normal(0, 1.0, (100, 4))[patch]
    settled = settle(
        Transform.identity(),
        points,
        np.zeros((240, 3, 3)),
        seen,
        cameras,
        np.ones(240, np.bool_),
        inlier_px=3.0,
        sigma_px=0.3,
    )
    assert settled is not None
    motion, _ = settled
    off = true * motion.new_from_old.inverse()
    turn = 0.5 * np.array(
        [
            off.rotation[2, 1] - off.rotation[1, 2],
            off.rotation[0, 2] - off.rotation[2, 0],
            off.rotation[1, 0] - off.rotation[0, 1],
        ]
    )
    error = np.concatenate((turn, np.asarray(off.apply(motion.centre)) - motion.centre))
    return float(error @ np.linalg.solve(motion.covariance, error))


def test_misuse_is_refused() -> None:
    tracker = SiftTracker()
    with pytest.raises(TrackerError, match="behind"):
        tracker.start("A", (-30.0, 0.0, 0.0), view(-6.0))
    with pytest.raises(TrackerError, match="features"):
        SiftTracker().start("A", surface(), replace(view(-6.0), left=np.zeros_like(view(-6.0).left)))
    with pytest.raises(TrackerError, match="not followed"):
        tracker.update("Z", view(-6.0))
    with pytest.raises(TrackerError, match="at least 20"):
        SiftOptions(features=3)


def test_a_target_that_its_own_patch_does_not_range_is_not_tracked() -> None:
    seen = view(-6.0)
    column, row = (round(float(v)) for v in seen.left_camera.project(surface()))
    left = seen.left.copy()
    left[row - 14 : row + 15, column - 14 : column + 15] = 1.0
    tracker = SiftTracker()
    with pytest.raises(TrackerError, match=r'target "A" at pixel .* could not be ranged'):
        tracker.start("A", surface(), replace(seen, left=left))
    assert tracker.targets == ()
