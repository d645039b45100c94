"""The range of a far target by the narrow pair, on rendered pictures."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo import point_stereo
from rover_iface.frames import Pose, Transform
from rover_iface.simulator.render.picture import Frame
from rover_iface.vision.narrow_range import KnownRange, narrow_sight
from rover_iface.vision.shape_tracker import CombinedTracker
from rover_iface.vision.sift import SiftOptions, SiftTracker
from rover_iface.vision.tracker import StereoView, TrackState
from tests.rover_iface.render.scenes import picture

POSE = Pose(-9.5, 0.0, 0.0)
MAST_OFF = Transform.from_rpy(0.0, 0.0012, -0.0016)
"""What the mast was off when the narrow pair was taken, two navcam pixels."""


@lru_cache(maxsize=4)
def frames(camera: str, x: float = POSE.x) -> tuple[Frame, Frame]:
    pose = replace(POSE, x=x)
    left = picture(pose, f"{camera}_left", half=150, seed=1)
    return left, picture(pose, f"{camera}_right", half=180, exposure=left.exposure, seed=2)


def view(camera: str, x: float = POSE.x, drift: Transform | None = None) -> StereoView:
    left, right = frames(camera, x)
    told = [f.camera.transformed(drift or Transform.identity()) for f in (left, right)]
    if camera == "pancam":
        middle = told[0].C
        lever = Transform(np.eye(3), middle) * MAST_OFF * Transform(np.eye(3), -middle)
        told = [c.transformed(lever) for c in told]
    return StereoView(left.unit, right.unit, told[0], told[1])


def face() -> list[tuple[Array, float]]:
    """Return pixels of the rock's face that are not on an edge, and their true ranges."""
    truth = frames("navcam")[0].truth.range_m
    found = []
    for y in range(130, 172, 6):
        for x in range(130, 172, 6):
            if np.ptp(truth[y - 5 : y + 6, x - 5 : x + 6]) < 0.15:
                found.append((np.array([x, y], dtype=np.float64), float(truth[y, x])))
    return found


def ranges() -> list[tuple[Array, float, KnownRange]]:
    wide, narrow = view("navcam"), view("pancam")
    # the map has the target 30 cm too far off
    answers = [(pixel, true, narrow_sight(wide, pixel, narrow, true + 0.3)) for pixel, true in face()]
    assert len(answers) >= 12
    return [(pixel, true, sight.known) for pixel, true, sight in answers if sight is not None]


def test_the_narrow_pair_ranges_a_far_pixel_several_times_better() -> None:
    wide, answers = view("navcam"), ranges()
    assert len(answers) >= 0.8 * len(face())
    narrow_m, wide_m = [], []
    for pixel, true, known in answers:
        narrow_m.append(known.range_m - true)
        match = point_stereo(wide.left, wide.right, wide.left_camera, wide.right_camera, pixel)
        assert match is not None
        wide_m.append(float(np.linalg.norm(match.point - wide.left_camera.C)) - true)
    assert np.median(np.abs(narrow_m)) < 0.02
    assert np.sqrt(np.mean(np.square(narrow_m))) < 0.5 * np.sqrt(np.mean(np.square(wide_m)))


def test_it_tells_how_sure_it_is() -> None:
    sigmas = [abs(known.range_m - true) / known.sigma_m for _, true, known in ranges()]
    assert np.mean(np.array(sigmas) < 2.0) > 0.8
    assert all(0.005 < known.sigma_m < 0.10 for _, _, known in ranges())


def test_a_narrow_picture_of_something_else_tells_nothing() -> None:
    wide, narrow = view("navcam"), view("pancam")
    rng = np.random.default_rng(1)
    noise = rng.random(narrow.left.shape).astype(np.float32)
    blind = StereoView(noise, narrow.right, narrow.left_camera, narrow.right_camera)
    pixel, true = face()[0]
    assert narrow_sight(wide, pixel, blind, true) is None


def test_a_track_starts_where_the_narrow_pair_has_it() -> None:
    wide = view("navcam")
    pixel, true, known = ranges()[0]
    for name, given in (("with", known), ("without", None)):
        tracker = SiftTracker()
        update = tracker.start(name, None, wide, pixel=pixel, known=given)
        ray = update.position - wide.left_camera.C
        away = float(np.linalg.norm(ray))
        spread = float(np.sqrt(ray @ update.covariance @ ray)) / away
        # either way it is the designated pixel
        assert np.abs(wide.left_camera.project(update.position) - pixel).max() < 0.5
        if given is None:
            assert abs(away - true) < 3.0 * spread
        else:
            assert abs(away - true) < 0.03
            assert spread < 0.06


DRIFT = Transform.from_rpy(0.0, 0.0, 0.01, (0.08, -0.06, 0.02))


def begun() -> tuple[CombinedTracker, Array]:
    """Return a tracker of a far target with its narrow sight, and the true surface point."""
    wide = view("navcam")
    pixel, true = face()[len(face()) // 2]
    tracker = CombinedTracker(SiftOptions(lost_updates=0))
    tracker.start("A", None, wide, pixel=pixel, narrow=narrow_sight(wide, pixel, view("pancam"), true))
    x, y = (round(float(v)) for v in pixel)
    return tracker, np.asarray(frames("navcam")[0].truth.point_site[y, x])


def test_a_target_that_was_lost_far_off_is_found_again_by_its_first_narrow_picture() -> None:
    tracker, point = begun()
    near = view("navcam", -3.2, DRIFT)
    lost = tracker.update("A", replace(near, left=np.zeros_like(near.left)))
    assert lost.state is TrackState.FAILED
    assert np.linalg.norm(lost.position - DRIFT.apply(point)) > 0.05
    found = tracker.recall("A", near)
    assert found is not None
    assert found.state is TrackState.TRACKED
    off = found.position - DRIFT.apply(point)
    assert np.linalg.norm(off) < 0.015
    assert off @ np.linalg.solve(found.covariance, off) < 16.0
    # the track goes on from there, and is not asked for again from the same distance
    assert tracker.update("A", near).position == pytest.approx(found.position)
    assert tracker.recall("A", near) is None


def test_a_narrow_picture_is_asked_for_near_by_only_and_not_believed_on_nothing() -> None:
    tracker, _ = begun()
    assert tracker.recall("A", view("navcam")) is None
    near = view("navcam", -3.2, DRIFT)
    blank = replace(near, left=np.zeros_like(near.left))
    before = tracker.update("A", blank)
    assert tracker.recall("A", blank) is None
    assert tracker.predicted("A") == pytest.approx(before.position)
    tracker.clear("A")
    assert tracker.recall("A", near) is None
