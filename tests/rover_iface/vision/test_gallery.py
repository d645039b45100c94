"""Earlier views of a target: which are kept, which is compared, and what a failed comparison tells."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rover_iface.cameras.model import CameraModel, pinhole
from rover_iface.frames import Transform
from rover_iface.vision.correlation.gallery import MOST_VIEWS, Gallery
from rover_iface.vision.correlation.judging import Followed
from rover_iface.vision.correlation.ncc import NccTracker
from rover_iface.vision.template import Found, NccOptions, Template, TemplateMatcher
from rover_iface.vision.tracker import Image, StereoView, TrackState, TrackUpdate

SPOT = np.zeros(3)
BLANK = np.zeros((161, 161), np.float32)


def camera(range_m: float, bearing_rad: float) -> CameraModel:
    """Return a camera so far from the spot, seen from that side, that looks at it."""
    place = (-range_m * math.cos(bearing_rad), -range_m * math.sin(bearing_rad), 0.0)
    model = pinhole(width=161, height=161, focal_px=1124.0)
    return model.transformed(Transform.from_rpy(0.0, 0.0, bearing_rad, place))


def seen(range_m: float, bearing_rad: float, drift_m: float, depth_m: float = 0.01) -> Template:
    """Return a view whose spot is known to `drift_m`."""
    eye = camera(range_m, bearing_rad)
    normal = (eye.C - SPOT) / range_m
    drift = drift_m**2 * np.eye(3)
    return Template(BLANK, eye, eye.project(SPOT), SPOT, normal, range_m, drift, depth_m2=depth_m**2)


def test_who_comes_back_is_compared_with_what_was_seen_there() -> None:
    gallery = Gallery(seen(8.0, 0.0, 0.0), 0.0)
    for bearing, drift in ((0.3, 0.01), (0.6, 0.02), (0.85, 0.04)):
        gallery.add(seen(8.0, bearing, drift), 10.0 * bearing)
    back = camera(7.8, 0.05)
    best = gallery.best(back, SPOT, back.C / np.linalg.norm(back.C))
    assert best[0].template is gallery.views[0].template


def test_a_view_of_the_same_place_is_kept_only_if_it_knows_more() -> None:
    gallery = Gallery(seen(8.0, 0.0, 0.0), 0.0)
    gallery.add(seen(5.0, 0.4, 0.02), 1.0)
    gallery.add(seen(5.1, 0.42, 0.03), 2.0)
    assert [k.travelled_m for k in gallery.views] == [0.0, 1.0]
    gallery.add(seen(5.1, 0.42, 0.01), 3.0)
    assert [k.travelled_m for k in gallery.views] == [0.0, 3.0]


@pytest.mark.parametrize(("range_m", "bearing"), [(8.0, 1.2), (1.5, 0.0)])
def test_what_shares_too_little_is_not_compared(range_m: float, bearing: float) -> None:
    gallery = Gallery(seen(8.0, 0.0, 0.0), 0.0)
    assert gallery.best(camera(range_m, bearing), SPOT, np.array([-1.0, 0.0, 0.0])) == []


def test_the_first_view_stays_whatever_comes() -> None:
    first = seen(8.0, 0.0, 0.5)
    gallery = Gallery(first, 0.0)
    for k in range(3 * MOST_VIEWS):
        gallery.add(seen(8.0 * 0.95**k, 0.2 * k, 0.001), float(k))
    assert gallery.views[0].template is first
    assert len(gallery.views) <= MOST_VIEWS


def test_an_alignment_that_finds_no_place_measures_nothing() -> None:
    matcher = TemplateMatcher(NccOptions())
    rng = np.random.default_rng(3)
    image = rng.random((161, 161)).astype(np.float32)
    template = image[60:101, 60:101].copy()
    at = np.array([80.0, 80.0])
    fitted = matcher.fit(image, template, at, 14)
    assert fitted is not None
    assert fitted[0] > 0.99
    flat = np.full_like(image, 0.5)
    assert matcher.fit(flat, template, np.array([80.0, 80.0]), 14) is None


class Elsewhere(TemplateMatcher):
    """Every earlier view is found, each a few pixels beside the last one's match."""

    def predict(self, source: Template, camera: CameraModel, center: np.ndarray, point: np.ndarray) -> Image:
        return BLANK[:41, :41]

    def fit(self, image: Image, template: Image, at: np.ndarray, half: int) -> tuple[float, np.ndarray]:
        at += (12.0, 0.0)
        return 0.9, 0.01 * np.eye(2)


def test_a_picture_is_one_check_however_many_views_it_is_compared_with() -> None:
    """The gaps of one picture all hold the error of its one match: one bad match was counted three times."""
    options = NccOptions()
    tracker = NccTracker(options)
    tracker.matcher = Elsewhere(options)
    first, last = seen(8.0, 0.0, 0.0), seen(6.0, 0.2, 0.02)
    gallery = Gallery(first, 0.0)
    for bearing in (0.3, 0.6):
        gallery.add(seen(6.0, bearing, 0.01), 10.0 * bearing)
    nothing = TrackUpdate("T", TrackState.TRACKED, SPOT, np.eye(3), 1.0, np.zeros(2))
    track = Followed(first, last, gallery, nothing, SPOT, 8.0, 0.0, 0.0, 0.0, normal_weight=1.0)
    for stop in range(1, 3):
        eye = camera(5.0, 0.15 * stop)
        view = StereoView(BLANK, BLANK, eye, eye)
        at = eye.project(SPOT)
        assert len(gallery.best(eye, SPOT, last.normal)) == 3
        tracker._with_key(track, view, at, Found(at.copy(), 0.8, 0.01 * np.eye(2)))
        assert tracker.watch.checks == stop
    assert tracker.watch.held == 0
