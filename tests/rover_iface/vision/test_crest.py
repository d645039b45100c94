"""What the error of a pixel leaves open of a target whose surface is deep there."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rover_iface.cameras.model import Array, pinhole
from rover_iface.frames import Transform
from rover_iface.vision.handoff_cascade import Answer
from rover_iface.vision.narrow import crest
from rover_iface.vision.narrow.crest import (
    ASIDE,
    Shown,
    beside_m,
    edge_before,
    open_along_m,
    open_depth_m,
    range_error_m,
)
from rover_iface.vision.narrow.references import Kept

CAMERA = pinhole(focal_px=1000.0, width=400, height=400)
RIGHT = pinhole(focal_px=1000.0, width=400, height=400, center=(0.0, -0.2, 0.0))
AWAY_M, STEP_M, EDGE_PX = 2.0, 0.03, 4.5
MIDDLE = np.array([200.0, 200.0])


def pair(step_m: float = STEP_M) -> Any:
    """Return a pair that ranges a face, and some pixels right of the middle what lies behind it."""
    at = np.arange(150.0, 251.0)
    pixels = np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)
    away = AWAY_M + step_m * (pixels[:, 0] > MIDDLE[0] + EDGE_PX)
    points = []
    for pixel, range_m in zip(pixels, away, strict=True):
        eye, ray = CAMERA.back_project(pixel)
        points.append(eye + range_m * ray)
    view = SimpleNamespace(left_camera=CAMERA, right_camera=RIGHT, t_s=0.0)
    return SimpleNamespace(cloud=SimpleNamespace(points=np.array(points)), view=view)


def test_the_depth_that_is_open_grows_with_what_the_pixel_is_off() -> None:
    step, face = pair(), pair(0.0)
    told = [open_depth_m(step, MIDDLE, AWAY_M, off_px) for off_px in (0.5, 2.0, 4.0, 8.0)]
    # the share of a normal distribution that lies beyond the edge is STEP_M deeper
    for depth_m, off_px in zip(told[1:], (2.0, 4.0, 8.0), strict=True):
        beyond = 0.5 * math.erfc(EDGE_PX / off_px / math.sqrt(2.0))
        noise_m = range_error_m(step.view, AWAY_M)
        assert math.hypot(depth_m, noise_m) == pytest.approx(STEP_M * math.sqrt(beyond), rel=0.05)
    assert told[0] < 0.003 < 0.01 < told[2]
    # what lies behind an outline is another surface, which the cascade refuses
    assert open_depth_m(pair(0.5), MIDDLE, AWAY_M, 8.0) == open_depth_m(pair(0.05), MIDDLE, AWAY_M, 8.0)
    assert [open_depth_m(face, MIDDLE, AWAY_M, off_px) for off_px in (0.5, 8.0)] == pytest.approx([0.0, 0.0])
    # a face that is ranged elsewhere than the target is as far off
    told_m = open_depth_m(face, MIDDLE, AWAY_M - 0.02, 2.0)
    assert math.hypot(told_m, range_error_m(face.view, AWAY_M - 0.02)) == pytest.approx(0.02)


def test_a_pair_that_ranges_nothing_there_tells_no_depth() -> None:
    step = pair()
    assert open_depth_m(step, np.array([100.0, 100.0]), AWAY_M, 2.0) == 0.0
    step.cloud = None
    assert open_depth_m(step, MIDDLE, AWAY_M, 2.0) == 0.0


def answer(error_px: float) -> tuple[Answer, Array]:
    eye, ray = CAMERA.back_project(MIDDLE)
    place = np.asarray(eye + AWAY_M * ray)
    none = np.empty((0, 2))
    told = error_px, Transform.identity(), 120, 0.9
    return Answer(MIDDLE, place, *told, none, none, np.empty((0, 4))), ray


def kept(place: Array, ray: Array, turned_rad: float, sigma_m: float) -> Kept:
    """Return a pair that has a target at a place (3,) from a line of sight turned from a ray (3,)."""
    side = np.cross(ray, (0.0, 0.0, 1.0))
    side /= np.linalg.norm(side)
    eye = place - 2.0 * (math.cos(turned_rad) * ray + math.sin(turned_rad) * side)
    view: Any = SimpleNamespace(view=SimpleNamespace(left_camera=SimpleNamespace(C=eye), t_s=0.0))
    return Kept(view, MIDDLE, place, sigma_m)


def shown(told: Answer, kept: Kept, side: Any) -> Shown:
    """Return what an answer leaves open where the kept picture's own line of sight leaves nothing open."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(crest, "surface_under", lambda *_: None)
        return Shown.of(told, kept, side, CAMERA)


def test_an_answer_leaves_open_what_the_kept_pixel_does_and_how_deep_the_surface_is_there() -> None:
    told, ray = answer(0.5)
    px_m = AWAY_M / CAMERA.hs
    one = shown(told, kept(told.position, ray, 0.0, 0.004), pair())
    sigma_m = math.hypot(0.5 * px_m, 0.004)
    assert one.across_m == pytest.approx(sigma_m)
    assert one.deep_m == pytest.approx(open_depth_m(pair(), MIDDLE, AWAY_M, sigma_m / px_m), rel=0.01)
    assert float(ray @ one.covariance @ ray) == pytest.approx(one.across_m**2 + one.deep_m**2)
    # a chain of pairs that each add little knows the target worse and worse, at a crest in range above all
    chain = [one]
    for _ in range(4):
        chain.append(shown(told, kept(told.position, ray, 0.0, chain[-1].across_m), pair()))
    assert np.all(np.diff([shown.across_m for shown in chain]) > 0.0)
    assert np.all(np.diff([shown.deep_m for shown in chain]) > 0.0)


def test_a_line_of_sight_from_the_side_meets_a_deep_surface_beside_the_target() -> None:
    told, ray = answer(0.5)
    straight, aside = (shown(told, kept(told.position, ray, turn, 0.004), pair()) for turn in (0.0, 0.7))
    assert aside.deep_m == straight.deep_m
    # what the pair ranges wrongly is met there too
    noise_m = range_error_m(pair().view, AWAY_M)
    deep_m = math.hypot(aside.deep_m, noise_m)
    assert aside.across_m == pytest.approx(math.hypot(straight.across_m, beside_m(deep_m, 0.7)))
    assert beside_m(0.02, math.pi / 2.0) == pytest.approx(ASIDE * 0.02)
    flat = shown(told, kept(told.position, ray, 0.7, 0.004), pair(0.0))
    assert flat.across_m == pytest.approx(math.hypot(straight.across_m, beside_m(noise_m, 0.7)), rel=1e-3)
    assert straight.same_spot(aside)


def met_beyond(edge_px: float, step_m: float) -> Any:
    """Return what gives where the rays of a camera meet a face that ends right of the middle, beyond which
    another lies a step farther off, as a new pair ranges them.
    """

    def under(_side: Any, camera: Any, pixel: Array) -> tuple[Array, None]:
        eye, ray = camera.back_project(pixel)
        return eye + (AWAY_M + step_m * (pixel[0] > MIDDLE[0] + edge_px)) * ray, None

    return under


@pytest.mark.parametrize(("edge_px", "step_m", "beyond"), [
    (1.5, 0.02, 3), (9.0, 0.02, 0), (0.5, 0.02, 3), (0.5, -0.02, 3), (-99.0, 0.0, 0), (1.5, 0.2, 0),
])  # fmt: skip
def test_a_crest_of_the_kept_picture_is_one_though_the_new_pair_sees_a_plain_face(
    edge_px: float, step_m: float, beyond: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pixel 3 mm beside a target had it 1.8 cm before its place, along a line of sight that was 45 degrees
    aside; the new pair saw the crest face on and told 4 mm, and a tool was put down 2 cm beside.
    """
    told, ray = answer(0.1)
    monkeypatch.setattr(crest, "surface_under", met_beyond(edge_px, step_m))
    side, aside = pair(0.0), math.radians(45.0)
    noise_m = range_error_m(side.view, AWAY_M)
    along_m = math.sqrt(max(0.0, step_m**2 * beyond / 8.0 - noise_m**2))
    assert open_along_m(side, CAMERA, MIDDLE, told.position, 0.004) == pytest.approx(along_m, abs=2e-5)
    flat, one = (Shown.of(told, kept(told.position, ray, turn, 0.004), side, CAMERA) for turn in (0.0, aside))
    assert flat.across_m == pytest.approx(math.hypot(0.1 * AWAY_M / CAMERA.hs, 0.004))
    met_m = max(along_m * math.sin(aside), beside_m(noise_m, aside))
    assert one.across_m == pytest.approx(math.hypot(flat.across_m, met_m), rel=1e-3)


@pytest.mark.parametrize(("before_m", "off_px", "edge"), [
    (0.12, 2.0, True), (0.12, 6.0, False), (0.02, 2.0, False), (-0.12, 2.0, False),
])  # fmt: skip
def test_a_line_of_sight_that_touches_something_before_the_target_is_told(
    before_m: float, off_px: float, edge: bool
) -> None:
    """The pixel of a stone before a rock, seen from the side, was taken for one of the rock's face."""
    seen = pair(0.0)
    told, _ = answer(0.5)
    rays = [CAMERA.back_project(MIDDLE + np.array((off_px, n))) for n in (-0.5, 0.0, 0.5)]
    stone = [eye + (AWAY_M - before_m) * ray for eye, ray in rays]
    seen.cloud.points = np.vstack((seen.cloud.points, stone))
    assert edge_before(seen, CAMERA, MIDDLE, told.position) is edge
