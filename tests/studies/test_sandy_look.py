"""Drifts of sand in rendered ground: how much is covered, what they hide, what they leave alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rover_iface.cameras.model import pinhole
from rover_iface.errors import RenderError
from rover_iface.simulator.render.look import SANDY, Look
from rover_iface.simulator.render.renderer import Renderer
from rover_iface.simulator.render.scene import Scene
from rover_iface.simulator.render.texture import drift, grains
from tests.rover_iface.render.scenes import SUN, ground, rock_renderer

CAMERA = pinhole(focal_px=1000, width=256, height=256, center=(-4.0, 0.5, 1.5), forward=(1.0, 0.0, -0.6))


def cover(share: float, salt: int = 5) -> float:
    rng = np.random.default_rng(11)
    return float(np.mean([drift(x, y, 0.002, share, salt) for x, y in rng.uniform(-60, 60, (6000, 2))]))


def test_sand_covers_about_the_share_that_is_asked_for() -> None:
    found = [cover(share) for share in (0.1, 0.3, 0.5, 0.7, 0.9)]
    assert found == sorted(found)
    assert np.allclose(found, (0.1, 0.3, 0.5, 0.7, 0.9), atol=0.1)


def test_sand_does_not_depend_on_the_camera_until_it_is_finer_than_a_pixel() -> None:
    near, far = (np.array([drift(0.01 * k, 0.3, f, 0.5, 3) for k in range(900)]) for f in (1e-3, 0.05))
    assert np.array_equal(near, far)
    coarse = np.array([drift(0.01 * k, 0.3, 3.0, 0.5, 3) for k in range(900)])
    assert np.ptp(coarse) == 0.0


def test_grain_is_as_strong_at_every_range_and_does_not_jump() -> None:
    places = np.random.default_rng(2).uniform(-5, 5, (4000, 2))
    spreads = [np.std([grains(x, y, f, 3) for x, y in places]) for f in (0.001, 0.0013, 0.0017, 0.004, 0.03)]
    assert np.ptp(spreads) < 0.1 * np.mean(spreads)
    below, above = ([grains(x, y, f, 3) for x, y in places[:200]] for f in (2.0**-8 - 1e-9, 2.0**-8 + 1e-9))
    assert np.allclose(below, above, atol=1e-4)


def local_spread(look: Look) -> np.ndarray:
    image = Renderer(Scene([ground()], seed=3), look=look).render(CAMERA, None, SUN, exposure=0.8).unit
    return np.asarray(image.reshape(16, 16, 16, 16).std(axis=(1, 3)).ravel())


def test_sandy_ground_has_quiet_places_between_rough_ones() -> None:
    plain, sandy = local_spread(Look()), local_spread(SANDY)
    assert np.median(sandy) < 0.7 * np.median(plain)
    assert sandy.std() / sandy.mean() > 1.3 * plain.std() / plain.mean()


def test_sand_leaves_rocks_alone() -> None:
    camera = pinhole(focal_px=400, width=256, height=256, center=(-4.0, 0.5, 1.5), forward=(4.0, -0.5, -1.2))
    pictures = [
        Renderer(rock_renderer().scene, look=look).render(camera, None, SUN, exposure=0.8, seed=1)
        for look in (Look(), SANDY)
    ]
    truth = pictures[0].truth
    rock = truth.object_index == truth.ids.index("BIG")
    soil = truth.object_index == 0
    change = np.abs(pictures[0].unit - pictures[1].unit)
    assert rock.sum() > 500
    # the lens blurs a pixel of soil into the rock's edge
    assert np.median(change[rock]) < 1e-3 < np.median(change[soil])


@pytest.mark.parametrize(
    ("name", "value"), [("sand", 1.2), ("sand", math.nan), ("soil_mottle", -0.1), ("grain", 1.5)]
)
def test_a_look_that_cannot_be_is_refused(name: str, value: float) -> None:
    with pytest.raises(RenderError, match=str(value)):
        Look(**{name: value})
