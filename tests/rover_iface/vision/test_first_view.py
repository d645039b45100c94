"""Drift measured against the first view: a board seen from two places, the spot put astray by a known way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rover_iface.vision.first_view import measured_drift
from rover_iface.vision.seen_relief import SeenRelief
from rover_iface.vision.template import NccOptions, Template, TemplateMatcher
from tests.rover_iface.vision.test_seen_relief import FAR_M, FRONT, pair

SPOT = np.array([FAR_M, 0.25, 0.1])
FACE = np.array([-1.0, 0.0, 0.0])


def seen(aside_m: float, spot: np.ndarray, drift_m: float) -> Template:
    """Return a view of the far board with a spot on it, known to `drift_m` by the chain of matches."""
    view = pair(aside_m)
    camera = view.left_camera
    away = float(np.linalg.norm(spot - camera.C))
    drift = drift_m**2 * np.diag([0.0, 1.0, 1.0])
    return Template(view.left, camera, camera.project(spot), spot, FACE, away, drift)


@pytest.mark.parametrize("astray", [(0.008, 0.0), (0.0, -0.006), (-0.005, 0.005)])
def test_what_a_chain_has_drifted_is_found_in_the_first_view(astray: tuple[float, float]) -> None:
    matcher = TemplateMatcher(NccOptions())
    off = np.array([0.0, *astray])
    found = measured_drift(matcher, seen(0.0, SPOT, 0.0), seen(0.4, SPOT + off, 0.02))
    assert found is not None
    assert found.off == pytest.approx(off, abs=0.0015)
    assert np.sqrt(np.linalg.eigvalsh(found.drift)[-1]) < 0.004


def test_a_chain_that_knows_better_is_left_as_it_is() -> None:
    matcher = TemplateMatcher(NccOptions())
    now = seen(0.4, SPOT, 0.00002)
    found = measured_drift(matcher, seen(0.0, SPOT, 0.0), now)
    assert found is not None
    assert np.linalg.norm(found.off) == 0.0
    assert np.trace(found.drift) >= np.trace(now.drift)


def test_a_contradiction_is_told_in_full() -> None:
    matcher = TemplateMatcher(NccOptions())
    off = np.array([0.0, 0.01, 0.0])
    found = measured_drift(matcher, seen(0.0, SPOT, 0.0), seen(0.4, SPOT + off, 0.0005))
    assert found is not None
    assert found.squared > 5.991
    assert np.sqrt(np.linalg.eigvalsh(found.drift)[-1]) > 0.008


def test_another_place_is_no_measurement() -> None:
    matcher = TemplateMatcher(NccOptions())
    now = seen(0.4, SPOT + np.array([0.0, 0.08, -0.05]), 0.02)
    assert measured_drift(matcher, seen(0.0, SPOT, 0.0), now) is None
    flat = replace(now, image=np.full_like(now.image, 0.5))
    assert measured_drift(matcher, seen(0.0, SPOT, 0.0), flat) is None


@pytest.mark.parametrize("aside", [0.04, 0.05])
def test_where_a_plane_leads_nowhere_the_ranges_of_now_measure(aside: float) -> None:
    """A spot beside the edge of the near board: half of what surrounds it lies 3 m deeper."""
    matcher = TemplateMatcher(NccOptions())
    spot, off = FRONT + np.array([0.0, aside, 0.0]), np.array([0.0, -0.006, 0.004])
    first, now = seen(0.0, spot, 0.0), replace(seen(0.5, spot + off, 0.03), depth_m2=0.05**2)
    assert measured_drift(matcher, first, now) is None
    found = measured_drift(
        matcher, first, replace(now, ranged_m2=0.002**2, relief=SeenRelief(pair(0.5), 6.0))
    )
    assert found is not None
    told_m = float(np.sqrt(np.trace(found.drift + found.parallax @ found.parallax.T)))
    assert told_m < 0.005
    assert float(np.linalg.norm(found.off - off)) < 3.0 * told_m


def test_what_another_camera_sees_smaller_is_averaged_and_not_picked() -> None:
    """From four times as far, a pixel shows the mean of sixteen; one of them by itself is noise."""
    view = pair(0.0)
    relief = SeenRelief(view, FAR_M)
    small = view.left_camera.scaled(0.25)
    spot = np.array([FAR_M, 0.45, 0.3])
    shown = relief.seen_by(small, spot, np.zeros(3), 5)
    assert shown is not None
    line, sample = (round(float(v)) for v in view.left_camera.project(spot)[::-1])
    around = view.left[line - 22 : line + 23, sample - 22 : sample + 23]
    known = shown[np.isfinite(shown)]
    assert len(known) > 60
    assert known.std() < 0.9 * around.std()
    assert abs(float(known.mean() - around.mean())) < 0.05
