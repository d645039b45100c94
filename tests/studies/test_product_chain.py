"""A rendered picture becomes a product as the label of a real one says that it did."""

from __future__ import annotations

import numpy as np
import pytest

from rover_iface.cameras.labels import read_product
from rover_iface.cameras.model import pinhole
from studies.common.product_chain import (
    ROW_EDGE,
    Product,
    fall_off,
    product_of,
    row_edges,
    shared_pattern,
    through_mosaic,
    wavelet_coded,
)
from tests.shared import shared

CAMERA = pinhole(focal_px=1200.0, width=256, height=192, center=(0.0, 0.0, 1.5), forward=(0.94, 0.0, -0.34))


def test_frames_of_one_sensor_share_its_row_edges_and_nothing_else() -> None:
    rng = np.random.default_rng(5)
    gains = row_edges((400, 400), 3)
    first, second = (
        (1000.0 * gains * (1.0 + rng.normal(0.0, 0.01, gains.shape))).astype(np.float32) for _ in range(2)
    )
    other = (1000.0 * row_edges((400, 400), 4)).astype(np.float32)
    assert shared_pattern(first, second) == pytest.approx(2.0 * ROW_EDGE**2, rel=0.15)
    assert shared_pattern(first, second, rows=1) == pytest.approx(-(ROW_EDGE**2), rel=0.2)
    assert abs(shared_pattern(first, second, rows=3)) < 0.1 * ROW_EDGE**2
    assert abs(shared_pattern(first, other)) < 0.1 * ROW_EDGE**2


def test_the_row_edges_are_those_of_spirits_navcam() -> None:
    folder = shared("data/imagery/mer")
    first, second = (
        np.asarray(read_product(folder / f"2n2922809{n}effb100p0703l0m1.img.gz").image, np.float32)[100:900]
        for n in (38, 89)
    )
    assert shared_pattern(first, second) == pytest.approx(2.0 * ROW_EDGE**2, rel=0.1)
    assert shared_pattern(first, second, rows=1) == pytest.approx(-(ROW_EDGE**2), rel=0.1)
    assert abs(shared_pattern(first, second, rows=2)) < 0.1 * ROW_EDGE**2


@pytest.mark.parametrize(
    ("name", "linearised", "averaged", "bits", "flat"),
    [
        ("mer/2n292280938effb100p0703l0m1.img.gz", False, 1, 3.0, False),
        ("mer/1n579700548ffld2fcp1981l0m1.img.gz", True, 1, 1.0, False),
        ("mer/1f581291004ednd2fcp1121r0m1.img.gz", False, 2, 1.1, False),
        ("msl/NRB_701384494RAD_F0933408NCAM00200M1.IMG.gz", False, 1, 2.0, True),
    ],
)
def test_a_label_tells_how_its_picture_came_about(
    name: str, linearised: bool, averaged: int, bits: float, flat: bool
) -> None:
    told = product_of(read_product(shared("data/imagery") / name).label)
    assert (told.linearised, told.averaged, told.flat) == (linearised, averaged, flat)
    assert told.bits_per_pixel == pytest.approx(bits, abs=0.05)
    assert told.exposure is not None
    assert 0.2 < told.exposure.cut < 0.6


def test_an_averaged_product_sees_what_its_pixels_see() -> None:
    """The middle of a block of rendered pixels looks where the product's pixel does."""
    rendered = Product(averaged=2).camera(CAMERA)
    assert (rendered.width, rendered.height) == (512, 384)
    points = CAMERA.C + np.array([[4.0, 0.1, -1.3], [6.0, -0.5, -1.4]])
    assert np.allclose((rendered.project(points) - 0.5) / 2.0, CAMERA.project(points))


def test_a_linearised_product_is_taken_by_a_camera_that_distorts() -> None:
    taken = Product(linearised=True).camera(CAMERA)
    corner = CAMERA.back_project(np.array([0.0, 0.0]))[1]
    assert 0.001 < np.linalg.norm(taken.project(CAMERA.C + 9.0 * corner)) < 5.0


def test_the_coder_keeps_grey_and_loses_detail_with_the_rate() -> None:
    rng = np.random.default_rng(2)
    grey = np.clip(1500.0 + 200.0 * rng.standard_normal((256, 256)), 0, 4095).astype(np.float32)
    lost = [float(np.std(wavelet_coded(grey, rate) - grey)) for rate in (1.0, 3.0, 7.0)]
    assert lost[0] > 2.0 * lost[1] > 4.0 * lost[2] > 0.0
    assert abs(float(np.mean(wavelet_coded(grey, 1.0) - grey))) < 5.0


def test_a_mosaic_keeps_what_is_even_and_smooths_a_pixel() -> None:
    even = np.full((64, 64), 700.0, np.float32)
    assert np.allclose(through_mosaic(even), even)
    spot = np.zeros((64, 64), np.float32)
    spot[30, 30] = 1.0
    assert 0.2 < float(through_mosaic(spot).max()) < 0.6


def test_light_falls_off_with_the_fourth_power_of_the_cosine_unless_a_lens_is_a_fisheye() -> None:
    _, rays = CAMERA.back_project(np.array([[128.0, 96.0], [3.0, 5.0]]))
    found = fall_off(CAMERA)
    cosines = rays @ CAMERA.A
    assert found[5, 3] / found[96, 128] == pytest.approx((cosines[1] / cosines[0]) ** 4, rel=1e-3)
    label = read_product(shared("data/imagery/mer/1f581291004ednd2fcp1121r0m1.img.gz"))
    hazcam = fall_off(label.camera)
    corner = label.camera.back_project(np.array([20.0, 250.0]))[1] @ label.camera.O
    assert 2.0 * corner**4 < hazcam[250, 20] < corner
