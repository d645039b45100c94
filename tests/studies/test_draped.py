"""The texture of real frames stays where it is on a surface, whatever it is seen from."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from studies.common.draped import _level, halved

SIDE, STEP = 128, 4


def seen(levels: list[np.ndarray], far: float, size: float) -> np.ndarray:
    """Return a patch of the texture, `far` texels from its origin, averaged over `size` texels."""
    sizes = np.array([level.shape for level in levels], np.int64)
    packed = np.concatenate([level.ravel() for level in levels])
    at = far + STEP * np.arange(SIDE)
    return np.array([[_level(packed, sizes, size, u, v) for u in at] for v in at], np.float32)


@pytest.mark.parametrize("far", [0.0, 1500.0, 3000.0])
def test_coarser_levels_of_a_texture_lie_on_the_finest(far: float) -> None:
    rng = np.random.default_rng(4)
    grain = cv2.GaussianBlur(rng.normal(1.0, 1.0, (430, 922)).astype(np.float32), (0, 0), 3.0)
    levels = halved(grain)
    window = cv2.createHanningWindow((SIDE, SIDE), cv2.CV_32F)
    for size in (4.0, 8.0):
        off, _ = cv2.phaseCorrelate(seen(levels, far, 2.0), seen(levels, far, size), window)
        assert STEP * np.hypot(*off) < 1.0  # 32 texels at 3,000 where the edges of the levels lay apart
