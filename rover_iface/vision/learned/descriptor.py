"""SIFT's keypoints, described by a network that was trained on ground under changed light.

A patch stands upright: a rover's camera rolls by a few degrees, so that which way is up tells stones apart
and a rotation need not be taken out. It is wider than SIFT's window, as shades change and outlines stay.
The file beside this is read when it is first asked for. OpenCV's networks keep their input from one call to
the next, so that threads take turns.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.errors import WeightsError
from rover_iface.vision.sift_features import Descriptors, stretched, strongest
from rover_iface.vision.tracker import Image

FILE = Path(__file__).with_name("descriptor.onnx")
MOST_BYTES = 4 * 1024 * 1024
"""A limit that was set beforehand; the network has an eighth of it."""
AT_ONCE = 256
"""Patches of one run, always so many: the network need not be laid out anew for another number."""
PATCH_PX, LENGTH = 32, 64
"""Side of a patch after cutting, and length of a vector."""
SIZES = 8.0
"""Side of a patch in diameters of its keypoint as OpenCV tells it (two deviations of its scale); SIFT's own
window of four by four cells of three deviations is six of them."""
LEAST_SD = 0.004
"""Deviation, of full scale, below which contrast is not raised further: a navcam's noise is about that."""


@dataclass(frozen=True, slots=True)
class Net:
    """A network of `cv2.dnn` (`setInput`, `forward`): patches (n, 1, 32, 32) to vectors (n, d, 1, 1)."""

    run: Any
    one_at_a_time: threading.Lock = field(default_factory=threading.Lock)

    @staticmethod
    def read(path: Path) -> Net:
        """Read a network's file.

        Raises
        ------
        WeightsError
            If it is not there, is larger than is allowed, or holds no network that takes patches and gives
            vectors.
        """
        import cv2

        if not path.is_file():
            raise WeightsError(f"{path} is not there: the installation is not whole")
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise WeightsError(f"{path} has {size} bytes; {MOST_BYTES} are allowed")
        try:
            net = Net(cv2.dnn.readNetFromONNX(str(path)))
            vectors = net.forward(np.zeros((AT_ONCE, 1, PATCH_PX, PATCH_PX), np.float32))
        except cv2.error as err:
            raise WeightsError(f"{path} holds no network of patches: {err}") from err
        if vectors.shape != (AT_ONCE, LENGTH, 1, 1):
            raise WeightsError(
                f"{path} makes {vectors.shape} of {AT_ONCE} patches; it should be {(AT_ONCE, LENGTH, 1, 1)}"
            )
        return net

    def forward(self, patches: Image) -> npt.NDArray[np.float32]:
        """Return what the network makes (AT_ONCE, d, 1, 1) of patches (AT_ONCE, 1, 32, 32)."""
        with self.one_at_a_time:
            self.run.setInput(patches)
            return np.array(self.run.forward(), dtype=np.float32)


@cache
def _read() -> Net:
    return Net.read(FILE)


_reading = threading.Lock()


def shipped() -> Net:
    """Return the network that comes with the product, read once.

    Raises
    ------
    WeightsError
        If its file is missing or is not what it should be.
    """
    with _reading:
        return _read()


def detect(image: Image, count: int) -> tuple[Array, Descriptors]:
    """Return pixels (n, 2) and unit vectors (n, 64) of the strongest features of an image (rows, columns).

    They are those of `sift_features.detect`, each place and scale once, whatever its orientations.

    Raises
    ------
    WeightsError
        If the network's file is missing or is not what it should be.
    """
    import cv2

    image = np.nan_to_num(image)
    found = cv2.SIFT.create(enable_precise_upscale=True).detect(stretched(image), None)
    rows = np.array([(*k.pt, k.size, k.response) for k in found], dtype=np.float64).reshape(-1, 4)
    rows = np.unique(rows, axis=0)
    rows = rows[strongest(rows[:, :2], rows[:, 3], count, image.shape)]
    pixels = rows[:, :2]
    return pixels, described(shipped(), cut(image, pixels, SIZES * rows[:, 2]))


def described(net: Net, patches: Image) -> Descriptors:
    """Return unit vectors (n, d) of patches (n, 32, 32); the last run is filled up with zeros."""
    parts = []
    for first in range(0, len(patches), AT_ONCE):
        part = patches[first : first + AT_ONCE, None]
        given = np.zeros((AT_ONCE, *part.shape[1:]), np.float32)
        given[: len(part)] = part
        parts.append(net.forward(given).reshape(AT_ONCE, -1)[: len(part)])
    if not parts:
        return np.empty((0, LENGTH), np.float32)
    vectors = np.concatenate(parts)
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.maximum(lengths, 1e-9), dtype=np.float32)


def cut(image: Image, pixels: Array, sides: Array, turns: Array | None = None) -> Image:
    """Return patches (n, PATCH_PX, PATCH_PX) of an image (rows, columns), of zero mean and unit deviation.

    `pixels` (n, 2) are their middles, `sides` (n,), px, their widths, `turns` (n,), rad, how far each is
    turned. Large ones are cut from coarser levels; beyond the image its edge is repeated.
    """
    import cv2

    levels = [image]
    step = sides / PATCH_PX
    level = np.clip(np.round(np.log2(np.maximum(step, 1.0))).astype(int), 0, 5)
    while len(levels) <= int(level.max(initial=0)):
        levels.append(cv2.pyrDown(levels[-1]))
    grid = (np.arange(PATCH_PX) - 0.5 * (PATCH_PX - 1)).astype(np.float64)
    across, down = np.meshgrid(grid, grid)
    out = np.empty((len(pixels), PATCH_PX, PATCH_PX), np.float32)
    angle = np.zeros(len(pixels)) if turns is None else turns
    for n, source in enumerate(levels):
        of_level = np.flatnonzero(level == n)
        for first in range(0, len(of_level), 512):
            part = of_level[first : first + 512]
            c, s = (f(angle[part])[:, None, None] for f in (np.cos, np.sin))
            size, scale = step[part][:, None, None], 0.5**n
            x = scale * (pixels[part, 0][:, None, None] + size * (c * across - s * down))
            y = scale * (pixels[part, 1][:, None, None] + size * (s * across + c * down))
            shape = (-1, PATCH_PX)
            maps = x.reshape(shape).astype(np.float32), y.reshape(shape).astype(np.float32)
            taken = cv2.remap(source, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            out[part] = taken.reshape(-1, PATCH_PX, PATCH_PX)
    out -= out.mean(axis=(1, 2), keepdims=True)
    out /= np.maximum(out.std(axis=(1, 2), keepdims=True), LEAST_SD)
    return out
