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
from rover_iface.simulator.render.renderer import Frame
from rover_iface.vision.sift import SiftOptions, SiftTracker, horn
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


@pytest.mark.parametrize("method", ["pixel", "published"])
def test_targets_are_carried_with_a_pose_estimate_that_drifts(method: Literal["pixel", "published"]) -> None:
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
        assert np.array_equal(update.position, surface())
    back = tracker.update("A", view(-4.86))
    assert back.state is TrackState.TRACKED
    assert np.linalg.norm(back.position - surface()) < 0.015
    for _ in range(3):
        update = tracker.update("A", replace(now, left=np.zeros_like(now.left)))
    assert update.state is TrackState.FAILED
    assert tracker.update("A", view(-4.37)).state is TrackState.FAILED


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
