"""The trained network as OpenCV's dnn runs it."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from studies.learned_matcher.patches import Grey

NETWORK = "descriptor.onnx"
MOST_BYTES = 4 * 1024 * 1024
AT_ONCE = 256
"""Patches of one run, always so many: the network need not be laid out anew for another number."""


@dataclass(frozen=True, slots=True)
class Net:
    """A network of `cv2.dnn` (`setInput`, `forward`): patches (n, 1, 32, 32) to vectors (n, d, 1, 1).

    It keeps its input between both calls, so that threads must take turns.
    """

    run: Any
    one_at_a_time: threading.Lock = field(default_factory=threading.Lock)

    @staticmethod
    def read(path: Path) -> Net:
        """Read a network's file.

        Raises
        ------
        ValueError
            If it is larger than is allowed.
        """
        import cv2

        if path.stat().st_size > MOST_BYTES:
            raise ValueError(f"{path} has {path.stat().st_size} bytes; {MOST_BYTES} are allowed")
        return Net(cv2.dnn.readNetFromONNX(str(path)))


def described(net: Net, patches: Grey) -> npt.NDArray[np.float32]:
    """Return unit vectors (n, d) of patches (n, 32, 32); the last run is filled up with zeros."""
    parts = []
    for first in range(0, len(patches), AT_ONCE):
        part = patches[first : first + AT_ONCE, None]
        given = np.zeros((AT_ONCE, *part.shape[1:]), np.float32)
        given[: len(part)] = part
        with net.one_at_a_time:
            net.run.setInput(given)
            parts.append(np.array(net.run.forward()).reshape(AT_ONCE, -1)[: len(part)])
    if not parts:
        return np.empty((0, 0), np.float32)
    vectors = np.concatenate(parts)
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.maximum(lengths, 1e-9), dtype=np.float32)
