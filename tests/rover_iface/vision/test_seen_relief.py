"""A view seen from elsewhere by its own ranges: two boards, one behind the other, drawn by their geometry."""

from __future__ import annotations

import numpy as np
import pytest

from rover_iface.cameras.model import CameraModel, pinhole
from rover_iface.vision.seen_relief import SeenRelief
from rover_iface.vision.template import NccOptions, Template, TemplateMatcher
from rover_iface.vision.tracker import Image, StereoView

FAR_M, NEAR_M, HALF_M, SIDE = 9.0, 6.0, 0.06, 201
FRONT = np.array([NEAR_M, 0.0, 0.0])


def grain(seed: int) -> Image:
    rng = np.random.default_rng(seed)
    import cv2

    fine = cv2.GaussianBlur(rng.random((1200, 1200)).astype(np.float32), (0, 0), 2.5)
    return np.asarray((fine - fine.min()) / (fine.max() - fine.min()), dtype=np.float32)


BOARDS = grain(1), grain(2)


def drawn(camera: CameraModel) -> Image:
    """Return what a camera sees of a small board at 6 m before a large one at 9 m (planes of constant x)."""
    import cv2

    lines, samples = np.mgrid[0:SIDE, 0:SIDE]
    origin, rays = camera.back_project(np.column_stack((samples.ravel(), lines.ravel())).astype(float))
    out = np.zeros(SIDE * SIDE, np.float32)
    for board, depth in ((BOARDS[0], FAR_M), (BOARDS[1], NEAR_M)):
        at = origin + rays * ((depth - origin[..., 0]) / rays[:, 0])[:, None]
        on = (600 + 200 * at[:, 1:]).astype(np.float32).reshape(SIDE, SIDE, 2)
        grey = cv2.remap(board, on[..., 0], on[..., 1], cv2.INTER_CUBIC).ravel()
        hit = np.full(len(at), True) if depth == FAR_M else (np.abs(at[:, 1:]) < HALF_M).all(axis=1)
        out[hit] = grey[hit]
    return out.reshape(SIDE, SIDE)


def pair(aside_m: float) -> StereoView:
    """Return the pair that looks at the near board from `aside_m` to the left of straight ahead of it."""
    cameras = []
    for eye in (0.0, -0.2):
        centre = np.array([0.0, aside_m + eye, 0.0])
        ahead = FRONT - np.array([0.0, aside_m, 0.0])
        cameras.append(
            pinhole(
                focal_px=1100.0,
                width=SIDE,
                height=SIDE,
                center=centre,
                forward=ahead,
                up=np.array([0.0, 0.0, 1.0]),
            )
        )
    left, right = cameras
    return StereoView(drawn(left), drawn(right), left, right)


def template(view: StereoView, *, ranged: bool) -> Template:
    camera = view.left_camera
    away = float(np.linalg.norm(FRONT - camera.C))
    relief = SeenRelief(view, away) if ranged else None
    normal = np.array([-1.0, 0.0, 0.0])
    return Template(view.left, camera, camera.project(FRONT), FRONT, normal, away, relief=relief)


@pytest.mark.parametrize("aside_m", [0.6, -0.6])
def test_what_lies_behind_a_target_is_known_again_from_aside(aside_m: float) -> None:
    matcher = TemplateMatcher(NccOptions())
    before, now = pair(0.0), pair(aside_m)
    at = now.left_camera.project(FRONT)
    flat = matcher.surroundings(template(before, ranged=False), now, at, FRONT)
    seen = matcher.surroundings(template(before, ranged=True), now, at, FRONT)
    assert flat is not None
    assert seen is not None
    assert flat < 0.5
    assert seen > 0.75


def test_another_place_is_not_taken_for_the_target() -> None:
    matcher = TemplateMatcher(NccOptions())
    now = pair(0.6)
    at = now.left_camera.project(FRONT)
    for off in ((25.0, 0.0), (0.0, 25.0), (-20.0, 15.0)):
        score = matcher.surroundings(template(pair(0.0), ranged=True), now, at + off, FRONT)
        assert score is not None
        assert score < 0.45


def test_a_view_from_the_same_place_looks_as_it_did() -> None:
    view = pair(0.0)
    seen = SeenRelief(view, NEAR_M).seen_by(view.left_camera, FRONT, np.zeros(3), 20)
    assert seen is not None
    x, y = np.round(view.left_camera.project(FRONT)).astype(int)
    own = view.left[y - 20 : y + 21, x - 20 : x + 21]
    known = np.isfinite(seen)
    assert known.mean() > 0.8
    assert np.abs(seen - own)[known].mean() < 0.03
