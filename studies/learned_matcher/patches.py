"""Keypoints as the product finds them, all that SIFT tells of them kept, and their patches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.vision.learned.descriptor import SIZES, cut
from rover_iface.vision.sift_features import stretched

Array = npt.NDArray[np.float64]
Grey = npt.NDArray[np.float32]


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


def patches_of(keys: Keys) -> Grey:
    """Return the patches (n, PATCH_PX, PATCH_PX) of keypoints."""
    return cut(keys.image, keys.pixels, SIZES * keys.sizes)
