"""The network that describes features: its patches, its file, and threads that share it."""

from __future__ import annotations

import hashlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from rover_iface.errors import WeightsError
from rover_iface.vision import sift_features
from rover_iface.vision.learned import descriptor
from rover_iface.vision.learned.descriptor import (
    AT_ONCE,
    FILE,
    LENGTH,
    MOST_BYTES,
    PATCH_PX,
    Net,
    cut,
    described,
    detect,
)
from tests.rover_iface.vision.pictures import picture


def test_patch_is_the_picture_round_its_middle() -> None:
    image = picture(3)
    patch = cut(image, np.array([[99.5, 119.5]]), np.array([float(PATCH_PX)]))[0]
    part = image[104:136, 84:116]
    assert np.allclose(patch, (part - part.mean()) / part.std(), atol=1e-4)


def test_patch_of_a_larger_picture_is_the_same() -> None:
    image = cv2.GaussianBlur(picture(4), (0, 0), 2.0)
    large = cv2.resize(image, None, fx=3.0, fy=3.0, interpolation=cv2.INTER_CUBIC)
    middle, side = np.array([[120.0, 110.0]]), np.array([40.0])
    one = cut(image, middle, side)
    other = cut(large, 3.0 * middle + 1.0, 3.0 * side)
    assert (one * other).mean() > 0.98


def test_turned_patch_is_the_turned_picture() -> None:
    image = cv2.GaussianBlur(picture(5), (0, 0), 2.0)
    middle = np.array([[119.5, 119.5]])
    turned = cut(image, middle, np.array([40.0]), np.array([np.pi / 2]))
    assert np.allclose(turned, cut(np.rot90(image).copy(), middle, np.array([40.0])), atol=0.02)


def test_flat_patch_stays_flat() -> None:
    flat = np.full((60, 60), 0.4, np.float32)
    assert np.abs(cut(flat, np.array([[30.0, 30.0]]), np.array([20.0]))).max() < 1e-4


class Means:
    """Stands for a network: the means of the upper and of the lower half, of runs of one size alone."""

    def __init__(self) -> None:
        self.given = np.empty(0)

    def setInput(self, given: np.ndarray[Any, Any]) -> None:
        assert given.shape == (AT_ONCE, 1, PATCH_PX, PATCH_PX)
        self.given = given

    def forward(self) -> np.ndarray[Any, Any]:
        halves = self.given.reshape(AT_ONCE, 2, -1).mean(axis=2)
        return halves[..., None, None]


def test_vectors_are_of_unit_length_and_in_order() -> None:
    patches = np.ones((AT_ONCE + 3, PATCH_PX, PATCH_PX), np.float32)
    patches[:, 16:] = np.arange(AT_ONCE + 3)[:, None, None]
    vectors = described(Net(Means()), patches)
    expected = np.column_stack((np.ones(AT_ONCE + 3), np.arange(AT_ONCE + 3)))
    assert np.allclose(vectors, expected / np.linalg.norm(expected, axis=1, keepdims=True), atol=1e-6)


def test_a_network_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(WeightsError, match=r"gone\.onnx is not there"):
        Net.read(tmp_path / "gone.onnx")


def test_too_large_a_network_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "large.onnx"
    path.write_bytes(bytes(MOST_BYTES + 1))
    with pytest.raises(WeightsError, match="are allowed"):
        Net.read(path)


@pytest.mark.parametrize("kept", [0, 1000, 500_000])
def test_a_file_that_holds_no_whole_network_is_refused(tmp_path: Path, kept: int) -> None:
    path = tmp_path / "cut.onnx"
    path.write_bytes(FILE.read_bytes()[:kept])
    with pytest.raises(WeightsError, match=r"cut\.onnx"):
        Net.read(path)


def test_a_network_of_shorter_vectors_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cv2.dnn, "readNetFromONNX", lambda path: Means())
    with pytest.raises(WeightsError, match=r"makes \(256, 2, 1, 1\) of 256 patches"):
        Net.read(FILE)


def test_the_note_beside_the_network_is_of_this_file() -> None:
    digest = hashlib.sha256(FILE.read_bytes()).hexdigest()
    assert digest[:12] in FILE.with_name("README.md").read_text()


def test_features_are_those_of_sift_each_place_once() -> None:
    image = picture(11)
    pixels, vectors = detect(image, 2500)
    places = {tuple(p) for p in sift_features.detect(image, 2500)[0].tolist()}
    assert {tuple(p) for p in pixels.tolist()} == places
    assert vectors.shape == (len(pixels), LENGTH)
    some, of_them = detect(image, 40)
    assert len(some) == 40
    numbers = [pixels.tolist().index(p) for p in some.tolist()]
    assert np.allclose(np.sort(of_them, axis=0), np.sort(vectors[numbers], axis=0), atol=1e-4)


def test_a_picture_without_features_has_none() -> None:
    pixels, vectors = detect(np.full((60, 80), 0.5, np.float32), 100)
    assert (pixels.shape, vectors.shape) == ((0, 2), (0, LENGTH))


def test_network_is_read_once_by_threads_that_ask_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    reads: list[Path] = []
    honest = Net.read

    def read(path: Path) -> Net:
        reads.append(path)
        return honest(path)

    monkeypatch.setattr(Net, "read", staticmethod(read))
    descriptor._read.cache_clear()
    with ThreadPoolExecutor(4) as pool:
        nets = list(pool.map(lambda _: descriptor.shipped(), range(8)))
    assert reads == [FILE]
    assert all(net is nets[0] for net in nets)


def test_shipped_network_is_read_by_opencv_and_answers_patch_by_patch() -> None:
    net = Net.read(FILE)
    rng = np.random.default_rng(8)
    patches = cut(picture(8), rng.uniform(20, 220, (AT_ONCE + 20, 2)), rng.uniform(16, 40, AT_ONCE + 20))
    vectors = described(net, patches)
    assert vectors.shape == (AT_ONCE + 20, 64)
    assert np.allclose(np.linalg.norm(vectors, axis=1), 1.0, atol=1e-5)
    order = rng.permutation(len(patches))
    assert np.allclose(described(net, patches[order]), vectors[order], atol=1e-5)


def test_shipped_network_knows_a_patch_again_that_is_turned_noisy_and_darker() -> None:
    net, image = Net.read(FILE), cv2.GaussianBlur(picture(9), (0, 0), 1.0)
    rng = np.random.default_rng(9)
    middles = np.array([(x, y) for x in range(24, 220, 12) for y in range(24, 220, 12)], dtype=float)
    sides = np.full(len(middles), 28.0)
    darker = (0.4 * image + rng.normal(0, 0.004, image.shape)).astype(np.float32)
    vectors = described(net, cut(image, middles, sides))
    again = described(
        net, cut(darker, middles + rng.normal(0, 0.5, middles.shape), 1.15 * sides, 0.08 + 0 * sides)
    )
    assert ((vectors @ again.T).argmax(axis=1) == np.arange(len(middles))).mean() > 0.97


def test_threads_that_share_a_network_take_turns() -> None:
    net = Net.read(FILE)
    rng = np.random.default_rng(10)
    batches = [cut(picture(n), rng.uniform(30, 200, (300, 2)), np.full(300, 24.0)) for n in range(4)]
    alone = [described(net, batch) for batch in batches]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda batch: described(net, batch), batches))
    assert all(np.array_equal(a, b) for a, b in zip(alone, together, strict=True))
