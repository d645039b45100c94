"""What every registered tracker owes the rover, whoever wrote it."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from importlib.metadata import EntryPoint
from typing import Any

import numpy as np
import pytest

from mission import plugins
from rover_iface.errors import TrackerError
from rover_iface.frames import Pose
from rover_iface.simulator.render.picture import Frame
from rover_iface.vision.tracker import StereoView, Tracker, TrackState, TrackUpdate
from rover_iface.vision.trackers import TRACKERS, make_tracker
from tests.rover_iface.render.scenes import picture

HALF = 150
STOPS = (-5.4, -4.86, -4.37)
MOST_UPDATES = 12
"""How many updates without the target a tracker may go on trying."""


@lru_cache(maxsize=8)
def frames(x: float) -> tuple[Frame, Frame]:
    pose = Pose(x, 0.0, 0.0)
    left = picture(pose, half=HALF, seed=round(-x * 100))
    return left, picture(pose, "navcam_right", half=HALF, exposure=left.exposure, seed=round(-x * 100) + 1)


def view(x: float) -> StereoView:
    left, right = frames(x)
    travelled_m = x + 6.0
    return StereoView(left.unit, right.unit, left.camera, right.camera, 100 * travelled_m, travelled_m)


def blank(x: float) -> StereoView:
    seen = view(x)
    grey = np.full_like(seen.left, 0.5)
    return replace(seen, left=grey, right=grey.copy())


def surface(row: int = HALF, column: int = HALF) -> np.ndarray:
    return np.asarray(frames(-6.0)[0].truth.point_site[row, column])


@pytest.fixture(params=list(TRACKERS))
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def tracker(name: str) -> Tracker:
    return make_tracker(name)


def sound(update: TrackUpdate) -> None:
    """Check what holds of any answer."""
    assert update.state in (TrackState.TRACKED, TrackState.LOST, TrackState.FAILED)
    assert np.isfinite(update.position).all()
    assert (np.linalg.eigvalsh(update.covariance) > 0).all()
    assert 0.0 <= update.confidence <= 1.0
    if update.state is TrackState.TRACKED:
        assert np.isfinite(update.pixel).all()
        assert update.confidence >= 0.5
    else:
        assert np.isnan(update.pixel).all()
        assert update.reasons


def test_a_target_is_carried_through_an_approach_and_its_error_is_told(tracker: Tracker) -> None:
    first = tracker.start("A", surface(), view(-6.0))
    assert first.state is TrackState.TRACKED
    for x in STOPS:
        update = tracker.update("A", view(x))
        sound(update)
        assert update.state is TrackState.TRACKED
        off = update.position - surface()
        assert np.linalg.norm(off) < 0.03
        assert off @ np.linalg.solve(update.covariance, off) < 25.0
        assert tracker.predicted("A") == pytest.approx(update.position, abs=0.02)


def test_the_same_views_give_the_same_answers(name: str) -> None:
    one, other = make_tracker(name), make_tracker(name)
    for tracker in (one, other):
        tracker.start("A", surface(), view(-6.0))
    for x in STOPS[:2]:
        first, second = one.update("A", view(x)), other.update("A", view(x))
        assert np.array_equal(first.position, second.position)
        assert (first.state, first.confidence) == (second.state, second.confidence)


def test_a_target_out_of_sight_is_lost_then_failed_until_it_is_cleared(tracker: Tracker) -> None:
    tracker.start("A", surface(), view(-6.0))
    states = []
    for _ in range(MOST_UPDATES):
        update = tracker.update("A", blank(-5.4))
        sound(update)
        assert np.linalg.norm(update.position - surface()) < 0.2
        states.append(update.state)
    assert TrackState.TRACKED not in states
    assert states[0] is TrackState.LOST
    assert states[-1] is TrackState.FAILED
    assert tracker.update("A", view(-5.4)).state is TrackState.FAILED
    tracker.clear("A")
    assert tracker.start("A", surface(), view(-6.0)).state is TrackState.TRACKED


def test_a_target_that_comes_back_at_once_is_found_again(tracker: Tracker) -> None:
    tracker.start("A", surface(), view(-6.0))
    assert tracker.update("A", blank(-5.4)).state is TrackState.LOST
    update = tracker.update("A", view(-4.86))
    assert update.state is TrackState.TRACKED
    assert np.linalg.norm(update.position - surface()) < 0.05


def test_targets_do_not_mind_each_other(tracker: Tracker) -> None:
    beside = surface(HALF + 12, HALF - 18)
    first = view(-6.0)
    tracker.start("A", surface(), first)
    tracker.start("B", beside, first)
    now = view(STOPS[0])
    for name, point in (("A", surface()), ("B", beside)):
        assert np.linalg.norm(tracker.update(name, now).position - point) < 0.03
    tracker.clear("A")
    assert tracker.update("B", view(STOPS[1])).state is TrackState.TRACKED


def test_a_target_that_stereo_does_not_range_is_not_tracked(tracker: Tracker) -> None:
    seen = view(-6.0)
    column, row = (round(float(v)) for v in seen.left_camera.project(surface()))
    left = seen.left.copy()
    left[row - 14 : row + 15, column - 14 : column + 15] = 1.0
    with pytest.raises(TrackerError, match=r'target "A"|ranged|contrast|range'):
        tracker.start("A", surface(), replace(seen, left=left))
    with pytest.raises(TrackerError):
        tracker.update("A", seen)


def test_misuse_is_refused(tracker: Tracker) -> None:
    with pytest.raises(TrackerError):
        tracker.start("A", (-30.0, 0.0, 0.0), view(-6.0))
    with pytest.raises(TrackerError):
        tracker.update("A", view(-6.0))
    tracker.start("A", surface(), view(-6.0))
    with pytest.raises(TrackerError):
        tracker.start("A", surface(), view(-6.0))


def test_trackers_are_found_by_name() -> None:
    assert {"klt", "ncc", "ncc-narrow", "sift", "sift-shape"} <= set(TRACKERS)
    known = "klt, ncc, ncc-narrow, sift, sift-shape"
    with pytest.raises(TrackerError, match=f'unknown tracker "hound"; known are {known}'):
        make_tracker("hound")


def test_a_package_whose_tracker_cannot_be_imported_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    announced = EntryPoint("hound", "acme_hound:make", "outcrop.trackers")
    real = plugins.entry_points

    def entry_points(**wanted: Any) -> Any:
        return [announced] if wanted.get("group") == "outcrop.trackers" else real(**wanted)

    monkeypatch.setattr(plugins, "entry_points", entry_points)
    assert "hound" in TRACKERS.names()
    with pytest.raises(
        TrackerError, match=r'"hound" \(acme_hound:make\) cannot be loaded.*ncc, ncc-narrow, sift'
    ):
        make_tracker("hound")
    assert make_tracker("ncc").start("A", surface(), view(-6.0)).state is TrackState.TRACKED
