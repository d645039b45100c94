"""One picture sharp all over from a stack taken at different settings of focus."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from rover_iface.errors import CameraError

Image = npt.NDArray[np.float32]


def merge_stack(images: Sequence[Image], *, reach_px: float = 6.0) -> tuple[Image, npt.NDArray[np.intp]]:
    """Return the merged picture [rows, columns] and which image of the stack each of its pixels is from.

    Images [rows, columns], float32 in 0..1, are of one view. Sharpness is the local energy of the Laplacian,
    smoothed over `reach_px`.

    Raises
    ------
    CameraError
        If the stack is empty or the images differ in size.
    """
    import cv2

    if not images or any(image.shape != images[0].shape for image in images):
        raise CameraError(
            f"a focus stack of {[image.shape for image in images]}; images of one size are needed"
        )
    energy = np.stack(
        [
            cv2.GaussianBlur(
                cv2.Laplacian(cv2.GaussianBlur(i, (0, 0), 0.8), cv2.CV_32F) ** 2, (0, 0), reach_px
            )
            for i in images
        ]
    )
    best = energy.argmax(axis=0)
    merged = np.take_along_axis(np.stack(images), best[None], axis=0)[0]
    return merged.astype(np.float32), best
