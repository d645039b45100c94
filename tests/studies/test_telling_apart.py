"""Pictures told apart: statistics of patches, splits without leaks, the frames and their masks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from studies.common import telling_apart
from studies.common.patch_statistics import (
    NAMES,
    PATCH_PX,
    half_size,
    local_binary_patterns,
    patch_statistics,
)
from studies.common.real_frames import FRAMES, load_view
from studies.common.telling_apart import auc, crossed, feature_aucs, paired, tell_apart
from tests.shared import shared


def slow_pattern(grey: np.ndarray, row: int, column: int, r: int) -> int:
    """The definition, pixel by pixel: a string of signs round the pixel, its changes counted."""
    ring = [(-r, -r), (-r, 0), (-r, r), (0, r), (r, r), (r, 0), (r, -r), (0, -r)]
    up = [grey[row + i, column + j] > grey[row, column] for i, j in ring]
    changes = sum(a != b for a, b in zip(up, up[1:] + up[:1], strict=True))
    return sum(up) if changes <= 2 else 9


@pytest.mark.parametrize("radius", [1, 3])
def test_binary_patterns_follow_their_definition(radius: int) -> None:
    grey = np.random.default_rng(4).integers(0, 12, (20, 24)).astype(np.float32)
    found = local_binary_patterns(grey, radius)
    for row in range(radius, 20 - radius):
        for column in range(radius, 24 - radius):
            assert found[row, column] == slow_pattern(grey, row, column, radius)


def test_the_area_under_the_curve_counts_pairs() -> None:
    rng = np.random.default_rng(6)
    first, second = rng.integers(0, 9, 31).astype(float), rng.integers(2, 11, 17).astype(float)
    pairs = [0.5 if a == b else float(b > a) for a in first for b in second]
    assert auc(first, second) == pytest.approx(sum(pairs) / len(pairs))


def ground(seed: int, rows: int = 256, columns: int = 320) -> np.ndarray:
    import cv2

    rough = np.random.default_rng(seed).normal(size=(rows, columns)).astype(np.float32)
    return np.asarray(40.0 + 10.0 * cv2.GaussianBlur(rough, (0, 0), 1.2))


def test_statistics_know_neither_gain_nor_what_lies_off_the_ground() -> None:
    mask = np.zeros((256, 320), bool)
    mask[32:224, 32:288] = True
    image = ground(1)
    other = np.where(mask, 3.0 * image, 4000.0).astype(np.float32)
    found = [patch_statistics(i, mask, most=9, rng=np.random.default_rng(0)) for i in (image, other)]
    assert found[0].values.shape == (9, len(NAMES))
    assert np.array_equal(found[0].corners, found[1].corners)
    # features near the border of the mask may differ: what they look at lies outside
    inner = [k for k, name in enumerate(NAMES) if not name.startswith("SIFT")]
    middle = [n for n, (top, left) in enumerate(found[0].corners) if 64 <= top <= 128 and 64 <= left <= 192]
    assert middle
    a, b = (f.values[np.ix_(middle, inner)] for f in found)
    assert np.allclose(a, b, rtol=2e-2, atol=2e-2)


def test_blur_shows_where_it_should() -> None:
    import cv2

    image, mask = ground(2), np.ones((256, 320), bool)
    soft = np.asarray(cv2.GaussianBlur(image, (0, 0), 2.0))
    sharp_mean, soft_mean = (
        patch_statistics(i, mask, most=9, rng=np.random.default_rng(0)).values.mean(axis=0)
        for i in (image, soft)
    )
    by_name = {name: (sharp_mean[k], soft_mean[k]) for k, name in enumerate(NAMES)}
    assert by_name["energy above f/4"][0] > 3 * by_name["energy above f/4"][1]
    assert by_name["half-width"][0] < 0.8 * by_name["half-width"][1]
    assert by_name["SIFT per Mpx"][0] > 1.5 * by_name["SIFT per Mpx"][1]


def test_half_a_picture_keeps_only_whole_pixels_of_the_ground() -> None:
    mask = np.ones((9, 11), bool)
    mask[3, 4] = False
    image, whole = half_size(np.ones((9, 11), np.float32), mask)
    assert image.shape == whole.shape == (4, 5)
    assert np.argwhere(~whole).tolist() == [[1, 2]]


def test_a_mask_without_a_patch_is_refused() -> None:
    with pytest.raises(ValueError, match="no patch of 64 px"):
        patch_statistics(np.ones((256, 320)), np.eye(256, 320) > 0, most=3, rng=np.random.default_rng(0))


class NearestMean:
    """A machine simple enough to be checked by eye: which of two weighted means is nearer."""

    def fit(self, values: np.ndarray, labels: np.ndarray, svm__sample_weight: np.ndarray) -> NearestMean:
        self.means = [
            np.average(values[labels == s], axis=0, weights=svm__sample_weight[labels == s]) for s in (-1, 1)
        ]
        return self

    def decision_function(self, values: np.ndarray) -> np.ndarray:
        near = [np.linalg.norm(values - mean, axis=1) for mean in self.means]
        return np.asarray(near[0] - near[1])


def scenes(seed: int, shift: float, count: int = 12) -> dict[str, np.ndarray]:
    """Places far apart, a cloud of patches each; `shift` is what the kind adds to the last number."""
    rng = np.random.default_rng(seed)
    found = {}
    for n in range(count):
        place = rng.normal(scale=20.0, size=5)
        place[-1] = shift
        found[f"place {n}"] = place + rng.normal(size=(40, 5))
    return found


MACHINES = [pytest.param("mean", id="nearest mean"), "linear", "rbf"]


def use(kernel: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    if kernel != "mean":
        pytest.importorskip("sklearn", reason="needs scikit-learn: pip install -r studies/telling_apart.txt")
        return kernel
    monkeypatch.setattr(telling_apart, "machine", lambda _: NearestMean())
    return "linear"


@pytest.mark.parametrize("kernel", MACHINES)
def test_places_that_only_differ_as_places_do_are_not_told_apart(
    kernel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # a split by patches would find each patch's own place on either side, and tell all of them apart
    first, second = scenes(1, 0.0), scenes(2, 0.0)
    chosen = use(kernel, monkeypatch)
    verdict = tell_apart(first, second, paired(first, second), chosen, rng=np.random.default_rng(0))
    assert 0.25 < verdict.mean < 0.75
    assert verdict.low <= verdict.mean <= verdict.high


@pytest.mark.parametrize("kernel", MACHINES)
def test_kinds_that_differ_are_told_apart(kernel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = scenes(1, 0.0), scenes(2, 60.0)
    chosen = use(kernel, monkeypatch)
    verdict = tell_apart(first, second, paired(first, second), chosen, rng=np.random.default_rng(0))
    assert verdict.mean > 0.9
    aucs = feature_aucs(first, second, paired(first, second))
    assert aucs.shape == (12, 5)
    assert (aucs[:, -1] == 1.0).all()


def test_a_held_out_place_is_not_trained_on(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []

    class Spy(NearestMean):
        def fit(self, values: np.ndarray, labels: np.ndarray, svm__sample_weight: np.ndarray) -> NearestMean:
            seen.append(len(values))
            assert not (values == 7.0).any(), "a patch of the judged place"
            for sign in (-1, 1):
                assert svm__sample_weight[labels == sign].sum() == pytest.approx(len(values) / 2)
            return super().fit(values, labels, svm__sample_weight)

    monkeypatch.setattr(telling_apart, "machine", lambda _: Spy())
    first, second = scenes(1, 0.0, 3), scenes(2, 0.0, 3)
    first["judged"] = np.full((5, 5), 7.0)
    second |= {"judged/0": np.full((9, 5), 7.0), "judged/1": np.full((2, 5), 7.0)}
    folds = [fold for fold in paired(first, second) if fold[0] == ["judged"]]
    assert folds == [(["judged"], ["judged/0", "judged/1"])]
    tell_apart(first, second, folds, "linear", rng=np.random.default_rng(0))
    assert seen == [6 * 40]


def test_folds_are_whole() -> None:
    first, second = scenes(1, 0.0, 3), scenes(2, 0.0, 2)
    assert len(crossed(first, second)) == 6
    with pytest.raises(ValueError, match="place 2 has no partner"):
        paired(first, second)
    alone = {"place 0": first["place 0"]}
    with pytest.raises(ValueError, match="without a scene to train on"):
        tell_apart(alone, second, paired(alone, second), "linear", rng=np.random.default_rng(0))


@pytest.mark.parametrize("frame", FRAMES, ids=lambda f: f.name)
def test_each_real_frame_has_ground_below_its_camera(frame: Any) -> None:
    shared(f"data/imagery/{frame.path}")
    view = load_view(frame)
    assert view.image.shape == view.ground.shape == (view.camera.height, view.camera.width)
    height = float(view.camera.C[2])
    assert 0.4 < height < 2.2
    # the middle of the marked ground lies below the camera and within reach of a rendered scene
    rows, columns = np.nonzero(view.ground)
    _, ray = view.camera.back_project([[float(np.median(columns)), float(np.median(rows))]])
    assert ray[0, 2] < 0.0
    assert height / -ray[0, 2] < 16.0
    if view.sun is not None:
        assert math.degrees(math.asin(view.sun.direction[2])) > 3.0
    found = patch_statistics(view.image, view.ground, most=4, rng=np.random.default_rng(0))
    assert np.isfinite(found.values).all()
    for top, left in found.corners:
        assert view.ground[top : top + PATCH_PX, left : left + PATCH_PX].all()


def test_what_may_not_be_shown_is_marked() -> None:
    assert {f.mission for f in FRAMES if not f.shown} == {"Devon Island"}
    assert len({f.path for f in FRAMES}) == len(FRAMES)
