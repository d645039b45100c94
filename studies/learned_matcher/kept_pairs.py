"""Patches of the same surface points in two pictures, as they are kept between making and training."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from studies.learned_matcher.patches import Array

STORED = 40.0
"""Steps of a stored patch to one deviation: 8 bits hold three of them either way."""


@dataclass(frozen=True, slots=True, eq=False)
class PatchPairs:
    """Patches of n points, each in two pictures.

    Attributes
    ----------
    one, other
        (n, 32, 32), 128 the mean, `STORED` steps a deviation.
    points, radius_m
        (n, 3), m, site frame, and (n,): which part of the surface a patch shows.
    group
        (n,): which two pictures they are of.
    """

    one: npt.NDArray[np.uint8]
    other: npt.NDArray[np.uint8]
    points: Array
    radius_m: Array
    group: npt.NDArray[np.int64]

    def save(self, path: Path) -> None:
        """Write them; a stopped run leaves no half a file."""
        part = path.with_suffix(".part.npz")
        kept = {name: getattr(self, name) for name in PatchPairs.__slots__}
        np.savez_compressed(part, **kept)
        part.replace(path)

    @staticmethod
    def load(path: Path) -> PatchPairs:
        """Read them."""
        with np.load(path) as kept:
            return PatchPairs(**{name: kept[name] for name in PatchPairs.__slots__})
