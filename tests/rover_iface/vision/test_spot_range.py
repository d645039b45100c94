"""One spot's range beside an outline, and what is kept to."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from rover_iface.cameras.model import Array, pinhole
from rover_iface.vision.spot_range import range_spot
from rover_iface.vision.tracker import StereoView

FOCAL, BASELINE_M, NEAR_M, FAR_M = 1120.0, 0.2, 5.0, 9.0
EDGE = 100


def grain(seed: int) -> npt.NDArray[np.float64]:
    """Return a picture of ground, blurred to what a lens shows, 40 columns wider than the frame."""
    import cv2

    rough = np.random.default_rng(seed).normal(0.0, 0.25, (200, 240))
    return np.asarray(cv2.GaussianBlur(rough, (0, 0), 1.0)) + 0.5


def seen(shift_near: float, shift_far: float, seed: int) -> npt.NDArray[np.float32]:
    """Return what a camera shows of a slab in front of a wall; the slab ends at `EDGE` less its shift."""
    lines, samples = np.mgrid[0:200, 0:200].astype(np.float32)
    import cv2

    near = cv2.remap(grain(1).astype(np.float32), samples + np.float32(shift_near), lines, cv2.INTER_CUBIC)
    far = cv2.remap(
        0.7 * grain(2).astype(np.float32) + 0.3, samples + np.float32(shift_far), lines, cv2.INTER_CUBIC
    )
    share = np.clip(samples - (EDGE - shift_near) + 0.5, 0.0, 1.0)
    noise = np.random.default_rng(seed).normal(0.0, 0.004, near.shape)
    return np.asarray(share * near + (1.0 - share) * far + noise, dtype=np.float32)


@pytest.fixture(scope="module")
def pair() -> StereoView:
    """Return what both cameras see, the right one `BASELINE_M` to the right."""
    left, right = (
        pinhole(focal_px=FOCAL, width=200, height=200, center=(0.0, -aside, 0.0))
        for aside in (0.0, BASELINE_M)
    )
    unit = FOCAL * BASELINE_M
    return StereoView(seen(0.0, 0.0, 3), seen(unit / NEAR_M, unit / FAR_M, 4), left, right)


def disparity(view: StereoView, point: Array) -> float:
    return float(view.left_camera.project(point)[0] - view.right_camera.project(point)[0])


@pytest.mark.parametrize("line", [40.0, 70.0, 100.0, 130.0, 160.0])
@pytest.mark.parametrize("inside_px", [3.0, 5.0])
def test_a_spot_just_inside_an_outline_has_the_range_of_its_own_side(
    pair: StereoView, line: float, inside_px: float
) -> None:
    found = range_spot(pair, np.array([EDGE + inside_px, line]), [NEAR_M], 4.0)
    assert found is not None
    off_px = disparity(pair, found.point) - FOCAL * BASELINE_M / NEAR_M
    assert abs(off_px) < 0.25
    assert abs(off_px) < 3.0 * math.sqrt(found.disparity_px2)


def test_a_range_that_is_far_off_is_mended_by_another_that_is_proposed(pair: StereoView) -> None:
    """Two of 400 rock points began 28 px of disparity off: the dense cloud had them right."""
    spot = np.array([EDGE + 12.0, 90.0])
    alone = range_spot(pair, spot, [12.0], 4.0)
    both = range_spot(pair, spot, [12.0, NEAR_M + 0.1], 4.0)
    assert both is not None
    assert np.linalg.norm(both.point - pair.left_camera.C) == pytest.approx(NEAR_M, rel=0.03)
    assert alone is None or alone.score < both.score


def test_what_no_plane_explains_is_told_to_be_badly_known(pair: StereoView) -> None:
    spot = np.array([EDGE + 12.0, 90.0])
    noise = np.random.default_rng(9).random(pair.right.shape).astype(np.float32)
    good, bad = (
        range_spot(pair, spot, [NEAR_M], 4.0),
        range_spot(replace(pair, right=noise), spot, [NEAR_M], 4.0),
    )
    assert good is not None
    assert bad is None or (bad.disparity_px2 > 4.0 * good.disparity_px2 and bad.score < 0.5 * good.score)


@pytest.mark.parametrize("bright", [0.03, 1.0])
def test_bare_noise_tells_no_range(pair: StereoView, bright: float) -> None:
    """Faces in a cast shadow and bleached ones were told to 0.2 px and lay up to 2 px off."""
    rng = np.random.default_rng(11)
    off, told = [], []
    for _ in range(40):
        left, right = (
            np.clip(bright + rng.normal(0.0, 0.003, pair.left.shape), 0.0, 1.0).astype(np.float32)
            for _ in range(2)
        )
        flat = replace(pair, left=left, right=right)
        found = range_spot(flat, np.array([100.0, 90.0]), [NEAR_M * rng.uniform(0.95, 1.05)], 4.0)
        if found is not None:
            off.append(disparity(flat, found.point) - FOCAL * BASELINE_M / NEAR_M)
            told.append(math.sqrt(found.disparity_px2))
    astray = np.abs(off) > 3.0 * np.array(told)
    assert astray.mean() < 0.05
    assert np.median(told) > 1.0


def test_texture_tells_a_range_in_spite_of_noise(pair: StereoView) -> None:
    """What noise takes off is little where there is grain: 0.1 px is the least that is ever told."""
    found = range_spot(pair, np.array([EDGE + 40.0, 90.0]), [NEAR_M], 4.0)
    assert found is not None
    assert found.disparity_px2 < 0.2**2


def test_a_spot_keeps_to_the_range_that_is_expected(pair: StereoView) -> None:
    """A place 6 px of disparity beside that looks just like the spot's own is not asked."""
    spot = np.array([EDGE + 40.0, 90.0])
    at = round(EDGE + 40.0 - FOCAL * BASELINE_M / NEAR_M)
    right = pair.right.copy()
    right[80:101, at - 18 : at - 2] = pair.left[80:101, EDGE + 28 : EDGE + 44]
    found = range_spot(replace(pair, right=right), spot, [NEAR_M], 4.0)
    assert found is not None
    assert abs(disparity(pair, found.point) - FOCAL * BASELINE_M / NEAR_M) < 4.0


def test_a_spot_at_the_frames_edge_is_not_ranged(pair: StereoView) -> None:
    assert range_spot(pair, np.array([2.0, 2.0]), [NEAR_M], 4.0) is None
