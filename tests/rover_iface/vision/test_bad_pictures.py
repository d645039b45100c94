"""Pictures that are not as they should be: every tracker names what happened, and none is surely wrong."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.errors import TrackerError
from rover_iface.frames import Transform
from rover_iface.vision.tracker import Image, StereoView, Tracker, TrackState, TrackUpdate
from rover_iface.vision.trackers import TRACKERS, make_tracker
from tests.rover_iface.vision.test_tracker_contract import HALF, frames, surface, view

Spoil = Callable[[StereoView], StereoView]
SURE, WRONG_PX, SIGMAS = 0.5, 3.0, 5.0


def painted(seen: StereoView, value: float, half: int = 20) -> StereoView:
    """Return the view with the target's own surroundings overwritten in both images."""
    images = []
    for image, camera in ((seen.left, seen.left_camera), (seen.right, seen.right_camera)):
        column, row = (round(float(v)) for v in camera.project(surface()))
        made = image.copy()
        made[max(0, row - half) : row + half + 1, max(0, column - half) : column + half + 1] = value
        images.append(made)
    return replace(seen, left=images[0], right=images[1])


def half_lost(seen: StereoView) -> StereoView:
    left = seen.left.copy()
    left[HALF - 30 :] = 0.0
    return replace(seen, left=left)


def exposed(factor: float) -> Spoil:
    def spoil(seen: StereoView) -> StereoView:
        def shot(image: Image) -> Image:
            return np.asarray(np.clip(np.round(255.0 * image * factor), 0, 255) / 255.0, dtype=np.float32)

        return replace(seen, left=shot(seen.left), right=shot(seen.right))

    return spoil


def turned(camera: CameraModel, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> CameraModel:
    turn = Transform.from_rpy(roll, pitch, yaw).rotation
    return camera.transformed(Transform(turn, camera.C - turn @ camera.C))


def uncalibrated(pitch_px: float, yaw_px: float) -> Spoil:
    def spoil(seen: StereoView) -> StereoView:
        focal = seen.right_camera.hs
        return replace(
            seen, right_camera=turned(seen.right_camera, pitch=pitch_px / focal, yaw=yaw_px / focal)
        )

    return spoil


def mast_off(seen: StereoView) -> StereoView:
    off = math.radians(2.0)
    return replace(
        seen, left_camera=turned(seen.left_camera, yaw=off), right_camera=turned(seen.right_camera, yaw=off)
    )


def smaller(seen: StereoView) -> StereoView:
    """Return a subframe of the view, another size for each image."""
    left, right = (40, 30, 221, 201), (30, 40, 231, 211)

    def cut(image: Image, box: tuple[int, int, int, int]) -> Image:
        return np.ascontiguousarray(image[box[1] : box[1] + box[3], box[0] : box[0] + box[2]])

    return replace(
        seen,
        left=cut(seen.left, left),
        right=cut(seen.right, right),
        left_camera=seen.left_camera.window(*left),
        right_camera=seen.right_camera.window(*right),
    )


def out_of_time(seen: StereoView) -> StereoView:
    """Return the view whose right image was taken at the next stop."""
    return replace(seen, right=view(-4.37).right)


BAD: dict[str, Spoil] = {
    "saturated patch": lambda seen: painted(seen, 1.0),
    "empty patch": lambda seen: painted(seen, 0.0),
    "no number": lambda seen: painted(seen, math.nan),
    "half a frame lost": half_lost,
    "two stops over": exposed(4.0),
    "two stops under": exposed(0.25),
    "rows off by 5 px": uncalibrated(5.0, 0.0),
    "columns off by 5 px": uncalibrated(0.0, 5.0),
    "mast off by 2 degrees": mast_off,
    "another size": smaller,
    "images of two times": out_of_time,
    "all black": lambda seen: replace(seen, left=np.zeros_like(seen.left), right=np.zeros_like(seen.right)),
}


def judged(update: TrackUpdate, seen: StereoView, true_pixel: Array) -> None:
    """Check that an answer is either a named loss or right."""
    assert np.isfinite(update.position).all()
    assert np.isfinite(update.covariance).all()
    if update.state is not TrackState.TRACKED:
        assert update.confidence < SURE
        assert update.reasons
        return
    assert np.hypot(*(update.pixel - true_pixel)) < WRONG_PX


@pytest.fixture(params=list(TRACKERS))
def tracker(request: pytest.FixtureRequest) -> Tracker:
    return make_tracker(str(request.param))


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_stop_is_a_named_loss_or_a_right_answer(tracker: Tracker, kind: str) -> None:
    tracker.start("A", surface(), view(-6.0))
    good = view(-5.4)
    bad = BAD[kind](good)
    corner = np.array([40.0, 30.0]) if kind == "another size" else np.zeros(2)
    update = tracker.update("A", bad)
    judged(update, bad, frames(-5.4)[0].camera.project(surface()) - corner)


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_first_stop_is_refused_with_the_targets_name_or_tells_the_range_as_sure_as_it_is(
    tracker: Tracker, kind: str
) -> None:
    first = BAD[kind](view(-6.0))
    refused = ""
    try:
        update = tracker.start("A", surface(), first)
    except TrackerError as err:
        refused = str(err)
    if refused:
        assert '"A"' in refused or "features" in refused
        return
    off = update.position - surface()
    if kind == "mast off by 2 degrees":
        # nothing on board can tell where the mast points: only the range is its own
        off = np.zeros(3) + abs(
            np.linalg.norm(update.position - first.left_camera.C)
            - np.linalg.norm(surface() - first.left_camera.C)
        )
        assert off[0] < 0.2
        return
    assert off @ np.linalg.solve(update.covariance, off) < SIGMAS**2


def test_a_tracker_goes_on_after_a_bad_stop(tracker: Tracker) -> None:
    tracker.start("A", surface(), view(-6.0))
    tracker.update("A", BAD["half a frame lost"](view(-5.4)))
    update = tracker.update("A", view(-4.86))
    if update.state is TrackState.TRACKED:
        assert np.linalg.norm(update.position - surface()) < 0.05
