"""Correlation that goes back to its first narrow picture, on rendered pictures of one rock."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rover_iface.behaviour.following import Followed
from rover_iface.behaviour.placing import require_known
from rover_iface.behaviour.target import DesignatedTarget
from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo import PointMatch
from rover_iface.errors import CameraError, TrackerError
from rover_iface.frames import Transform
from rover_iface.vision.correlation import ncc
from rover_iface.vision.correlation.ncc import FOUND_AGAIN, NccTracker
from rover_iface.vision.handoff import Handoff
from rover_iface.vision.handoff_cascade import Answer
from rover_iface.vision.narrow import crest, designation, recall
from rover_iface.vision.narrow.recall import LOST_UPDATES, REFUSED, NarrowRecall
from rover_iface.vision.narrow.references import Kept
from rover_iface.vision.tracker import StereoView, TrackState, TrackUpdate
from tests.rover_iface.vision.test_narrow_range import DRIFT, face, frames, view

NEAR_X, MIDWAY_X = -3.2, -5.5


@pytest.fixture(autouse=True)
def _begins_as_designated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let tracks begin where the rock bends, too: this is about what comes then."""
    monkeypatch.setattr(designation, "BENT_M", math.inf)


def surface(pixel: Array) -> Array:
    """Return the true surface point (3,) under a pixel (2,) of the first navcam picture."""
    x, y = (round(float(v)) for v in pixel)
    return np.asarray(frames("navcam")[0].truth.point_site[y, x], dtype=np.float64)


def begun(narrow: StereoView | None = None) -> tuple[NarrowRecall, Array]:
    """Return a tracker of a far target, and the true surface point."""
    pair = view("pancam") if narrow is None else narrow
    tracker = NarrowRecall(narrow=lambda *_: pair, wide=lambda *_: view("navcam", NEAR_X, DRIFT))
    pixel = face()[len(face()) // 2][0]
    tracker.start("A", surface(pixel), view("navcam"))
    return tracker, surface(pixel)


def blank(seen: StereoView) -> StereoView:
    return replace(seen, left=np.zeros_like(seen.left))


def test_a_track_that_was_lost_is_put_where_the_first_narrow_picture_has_the_target() -> None:
    tracker, point = begun()
    near = view("navcam", NEAR_X, DRIFT)
    found = tracker.update("A", blank(near))
    assert found.state is TrackState.TRACKED
    off = found.position - DRIFT.apply(point)
    assert np.linalg.norm(off) < 0.01
    assert off @ np.linalg.solve(found.covariance, off) < 16.0
    assert np.sqrt(np.linalg.eigvalsh(found.covariance)[-1]) < 0.01
    assert tracker.predicted("A") == pytest.approx(found.position)
    # correlation goes on from there
    again = tracker.update("A", near)
    assert again.state is TrackState.TRACKED
    assert np.linalg.norm(again.position - DRIFT.apply(point)) < 0.01
    assert tracker.beside("A", near) == pytest.approx(again.pixel, abs=0.2)


def test_what_is_taken_back_is_believed_as_little_until_a_picture_of_its_designation_shows_it() -> None:
    """Beside the target, its own texture is followed as well as the target's."""
    tracker, point = begun()
    near, beside = view("navcam", NEAR_X, DRIFT), DRIFT.apply(point) + np.array([0.0, 0.075, 0.0])
    first, tracker.narrow, tracker.wide = tracker.wide, None, None
    assert tracker.update("A", blank(near)).state is TrackState.LOST
    ray = beside - near.left_camera.C
    taken = tracker.take_back("A", near, beside, (0.005 * np.linalg.norm(ray)) ** 2 * np.eye(3))
    assert taken is not None
    assert np.linalg.norm(taken.position - DRIFT.apply(point)) > 0.05
    for _ in range(3):
        followed = tracker.update("A", near)
        assert followed.state is TrackState.TRACKED
        assert followed.confidence <= FOUND_AGAIN
    tracker.wide = first
    tracker.update("A", blank(near))
    sure = tracker.update("A", near)
    assert np.linalg.norm(sure.position - DRIFT.apply(point)) < 0.01
    assert sure.confidence > FOUND_AGAIN


def test_a_target_lost_at_the_goal_is_asked_for_without_a_step_nearer() -> None:
    tracker, point = begun()
    near = view("navcam", NEAR_X, DRIFT)
    assert tracker.update("A", near).state is TrackState.TRACKED
    found = tracker.update("A", blank(near))
    assert found.state is TrackState.TRACKED
    assert np.linalg.norm(found.position - DRIFT.apply(point)) < 0.01


def test_a_pair_that_knows_the_target_too_poorly_for_a_tool_is_not_the_last_one_asked(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(recall, "TOOL_AWAY_M", 5.0)
    tracker, point = begun()
    known = tracker._memories["A"].known
    (first,) = known.narrow
    known.narrow = [replace(first, sigma_m=0.009), first]
    found = tracker.update("A", blank(view("navcam", NEAR_X, DRIFT)))
    assert np.linalg.norm(found.position - DRIFT.apply(point)) < 0.005
    assert np.sqrt(np.linalg.eigvalsh(found.covariance)[1]) < 0.006


def farther(by_m: float) -> Callable[..., PointMatch | None]:
    """Return a stereo of windows that ranges all so much too far."""
    ranged = ncc.point_stereo

    def behind(*given: Any, **options: Any) -> PointMatch | None:
        match, camera = ranged(*given, **options), given[2]
        if match is None:
            return None
        ray = match.point - camera.C
        return replace(match, point=match.point + by_m * ray / np.linalg.norm(ray))

    return behind


@pytest.mark.parametrize(("window_m", "told_m", "kept"), [(0.07, 0.005, True), (0.0, 0.01, False)])
def test_what_is_taken_back_has_the_range_that_is_known_best(
    window_m: float, told_m: float, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """That of the surroundings where the window holds what lies behind; else both, the window being finer."""
    tracker, point = begun()
    near, true = view("navcam", NEAR_X, DRIFT), DRIFT.apply(point)
    tracker.narrow = tracker.wide = None
    tracker.update("A", blank(near))
    ray = (true - near.left_camera.C) / np.linalg.norm(true - near.left_camera.C)
    monkeypatch.setattr(ncc, "point_stereo", farther(window_m))
    place = true if kept else true + 0.0103 * ray
    taken = tracker.take_back("A", near, place, told_m**2 * np.eye(3))
    assert taken is not None
    assert abs(float((taken.position - true) @ ray)) < 0.005


def test_a_window_that_holds_what_lies_behind_an_edge_ranges_no_target_that_pictures_have(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tracker, point = begun()
    monkeypatch.setattr(ncc, "point_stereo", farther(0.07))
    found = tracker.update("A", blank(view("navcam", NEAR_X, DRIFT)))
    off = found.position - DRIFT.apply(point)
    assert np.linalg.norm(off) < 0.01
    assert off @ np.linalg.solve(found.covariance, off) < 16.0


@pytest.mark.parametrize(("off_m", "kept"), [(0.028, False), (0.012, True)])
def test_a_range_that_contradicts_earlier_answers_is_not_believed(off_m: float, kept: bool) -> None:
    """In the shade of a smooth face one stereo pair after the other had a target too near."""
    tracker, point = begun()
    near, place = view("navcam", NEAR_X, DRIFT), DRIFT.apply(point)
    assert tracker.update("A", near).state is TrackState.TRACKED
    ray = (place - near.left_camera.C) / np.linalg.norm(place - near.left_camera.C)
    tracker.expect("A", place + off_m * ray, 0.008**2 * np.eye(3))
    found = tracker.update("A", near)
    assert found.state is TrackState.TRACKED
    along_m = float((found.position - place) @ ray)
    assert along_m == pytest.approx(0.0 if kept else off_m, abs=0.006)
    told_m = math.sqrt(float(ray @ found.covariance @ ray))
    assert told_m < 0.009 if kept else off_m / 2.0 < told_m < off_m
    # that the hazcams range what the pixel shows does not settle it
    assert found.deep_m < 0.009
    # the map is less sure since: what nearly contradicts it is the same stereo in the same light
    for again_m, believed in ((0.018, not kept), (0.005, False), (0.018, False)):
        tracker.expect("A", place + again_m * ray, 0.008**2 * np.eye(3))
        along_m = float((tracker.update("A", near).position - place) @ ray)
        assert along_m == pytest.approx(again_m if believed else 0.0, abs=0.006)


def followed_beside(wide: bool) -> tuple[NarrowRecall, TrackUpdate, Array]:
    """Return a tracker that was confirmed and follows a spot 8 cm beside its target, told as known to
    millimetres, its answer where map and drive have the target, and where that is (3,).
    """
    tracker, point = begun()
    near, place = view("navcam", NEAR_X, DRIFT), DRIFT.apply(point)
    assert tracker.update("A", near).state is TrackState.TRACKED
    put_there(tracker, near, place + np.array([0.0, 0.08, 0.0]))
    tracker.expect("A", place, 0.013**2 * np.eye(3))
    if not wide:
        tracker.wide = None
    return tracker, tracker.update("A", near), place


def test_a_match_that_drive_and_other_targets_contradict_is_asked_of_the_pictures_at_once() -> None:
    _, found, place = followed_beside(wide=True)
    assert found.state is TrackState.TRACKED
    assert np.linalg.norm(found.position - place) < 0.01
    assert np.sqrt(np.linalg.eigvalsh(found.covariance)[-1]) < 0.01


def test_a_match_that_they_contradict_and_no_picture_shows_is_told_as_no_better_known() -> None:
    _, found, place = followed_beside(wide=False)
    off = found.position - place
    assert np.linalg.norm(off) > 0.05
    assert off @ np.linalg.solve(found.covariance, off) < 2.0


def test_a_target_within_reach_that_became_too_poorly_known_for_a_tool_is_asked_for_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(recall, "TOOL_AWAY_M", 5.0)
    tracker, point = begun()
    near = view("navcam", NEAR_X, DRIFT)
    assert tracker.update("A", near).state is TrackState.TRACKED
    # no earlier view is like the one from here
    monkeypatch.setattr(tracker.tracker, "_with_key", lambda *_: None)
    put_there(tracker, near, DRIFT.apply(point), sigma_m=0.02)
    again = tracker.update("A", near)
    assert np.sqrt(np.linalg.eigvalsh(again.covariance)[-1]) < 0.01


@pytest.mark.parametrize(("patches", "off_m", "state"), [
    (60, 0.24, TrackState.TRACKED), (44, 0.24, TrackState.LOST), (44, 0.05, TrackState.TRACKED),
])  # fmt: skip
def test_few_patches_do_not_put_a_lost_target_far_from_where_the_map_has_it(
    monkeypatch: pytest.MonkeyPatch, patches: int, off_m: float, state: TrackState
) -> None:
    asked = recall.cascade
    monkeypatch.setattr(recall, "cascade", lambda *given: replace(asked(*given), agreeing=patches))
    tracker, point = begun()
    beside = np.array([0.0, off_m, 0.0])
    tracker.expect("A", DRIFT.apply(point) + beside, 0.01**2 * np.eye(3))
    found = tracker.update("A", blank(view("navcam", NEAR_X, DRIFT)))
    assert found.state is state
    if state is TrackState.LOST:
        # nothing says which of the two is right
        assert beside @ found.covariance @ beside > 0.9 * float(beside @ beside) ** 2


def put_there(tracker: NarrowRecall, seen: StereoView, place: Array, sigma_m: float = 1e-3) -> None:
    """Let correlation follow the target from a place (3,) in a view on, as if it had come there."""
    pixel = np.asarray(seen.left_camera.project(place))
    away = float(np.linalg.norm(place - seen.left_camera.C))
    drift = sigma_m**2 * np.eye(3), np.zeros((3, 2))
    assert tracker.tracker.put("A", seen, pixel, drift, away)


def unseen(tracker: NarrowRecall, place: Array, *sigmas_m: float) -> list[TrackUpdate]:
    """Return the answers at stops that do not show the target, which is known so well elsewhere."""
    told = []
    for sigma_m in sigmas_m:
        tracker.expect("A", place, sigma_m**2 * np.eye(3))
        told.append(tracker.update("A", blank(view("navcam"))))
    return told


def test_a_target_out_of_sight_far_away_coasts_where_it_is_expected() -> None:
    tracker, point = begun()
    tracker.narrow = None
    beside = point + np.array([0.0, 0.2, 0.0])
    # more stops than correlation by itself tries at
    told = unseen(tracker, beside, *[0.14] * (LOST_UPDATES + 3))
    assert {update.state for update in told} == {TrackState.TRACKED}
    assert not np.isfinite([update.pixel for update in told]).any()
    assert [update.confidence for update in told] == pytest.approx([0.749] * len(told), abs=0.001)
    assert told[-1].position == pytest.approx(beside)
    assert told[-1].covariance == pytest.approx(0.14**2 * np.eye(3))
    assert told[0].reasons[0] == "out of sight, known to 0.14 m by the drive and the other targets"
    # from near the first picture has it, though correlation gave it up
    tracker.expect("A", DRIFT.apply(beside), 0.04 * np.eye(3))
    found = tracker.update("A", view("navcam", NEAR_X, DRIFT))
    assert found.state is TrackState.TRACKED
    assert np.linalg.norm(found.position - DRIFT.apply(point)) < 0.01


def test_a_target_that_would_hardly_be_found_again_is_lost() -> None:
    tracker, point = begun()
    tracker.narrow = None
    told = unseen(tracker, point, 0.3, 0.36, 0.3)
    assert [update.state for update in told] == [TrackState.TRACKED, TrackState.LOST, TrackState.TRACKED]
    assert told[1].confidence < 0.5 < told[0].confidence


def test_a_coasting_target_is_looked_for_as_the_rover_comes_to_it_however_well_it_is_known() -> None:
    """The last five metres to a target known to 9 cm were driven without a look that would have shown it."""
    looks = []

    def narrow(_target: str, _point: Array) -> StereoView:
        looks.append(_target)
        return blank(view("pancam"))

    tracker, point = begun()
    tracker.narrow = narrow
    unseen(tracker, point, 0.05, 0.05)
    assert len(looks) == 1
    tracker.expect("A", DRIFT.apply(point), 0.05**2 * np.eye(3))
    tracker.update("A", blank(view("navcam", MIDWAY_X, DRIFT)))
    assert len(looks) == 2


def test_a_coasting_target_that_is_known_too_poorly_is_looked_for_with_the_narrow_pair(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(recall, "TIED_M", 0.0)
    looks = []

    def narrow(_target: str, _point: Array) -> StereoView:
        looks.append(_target)
        return view("pancam")

    tracker, point = begun()
    tracker.narrow = narrow
    beside = point + np.array([0.1, 0.2, 0.0])
    for sigma_m, state, off_m in ((0.14, TrackState.TRACKED, 0.22), (0.25, TrackState.TRACKED, 0.0)):
        (told,) = unseen(tracker, beside, sigma_m)
        assert told.state is state
        assert np.linalg.norm(told.position - point) == pytest.approx(off_m, abs=0.02)
    assert len(looks) == 1
    assert np.isfinite(told.pixel).all()
    off = told.position - point
    assert off @ np.linalg.solve(told.covariance, off) < 16.0
    # it is not looked for again from there, and where it does not show nothing is taken over
    unseen(tracker, beside, 0.25)
    assert len(looks) == 1
    other, _ = begun()
    other.narrow = lambda *_: blank(view("pancam"))
    (told,) = unseen(other, beside, 0.25)
    assert told.position == pytest.approx(beside)
    assert not np.isfinite(told.pixel).any()


def test_a_target_that_is_seen_from_another_side_is_tied_to_another_narrow_picture(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The pictures here are all from one side, so any turn is taken for enough."""
    looks = []

    def narrow(_target: str, _point: Array) -> StereoView:
        looks.append(_target)
        return view("pancam", MIDWAY_X, DRIFT)

    tracker, point = begun()
    tracker.narrow = narrow
    seen, place = view("navcam", MIDWAY_X, DRIFT), DRIFT.apply(point)
    tracker.expect("A", place, 0.05**2 * np.eye(3))
    plain = tracker.update("A", seen)
    assert not looks
    monkeypatch.setattr(recall, "TURNED_RAD", 0.0)
    tracker.expect("A", place, 0.05**2 * np.eye(3))
    tied = tracker.update("A", seen)
    assert len(looks) == 1
    assert tied.state is plain.state is TrackState.TRACKED
    assert np.linalg.norm(tied.position - place) < 0.02
    assert np.linalg.eigvalsh(tied.covariance)[-1] < np.linalg.eigvalsh(plain.covariance)[-1]
    # an answer elsewhere than the drive and the others have it is not taken over
    monkeypatch.setattr(recall, "TRIED_RAD", 0.0)
    tracker.expect("A", place + np.array([0.0, 0.3, 0.0]), 0.01**2 * np.eye(3))
    tracker.tracker.expect("A", place, np.eye(3))
    untied = tracker.update("A", seen)
    assert len(looks) == 2
    assert np.linalg.eigvalsh(untied.covariance)[-1] > np.linalg.eigvalsh(tied.covariance)[-1]


def test_a_pair_that_is_tied_at_a_crest_is_kept_as_one_that_knows_the_target_as_poorly(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One was kept with its target 7 mm aside and 22 before its place, told as 4, and handed that on."""
    tracker, point = begun()
    tracker.narrow = lambda *_: view("pancam", MIDWAY_X, DRIFT)
    monkeypatch.setattr(recall, "TURNED_RAD", 0.0)
    monkeypatch.setattr(Kept, "turned_rad", lambda *_: 0.5)
    monkeypatch.setattr(crest, "open_along_m", lambda *_: 0.02)
    monkeypatch.setattr(crest, "open_depth_m", lambda *_: 0.03)
    tracker.expect("A", DRIFT.apply(point), 0.05**2 * np.eye(3))
    told = tracker.update("A", view("navcam", MIDWAY_X, DRIFT))
    across_m = 0.02 * math.sin(0.5)
    assert across_m < tracker._memories["A"].known.narrow[-1].sigma_m < across_m + 0.003
    assert np.sqrt(np.linalg.eigvalsh(told.covariance)) == pytest.approx([0.013, 0.013, 0.033], abs=0.003)


@pytest.mark.parametrize(("agreeing", "score", "kept"), [(35, 0.25, False), (80, 0.9, True)])
def test_an_answer_from_afar_that_the_track_contradicts_is_kept_only_if_it_was_recognised(
    agreeing: int, score: float, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Patches at borders of shadows that went on have a target 4 cm beside where it is seen."""
    tracker, point = begun()
    tracker.narrow = lambda *_: view("pancam", MIDWAY_X, DRIFT)
    seen, place = view("navcam", MIDWAY_X, DRIFT), DRIFT.apply(point)
    beside = np.array([0.0, 0.06, 0.0])

    def laid(given: Handoff, *_: object) -> Answer:
        camera = given.hazcam.view.left_camera
        pixel = np.asarray(camera.project(place + beside))
        none = np.empty((0, 2))
        told = 0.9, Transform.identity(), agreeing, score
        return Answer(pixel, place + beside, *told, none, none, np.empty((0, 4)))

    monkeypatch.setattr(recall, "cascade", laid)
    monkeypatch.setattr(recall, "TURNED_RAD", 0.0)
    tracker.expect("A", place, 0.05**2 * np.eye(3))
    told = tracker.update("A", seen)
    assert told.state is TrackState.TRACKED
    assert (np.linalg.norm(told.position - place) > 0.04) == kept
    assert len(tracker._memories["A"].known.narrow) == 1 + kept


@pytest.mark.parametrize(("agreeing", "score", "taken"), [(20, 0.49, False), (80, 0.9, True)])
def test_an_answer_from_near_that_a_confirmed_track_contradicts_is_taken_only_if_it_was_recognised(
    agreeing: int, score: float, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twenty patches had a target 27 mm beside its place that its track had to 5 mm."""
    tracker, point = begun()
    near, place = view("navcam", NEAR_X, DRIFT), DRIFT.apply(point)
    assert tracker.update("A", near).state is TrackState.TRACKED
    beside = place + np.array([0.0, 0.04, 0.0])

    def laid(given: Handoff, *_: object) -> Answer:
        pixel = np.asarray(given.hazcam.view.left_camera.project(beside))
        none = np.empty((0, 2))
        told = 0.9, Transform.identity(), agreeing, score
        return Answer(pixel, beside, *told, none, none, np.empty((0, 4)))

    monkeypatch.setattr(recall, "cascade", laid)
    tracker._memories["A"].share = 0.0
    told = tracker.update("A", near)
    assert told.state is TrackState.TRACKED
    assert np.linalg.norm(told.position - (beside if taken else place)) < 0.01
    # nor by so little one that is lost
    tracker, _ = begun()
    assert (tracker.update("A", blank(near)).state is TrackState.TRACKED) == taken


@pytest.mark.parametrize(
    ("aside_m", "agreeing", "taken"),
    [(0.05, 20, False), (0.05, 80, True), (0.0, 20, True), (-0.03, 20, True)],
)
def test_few_patches_have_a_target_that_is_in_doubt_where_the_track_or_the_map_has_it_and_nowhere_else(
    aside_m: float, agreeing: int, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The map contradicted a track by 3 cm; 21 patches had it 5 cm from both, and it was confirmed."""
    tracker, point = begun()
    near, place = view("navcam", NEAR_X, DRIFT), DRIFT.apply(point)
    assert tracker.update("A", near).state is TrackState.TRACKED
    there = place + np.array([0.0, aside_m, 0.0])

    def laid(given: Handoff, *_: object) -> Answer:
        pixel = np.asarray(given.hazcam.view.left_camera.project(there))
        none = np.empty((0, 2))
        told = 0.9, Transform.identity(), agreeing, 0.49
        return Answer(pixel, there, *told, none, none, np.empty((0, 4)))

    monkeypatch.setattr(recall, "cascade", laid)
    # at the second stop nothing is in doubt any more but what the first one has left open
    for map_m in (-0.03, 0.0):
        tracker._memories["A"].asked = None
        tracker.expect("A", place + np.array([0.0, map_m, 0.0]), 0.004**2 * np.eye(3))
        told = tracker.update("A", near)
        assert told.state is TrackState.TRACKED
        assert np.linalg.norm(told.position - (there if taken else place)) < 0.01
        if taken:
            break
        assert np.linalg.eigvalsh(told.covariance)[0] > 0.03**2


@pytest.mark.parametrize(("narrow", "aside_m", "taken"), [
    (False, 0.06, False), (False, 0.01, True), (True, 0.06, True),
])  # fmt: skip
def test_what_the_last_wide_pair_alone_has_elsewhere_than_the_map_is_not_the_target(
    narrow: bool, aside_m: float, taken: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It shows what was followed there: one had slid over a crest, and was recognised 10 cm behind."""
    tracker, point = begun()
    near, place = view("navcam", NEAR_X, DRIFT), DRIFT.apply(point)
    assert tracker.update("A", near).state is TrackState.TRACKED
    memory = tracker._memories["A"]
    assert memory.known.near is not None
    there, wide = place + np.array([0.0, aside_m, 0.0]), memory.known.near.pixel

    def laid(given: Handoff, *_: object) -> Answer:
        pixel = np.asarray(given.hazcam.view.left_camera.project(there))
        none = np.empty((0, 2))
        told = 0.9, Transform.identity(), 135, 0.96
        why = () if narrow or given.near_pixel is wide else ("too few patches",)
        return Answer(pixel, there, *told, none, none, np.empty((0, 4)), why)

    monkeypatch.setattr(recall, "cascade", laid)
    tracker.expect("A", place, 0.01**2 * np.eye(3))
    found = tracker.update("A", blank(near))
    assert (found.state is TrackState.TRACKED) == taken
    assert np.linalg.norm(found.position - (there if taken else place)) < 0.01


def test_an_answer_whose_pixel_may_be_of_something_before_it_is_not_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(recall, "edge_before", lambda *_: True)
    tracker, _ = begun()
    assert tracker.update("A", blank(view("navcam", NEAR_X, DRIFT))).state is TrackState.LOST


def test_what_a_crest_leaves_open_along_the_line_of_sight_stays_until_the_next_answer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A chain of wide pairs wandered 3.6 cm at a crest and told 5 mm."""
    monkeypatch.setattr(crest, "open_depth_m", lambda *_: 0.03)
    tracker, _ = begun()
    near = view("navcam", NEAR_X, DRIFT)
    for told in (tracker.update("A", near), tracker.update("A", near)):
        assert told.deep_m == 0.03
        ray = (told.position - near.left_camera.C) / np.linalg.norm(told.position - near.left_camera.C)
        assert 0.03 < math.sqrt(float(ray @ told.covariance @ ray)) < 0.035
        with pytest.raises(TrackerError, match="2 cm is the limit"):
            require_known(Followed(DesignatedTarget("A", (0.0, 0.0, 0.0)), told, near), 0.002)
    assert tracker.update("A", blank(view("navcam"))).deep_m == 0.0
    monkeypatch.setattr(crest, "open_depth_m", lambda *_: 0.0)
    tracker._memories["A"].asked = None
    assert tracker.update("A", near).deep_m == 0.0


@pytest.mark.parametrize(
    ("agreeing", "score", "kept"), [(31, 0.52, False), (31, 0.9, True), (60, 0.52, True)]
)
def test_a_pair_from_afar_is_kept_by_many_patches_or_by_the_targets_own(
    agreeing: int, score: float, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Few patches in another light had a target 7 cm beside its place, and all later answers were of it."""
    asked = recall.cascade

    def told(*given: Any) -> Answer:
        return replace(asked(*given), agreeing=agreeing, score=score)

    monkeypatch.setattr(recall, "cascade", told)
    monkeypatch.setattr(recall, "TURNED_RAD", 0.0)
    tracker, point = begun()
    tracker.narrow = lambda *_: view("pancam", MIDWAY_X, DRIFT)
    tracker.expect("A", DRIFT.apply(point), 0.05**2 * np.eye(3))
    assert tracker.update("A", view("navcam", MIDWAY_X, DRIFT)).state is TrackState.TRACKED
    assert len(tracker._memories["A"].known.narrow) == 1 + kept


def test_another_spot_than_the_drive_and_the_others_have_is_not_taken() -> None:
    for off_m, state in ((0.05, TrackState.TRACKED), (0.8, TrackState.LOST)):
        tracker, point = begun()
        tracker.tracker.expect("A", point + np.array([0.0, off_m, 0.0]), 0.05**2 * np.eye(3))
        told = tracker.update("A", view("navcam"))
        assert told.state is state
    assert told.reasons == ("0.80 m from where the drive and the other targets have it",)


def test_a_target_that_the_first_picture_does_not_show_is_told_to_be_known_too_poorly() -> None:
    tracker, point = begun()
    near = view("navcam", NEAR_X, DRIFT)
    tracker.update("A", near)
    known = tracker.update("A", near)
    doubted, _ = begun()
    doubted.wide = lambda *_: blank(near)
    put_there(doubted, near, DRIFT.apply(point))
    told = doubted.update("A", near)
    assert known.state is told.state is TrackState.TRACKED
    require_known(Followed(DesignatedTarget("A", (0.0, 0.0, 0.0)), known, near), 0.002)
    with pytest.raises(TrackerError, match="2 cm is the limit"):
        require_known(Followed(DesignatedTarget("A", (0.0, 0.0, 0.0)), told, near), 0.002)


def test_a_target_that_pictures_do_not_show_any_more_is_known_no_better_than_one_they_never_did() -> None:
    """Correlation slid by 2 cm at a crest, and told 4 mm, while they were asked for it in vain four times."""
    tracker, _ = begun()
    near = view("navcam", NEAR_X, DRIFT)
    shown = tracker.wide
    told = []
    for wide in (shown, *[lambda *_: blank(near)] * 2, shown):
        tracker.wide = wide
        tracker._memories["A"].asked = None
        update = tracker.update("A", near)
        assert update.state is TrackState.TRACKED
        told.append(math.sqrt(float(np.linalg.eigvalsh(update.covariance)[0])))
    assert max(told[0], told[1], told[3]) < 0.01
    assert told[2] > 0.03


def test_what_is_taken_back_but_no_picture_ever_showed_is_not_confirmed() -> None:
    """A spot 12 cm beside its target was taken back so, and told as known to 7 mm."""
    tracker, point = begun()
    near, place = view("navcam", NEAR_X, DRIFT), DRIFT.apply(point)
    tracker.wide = lambda *_: blank(near)
    assert tracker.update("A", blank(near)).state is TrackState.LOST
    assert tracker.take_back("A", near, place, 0.002**2 * np.eye(3)) is not None
    told = tracker.update("A", near)
    assert told.state is TrackState.TRACKED
    assert np.linalg.eigvalsh(told.covariance)[0] > 0.03**2


def test_the_first_picture_is_asked_from_near_and_not_twice_from_one_place() -> None:
    looks = []

    def wide(_target: str, point: Array) -> StereoView:
        looks.append(point)
        raise CameraError("the mast does not turn")

    pair = view("pancam")
    tracker = NarrowRecall(narrow=lambda *_: pair, wide=wide)
    pixel = face()[len(face()) // 2][0]
    tracker.start("A", surface(pixel), view("navcam"))
    assert tracker.update("A", view("navcam")).state is TrackState.TRACKED
    assert not looks
    for _ in range(2):
        assert tracker.update("A", blank(view("navcam", NEAR_X, DRIFT))).state is TrackState.LOST
    assert len(looks) == 2  # nothing was taken, so nothing was asked


def test_a_target_that_is_looked_for_in_vain_from_near_is_given_up() -> None:
    """Correlation alone would look for it on eight stops, to the end of the drive."""
    pair = view("pancam")
    tracker = NarrowRecall(narrow=lambda *_: pair, wide=lambda *_: blank(view("navcam", NEAR_X, DRIFT)))
    tracker.start("A", surface(face()[len(face()) // 2][0]), view("navcam"))
    states = []
    for stop in range(REFUSED):
        beside = Transform(np.eye(3), np.array([0.0, stop % 2, 0.0]))
        states.append(tracker.update("A", blank(view("navcam", NEAR_X, beside))).state)
    assert states == [*[TrackState.LOST] * (REFUSED - 1), TrackState.FAILED]


def test_a_picture_of_something_else_corrects_nothing() -> None:
    rng = np.random.default_rng(1)
    narrow = view("pancam")
    other = replace(
        narrow,
        left=rng.random(narrow.left.shape).astype(np.float32),
        right=rng.random(narrow.right.shape).astype(np.float32),
    )
    tracker, _ = begun(other)
    plain = NccTracker()
    plain.start("A", surface(face()[len(face()) // 2][0]), view("navcam"))
    near = view("navcam", NEAR_X, DRIFT)
    assert tracker.update("A", blank(near)).state is TrackState.LOST
    assert plain.update("A", blank(near)).state is TrackState.LOST


def test_a_range_that_is_known_better_is_the_range_of_the_track() -> None:
    from rover_iface.vision.narrow_range import KnownRange

    wide, (pixel, true) = view("navcam"), face()[0]
    tracker = NccTracker()
    update = tracker.start("A", None, wide, pixel=pixel, known=KnownRange(true, 0.01))
    assert np.linalg.norm(update.position - wide.left_camera.C) == pytest.approx(true)
    assert wide.left_camera.project(update.position) == pytest.approx(pixel, abs=1e-6)


def test_a_track_that_failed_goes_on_from_another_look() -> None:
    far, near = view("navcam"), view("navcam", NEAR_X)
    pixel = face()[len(face()) // 2][0]
    tracker = NccTracker(replace(NccTracker().options, lost_updates=0))
    tracker.start("A", None, far, pixel=pixel)
    assert tracker.update("A", blank(near)).state is TrackState.FAILED
    there = near.left_camera.project(surface(pixel))
    away = float(np.linalg.norm(surface(pixel) - near.left_camera.C))
    drift = 0.002**2 * np.eye(3), np.zeros((3, 2))
    assert tracker.put("A", near, there, drift, away)
    told = tracker.update("A", near)
    assert told.state is TrackState.TRACKED
    assert np.linalg.norm(told.position - surface(pixel)) < 0.01
    # what the look left open is told
    assert np.linalg.eigvalsh(told.covariance)[1] >= 0.9 * 0.002**2
    assert not tracker.put("A", blank(near), there, drift, away)
    # a match that is too poor by itself (0.66 of 0.7) is enough at the range that the look has alone
    noise = np.random.default_rng(1).normal(0.0, 0.1, near.right.shape)
    poor = replace(near, right=(near.right + noise).astype(near.right.dtype))
    assert tracker.put("A", poor, there, drift, away)
    assert not tracker.put("A", poor, there, drift, 1.2 * away)
