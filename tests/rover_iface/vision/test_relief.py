"""Alignment over a surface with relief: speckled pictures that are displaced as relief displaces them."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from rover_iface.vision.patch import align_shape
from rover_iface.vision.relief import ReliefOptions, align_relief
from rover_iface.vision.tracker import Image

ALONG = np.array([0.6, 0.8])
SIDE, MIDDLE = 121, 60.0
HALF = 25


def speckle(seed: int) -> Image:
    """Return a picture (121, 121) with spots of several sizes, 0.2 to 0.8."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(SIDE, SIDE)).astype(np.float32)
    spots = sum(s * cv2.GaussianBlur(noise, (0, 0), s) for s in (1.5, 3.0, 6.0))
    low, high = float(spots.min()), float(spots.max())
    return np.asarray(0.2 + 0.6 * (spots - low) / (high - low), dtype=np.float32)


def displaced(picture: Image, by_range_px: npt.NDArray[np.float64], shift: tuple[float, float]) -> Image:
    """Return the picture with each pixel moved by a shift, and along `ALONG` by so much."""
    v, u = np.mgrid[0:SIDE, 0:SIDE].astype(np.float64)
    x = (u - shift[0] - ALONG[0] * by_range_px).astype(np.float32)
    y = (v - shift[1] - ALONG[1] * by_range_px).astype(np.float32)
    return np.asarray(cv2.remap(picture, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT))


def template(picture: Image) -> Image:
    middle = int(MIDDLE)
    cut = slice(middle - HALF, middle + HALF + 1)
    return np.ascontiguousarray(picture[cut, cut])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_another_exposure_and_contrast_do_not_move_the_place(seed: int) -> None:
    picture = speckle(seed)
    seen = displaced(picture, np.zeros((SIDE, SIDE)), (0.4, -0.3))
    seen = (0.8 * seen**1.3 + np.random.default_rng(seed).normal(0, 0.005, seen.shape)).astype(np.float32)
    found = align_relief(seen, template(picture), np.full(2, MIDDLE), ALONG, ReliefOptions())
    assert found is not None
    assert found.score > 0.95
    assert np.abs(found.pixel - MIDDLE - (0.4, -0.3)).max() < 0.06


@pytest.mark.parametrize("seed", [4, 5, 6])
def test_ground_behind_an_edge_does_not_drag_the_place_along(seed: int) -> None:
    picture = speckle(seed)
    behind = np.zeros((SIDE, SIDE))
    behind[: int(MIDDLE) - 6] = 5.0
    seen = displaced(picture, behind, (0.0, 0.0))
    found = align_relief(seen, template(picture), np.full(2, MIDDLE), ALONG, ReliefOptions())
    assert found is not None
    assert np.hypot(*(found.pixel - MIDDLE)) < 0.08


@pytest.mark.parametrize("seed", [7, 8, 9])
def test_a_bent_surface_is_followed_where_a_plane_is_dragged_along(seed: int) -> None:
    picture = speckle(seed)
    v, u = np.mgrid[0:SIDE, 0:SIDE] - MIDDLE
    bend = 2.0 * (u * u + v * v) / 20.0**2
    seen = displaced(picture, bend, (0.0, 0.0))
    found = align_relief(seen, template(picture), np.full(2, MIDDLE), ALONG, ReliefOptions())
    plane = np.full(2, MIDDLE)
    align_shape(seen, template(picture), plane, 20, 0.1, 2.5, np.empty((2, 2)))
    assert found is not None
    assert np.hypot(*(found.pixel - MIDDLE)) < 0.12
    assert np.hypot(*(plane - MIDDLE)) > 2.0 * np.hypot(*(found.pixel - MIDDLE))


def test_a_window_that_leaves_the_picture_gives_no_place() -> None:
    picture = speckle(10)
    assert align_relief(picture, template(picture), np.array([3.0, 60.0]), ALONG, ReliefOptions()) is None
    assert align_relief(picture, template(picture), np.array([-40.0, 60.0]), ALONG, ReliefOptions()) is None
