"""Keypoints as the product finds them, and the square patches round them that descriptors are made from.

A patch stands upright: a rover's camera rolls by a few degrees, so that which way is up tells stones apart
and a rotation need not be taken out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Grey = npt.NDArray[np.float32]

PATCH_PX = 32
"""Side of a patch after cutting."""
SIZES = 8.0
"""Side of a patch in diameters of its keypoint as OpenCV tells it (two deviations of its scale); SIFT's own
window of four by four cells of three deviations is six of them. Wider, as shades change and outlines stay."""
LEAST_SD = 0.004
"""Deviation, of full scale, below which contrast is not raised further: a navcam's noise is about that."""


@dataclass(frozen=True, slots=True, eq=False)
class Keys:
    """Keypoints of one picture.

    Attributes
    ----------
    image, seen
        (rows, columns): what patches are cut from, and what the keypoints were found in.
    pixels, sizes, octaves
        (n, 2) and (n,), px: places and diameters; (n,): octave and layer as OpenCV packs them.
    sift
        (n, 128), the product's descriptors.
    """

    image: Grey
    seen: Grey
    pixels: Array
    sizes: Array
    octaves: npt.NDArray[np.int64]
    sift: npt.NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.pixels)

    def some(self, which: npt.NDArray[np.int64]) -> Keys:
        """Return those of the given numbers (k,)."""
        kept = (getattr(self, name)[which] for name in ("pixels", "sizes", "octaves", "sift"))
        return Keys(self.image, self.seen, *kept)


def stretched(image: Grey) -> npt.NDArray[np.uint8]:
    """Return an image (rows, columns) in 8 bits, its range stretched as `sift_features.detect` does."""
    low, high = np.percentile(image[::3, ::3], (0.5, 99.5))
    shown = np.clip(255.0 * (image - low) / max(1e-6, float(high - low)), 0, 255)
    return np.asarray(shown, dtype=np.uint8)


def find_keys(image: Grey, most: int = 2500, seen: Grey | None = None) -> Keys:
    """Return the strongest keypoints of an image (rows, columns), found as `sift_features.detect` does.

    They are looked for in `seen` (rows, columns), the same picture with its contrast made even, if given.
    """
    import cv2

    seen = image if seen is None else seen
    found, descriptors = cv2.SIFT.create(enable_precise_upscale=True).detectAndCompute(stretched(seen), None)
    if descriptors is None:
        return Keys(
            image, seen, np.empty((0, 2)), np.empty(0), np.empty(0, np.int64), np.empty((0, 128), np.float32)
        )
    order = np.argsort([-k.response for k in found], kind="stable")[:most]
    pixels = np.array([found[n].pt for n in order], dtype=np.float64)
    sizes = np.array([found[n].size for n in order], dtype=np.float64)
    octaves = np.array([found[n].octave for n in order], dtype=np.int64)
    return Keys(image, seen, pixels, sizes, octaves, descriptors[order])


def upright_sift(keys: Keys) -> npt.NDArray[np.float32]:
    """Return SIFT descriptors (n, 128) at the same places and scales, none turned to its own orientation."""
    import cv2

    points = [
        cv2.KeyPoint(float(x), float(y), float(size), 0.0, 1.0, int(octave))
        for (x, y), size, octave in zip(keys.pixels, keys.sizes, keys.octaves, strict=True)
    ]
    found = cv2.SIFT.create(enable_precise_upscale=True).compute(stretched(keys.seen), points)[1]
    return np.asarray(found, dtype=np.float32)


def single(keys: Keys) -> npt.NDArray[np.int64]:
    """Return the numbers (k,) of keypoints, those once that stand there with several orientations."""
    rows = np.column_stack((keys.pixels, keys.sizes))
    return np.sort(np.unique(rows, axis=0, return_index=True)[1]).astype(np.int64)


def cut(image: Grey, pixels: Array, sides: Array, turns: Array | None = None) -> Grey:
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


def patches_of(keys: Keys) -> Grey:
    """Return the patches (n, PATCH_PX, PATCH_PX) of keypoints."""
    return cut(keys.image, keys.pixels, SIZES * keys.sizes)
