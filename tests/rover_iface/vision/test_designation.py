"""Which pixel of the first pictures a designated target is."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rover_iface.cameras.model import Array
from rover_iface.errors import TrackerError
from rover_iface.vision.narrow import designation
from rover_iface.vision.narrow.designation import EDGE_PX, _Ranged, off_the_edge
from rover_iface.vision.narrow_range import NarrowSight, narrow_sight
from tests.rover_iface.vision.test_narrow_range import face, frames, view


def edge_pixel() -> Array:
    """Return the last pixel beside the rock in a row: what it shows lies metres behind the next one."""
    row = frames("navcam")[0].truth.range_m[134]
    return np.array([np.flatnonzero(row[:150] > 12.0)[-1], 134.0])


def test_a_target_at_an_edge_is_moved_onto_the_surface_that_is_meant() -> None:
    pixel = edge_pixel()
    away = float(frames("navcam")[0].truth.range_m[int(pixel[1]), int(pixel[0]) + 4])
    moved, sight = off_the_edge("A", view("navcam"), pixel, view("pancam"), away)
    assert sight is not None
    assert 0.5 < float(np.hypot(*(moved - pixel))) <= 12.0
    x, y = (round(float(v)) for v in moved)
    truth = frames("navcam")[0].truth.range_m
    assert np.ptp(truth[y - 1 : y + 2, x - 1 : x + 2]) < 0.15
    assert abs(float(truth[y, x]) - sight.known.range_m) < 0.05


def test_a_target_on_one_surface_stays_where_it_was_designated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(designation, "BENT_M", math.inf)
    for pixel, true in face()[::4]:
        moved, sight = off_the_edge("A", view("navcam"), pixel, view("pancam"), true)
        assert moved == pytest.approx(pixel)
        assert sight is not None


def test_a_target_whose_surface_is_not_there_is_refused_with_the_reason() -> None:
    pixel, true = face()[0]
    with pytest.raises(TrackerError, match='target "A" lies at an edge'):
        off_the_edge("A", view("navcam"), pixel, view("pancam"), true + 0.6)


def test_a_match_that_went_across_an_edge_is_no_sight_of_the_target(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wide window that holds two surfaces is found on either; a place beside was taken for looked at."""
    pixel, seen = edge_pixel(), narrow_sight
    away = float(frames("navcam")[0].truth.range_m[int(pixel[1]), int(pixel[0]) + 4])
    first, sight = off_the_edge("A", view("navcam"), pixel, view("pancam"), away)
    assert sight is not None
    astray: list[Array] = []

    def across(wide: Any, at: Array, *others: Any) -> NarrowSight | None:
        found = seen(wide, at, *others)
        if found is None or not np.allclose(at, first):
            return found
        astray.append(found.pixel - 3.0 * (first - pixel))
        return replace(found, pixel=astray[-1])

    monkeypatch.setattr(designation, "narrow_sight", across)
    _, other = off_the_edge("A", view("navcam"), pixel, view("pancam"), away)
    assert astray
    assert other is not None
    assert not np.allclose(other.pixel, astray[0])


def test_a_window_that_contradicts_all_round_it_ranges_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the border of a shadow a window had a face 29 cm too near, and told 1.5 cm."""
    (pixel, true), seen = face()[0], narrow_sight

    def nearer(*given: Any) -> NarrowSight | None:
        found = seen(*given)
        return found and replace(found, known=replace(found.known, range_m=found.known.range_m - 0.3))

    plain = off_the_edge("A", view("navcam"), pixel, view("pancam"), true)[1]
    monkeypatch.setattr(designation, "narrow_sight", nearer)
    moved, sight = off_the_edge("A", view("navcam"), pixel, view("pancam"), true)
    assert plain is not None
    assert sight is not None
    assert moved == pytest.approx(pixel)
    assert sight.known.range_m == pytest.approx(true, abs=0.05)
    assert sight.known.sigma_m == 2.0 * plain.known.sigma_m


def test_a_place_where_the_surface_ends_is_at_an_edge_and_one_with_holes_is_not() -> None:
    """Behind a crest nothing is ranged, and what is before it is one surface: a tool was put 3.3 cm off."""
    rows, columns = np.mgrid[-30:31, -30:31]
    off = np.stack((columns.ravel(), rows.ravel()), axis=1).astype(float)

    def edge_m(ranged: np.ndarray) -> float:
        return _Ranged(np.zeros(2), off[ranged], np.full(int(ranged.sum()), 8.0), 8.0).edge_m(np.zeros(2))

    assert edge_m(np.ones(len(off), dtype=bool)) == 0.0
    for way in np.radians(np.arange(0.0, 360.0, 30.0)):
        before_crest = off @ np.array((math.cos(way), math.sin(way))) <= 2.0
        assert np.mean(before_crest[np.hypot(*off.T) < EDGE_PX]) > 0.55
        assert edge_m(before_crest) == math.inf
    assert edge_m(np.random.default_rng(4).random(len(off)) < 0.7) == 0.0


def bent(at_px: float, step_m: float) -> _Ranged:
    """Return a slanted face with a step in it beside the middle."""
    rows, columns = np.mgrid[-40:41, -40:41]
    off = np.stack((columns.ravel(), rows.ravel()), axis=1).astype(float)
    away = 8.0 + 0.004 * off[:, 0] + step_m * (off[:, 0] > at_px)
    return _Ranged(np.zeros(2), off, away, 8.0)


def test_a_crest_of_a_few_centimetres_bends_what_lies_round_it_and_a_slope_does_not() -> None:
    """Four tools were claimed and wrong on targets that had begun 2 mm beside one of 3 cm."""
    assert bent(0.5, 0.0).bent_m(np.zeros(2)) == pytest.approx(0.0, abs=1e-9)
    crest = bent(0.5, 0.03)
    assert crest.edge_m(np.zeros(2)) < designation.EDGE_M
    assert crest.bent_m(np.zeros(2)) > designation.BENT_M
    assert crest.bent_m(np.array([-9.0, 0.0])) == pytest.approx(0.0, abs=1e-9)
    few = _Ranged(crest.middle, crest.off[::9], crest.away[::9], 8.0)
    assert few.bent_m(np.zeros(2)) == math.inf


def test_a_target_at_a_crest_begins_on_the_plain_face_beside_it(monkeypatch: pytest.MonkeyPatch) -> None:
    (pixel, true), seen = face()[0], designation._Ranged.bent_m
    plain, sight = off_the_edge("A", view("navcam"), pixel, view("pancam"), true)
    assert sight is not None
    assert plain == pytest.approx(pixel)

    def crest(self: _Ranged, at: Array) -> float:
        return 0.02 if np.hypot(*(at + self.middle - sight.pixel)) < reach_px else seen(self, at)

    monkeypatch.setattr(_Ranged, "bent_m", crest)
    for reach_px in (4.0, 99.0):
        moved, beside = off_the_edge("A", view("navcam"), pixel, view("pancam"), true)
        assert beside is not None
        off_px = float(np.hypot(*(moved - pixel)))
        # where there is none so near, it stays
        assert (0.5 < off_px < designation.BESIDE_PX) if reach_px < 10.0 else off_px == 0.0
