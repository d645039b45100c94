"""Pictures that are made up."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np


def picture(seed: int, size: int = 240) -> np.ndarray[Any, Any]:
    """Return a picture [size, size] with structure of several sizes, 0 to 1."""
    rng = np.random.default_rng(seed)
    parts = [cv2.GaussianBlur(rng.normal(0, sd, (size, size)), (0, 0), sd) for sd in (1.0, 2.0, 4.0)]
    whole = sum(parts)
    return np.asarray((whole - whole.min()) / np.ptp(whole), dtype=np.float32)
