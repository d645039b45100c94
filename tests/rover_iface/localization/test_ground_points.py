"""Points of stereo wedges: ranges without the steps and the bias of semi-global matching."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from rover_iface.cameras.model import pinhole
from rover_iface.cameras.panorama import StereoWedge
from rover_iface.localization.disparity_kernels import refine_disparities
from rover_iface.localization.ground_points import _wedge_points
from tests.seeds import drawn_seed

FOCAL_PX, BASE_M = 600.0, 0.2


def texture(rng: np.random.Generator, rows: int = 240, columns: int = 480) -> npt.NDArray[np.float64]:
    fine, coarse = (cv2.GaussianBlur(rng.normal(size=(rows, columns)), (0, 0), s) for s in (1.2, 4.0))
    return np.asarray(0.5 + 0.09 * (fine / fine.std() + coarse / coarse.std()))


def shifted(image: npt.NDArray[np.float64], by_px: float) -> npt.NDArray[np.float64]:
    """Return an image whose lines are moved to the left by a fraction, exactly (Fourier)."""
    waves = np.exp(2j * np.pi * np.fft.fftfreq(image.shape[1]) * by_px)
    return np.asarray(np.real(np.fft.ifft(np.fft.fft(image, axis=1) * waves, axis=1)))


@pytest.mark.parametrize("disparity", [20.0, 20.25, 20.4, 20.6])
def test_disparities_are_refined_to_a_thirtieth_of_a_pixel(disparity: float) -> None:
    rng = np.random.default_rng(drawn_seed())
    image = texture(rng)
    pair = [
        (one + rng.normal(0.0, 0.004, one.shape)).astype(np.float32)
        for one in (image, shifted(image, disparity))
    ]
    pixels = np.column_stack((rng.integers(60, 440, 400), rng.integers(10, 230, 400))).astype(float)
    found = np.empty(400)
    start = disparity + rng.uniform(-0.3, 0.3, 400)
    refine_disparities(pair[0], pair[1], pixels, start, (5, 3), 4, 0.8, found)
    assert abs(float(np.median(found)) - disparity) < 0.03
    assert float(np.median(np.abs(found - disparity))) < 0.06


def test_a_disparity_without_contrast_stays_as_it_was() -> None:
    grey = np.full((40, 120), 0.5, np.float32)
    found = np.empty(2)
    pixels, start = np.array([[60.0, 20.0], [2.0, 20.0]]), np.array([7.25, 7.25])
    refine_disparities(grey, grey, pixels, start, (5, 3), 4, 0.8, found)
    assert found.tolist() == [7.25, 7.25]


@pytest.mark.parametrize("disparity", [20.3, 20.65])
def test_a_wall_stands_where_it_is(disparity: float) -> None:
    image = texture(np.random.default_rng(drawn_seed()))
    left, right = (
        np.clip(np.round(255 * one), 0, 255).astype(np.uint8) for one in (image, shifted(image, disparity))
    )
    camera = pinhole(focal_px=FOCAL_PX, width=480, height=240)
    wedge = StereoWedge("wall", left, right, camera, camera.moved(np.eye(3), (0.0, -BASE_M, 0.0)))
    points, brightness, factor = _wedge_points(wedge, 2.0, 3)
    depth = float(np.median((points - camera.C) @ camera.A))
    assert factor == pytest.approx(FOCAL_PX * BASE_M)
    # 0.06 px of the disparity; semi-global matching alone is 0.2 px off here
    assert depth == pytest.approx(factor / disparity, rel=0.06 / disparity)
    assert len(points) > 5000
    # the picture of each point is its own pixel's
    sample, line = np.rint(camera.project(points)).astype(int).T
    assert brightness == pytest.approx(left[line, sample] / 255.0, abs=0.01)
