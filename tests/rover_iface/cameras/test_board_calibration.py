"""Calibration from boards: OpenCV's own pictures, its published figures, and boards that are left out."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from rover_iface.cameras import board_calibration
from rover_iface.cameras.board_calibration import Board, calibrate
from rover_iface.cameras.calibrated import CALIBRATIONS, CalibratedPair, _met, _projected
from rover_iface.errors import CameraError
from tests.seeds import drawn_seed
from tests.shared import shared

BOARD = Board(9, 6, 0.025)
PLACES = np.array([[0.0, 0.0, 1.0], [0.2, 0.1, 1.5], [0.0, 0.0, 3.0], [-0.8, 0.4, 3.0]])


@lru_cache(maxsize=1)
def pictures() -> tuple[list[npt.NDArray[np.uint8]], list[npt.NDArray[np.uint8]]]:
    folder = shared("data/imagery/opencv")
    lefts, rights = (
        [np.asarray(Image.open(p).convert("L")) for p in sorted(folder.glob(f"{side}[0-9]*.jpg"))]
        for side in ("left", "right")
    )
    return lefts, rights


@lru_cache(maxsize=1)
def calibrated() -> CalibratedPair:
    return calibrate(*pictures(), BOARD).pair


def test_focal_length_and_centre_are_near_those_published() -> None:
    # left_intrinsics.yml beside the pictures: the left camera alone, with a term k3 that ours leaves at 0
    pair = calibrated()
    sigma = np.sqrt(np.diag(np.array(pair.covariance)))
    assert pair.boards == 13
    assert pair.rms_px < 0.4
    published = np.array([535.91573396, 535.91573396, 342.28315473, 235.57082910])
    assert np.abs(pair.parameters[:4] - published).max() < 3.0
    assert 0.3 < sigma[0] < 3.0


def test_two_halves_of_the_boards_differ_by_what_their_covariances_tell() -> None:
    seed = drawn_seed()
    rng = np.random.default_rng(seed)
    lefts, rights = pictures()
    pixels = _projected(calibrated().parameters, PLACES)
    times = []
    for _ in range(4):
        order = rng.permutation(len(lefts))
        halves = [
            calibrate([lefts[k] for k in part], [rights[k] for k in part], BOARD).pair
            for part in (order[:6], order[6:12])
        ]
        ranges = [_met(half.parameters, *pixels)[:, 2] for half in halves]
        told = [half.point_errors(PLACES)[:, 2, 2] for half in halves]
        times.append((ranges[0] - ranges[1]) / np.sqrt(told[0] + told[1]))
    rms = float(np.sqrt(np.mean(np.square(times))))
    assert 0.2 < rms < 2.0, f"seed {seed}: {rms:.2f} of what was told"


def test_derivatives_of_the_corners_are_those_of_differences() -> None:
    at, pose = calibrated().parameters, np.array([0.2, 0.3, 0.01, -0.07, -0.1, 0.4])
    _, jacobian = board_calibration._rows(at, BOARD.points, pose)
    all_ = np.concatenate((at, pose))
    for k in range(len(all_)):
        step = 1e-6 * max(1.0, abs(all_[k]))
        ends = []
        for sign in (1.0, -1.0):
            moved = all_.copy()
            moved[k] += sign * step
            ends.append(board_calibration._rows(moved[:22], BOARD.points, moved[22:])[0])
        difference = (ends[0] - ends[1]) / (2 * step)
        assert np.abs(difference - jacobian[:, k]).max() < 1e-6 * max(
            1.0, float(np.abs(jacobian[:, k]).max())
        )


def test_errors_of_points_are_those_of_drawn_calibrations() -> None:
    pair = calibrated()
    rng = np.random.default_rng(3)
    covariance = 0.01 * np.array(pair.covariance)
    drawn = rng.multivariate_normal(pair.parameters, covariance, 3000, method="cholesky")
    pixels = _projected(pair.parameters, PLACES)
    met = np.array([_met(p, *pixels) for p in drawn])
    small = replace(pair, covariance=tuple(tuple(row) for row in covariance))
    told = small.point_errors(PLACES)
    for k in range(len(PLACES)):
        assert np.trace(np.cov(met[:, k].T)) == pytest.approx(np.trace(told[k]), rel=0.1)


def test_a_calibration_is_read_back_as_it_was() -> None:
    again = CALIBRATIONS.read(CALIBRATIONS.write(calibrated()))
    assert again == calibrated()
    with pytest.raises(CameraError, match="covariance"):
        CALIBRATIONS.from_document({**CALIBRATIONS.document(calibrated()), "covariance": [[1.0]]})


def test_wrong_boards_and_pictures_are_told() -> None:
    lefts, rights = pictures()
    with pytest.raises(CameraError, match="only 0 of 13 pairs show the whole board of 8 x 8 inner"):
        calibrate(lefts, rights, Board(8, 8, 0.025))
    with pytest.raises(CameraError, match="12 right pictures"):
        calibrate(lefts, rights[1:], BOARD)
    with pytest.raises(CameraError, match="of one size"):
        calibrate(lefts, [*rights[1:], rights[0][::2, ::2]], BOARD)
    with pytest.raises(CameraError, match="only 4 of 4 pairs"):
        calibrate(lefts[:4], rights[:4], BOARD)
    with pytest.raises(CameraError, match="fit to"):
        calibrate(lefts, [*rights[1:], rights[0]], BOARD)
    with pytest.raises(CameraError, match="positive side"):
        Board(9, 6, 0.0)
    blank = [np.full_like(lefts[0], 90), *lefts[1:]]
    assert calibrate(blank, rights, BOARD).without_board == (0,)
