"""Kernel of the segmentation: labels that pull at those of their neighbours."""

from __future__ import annotations

import math

import numba
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@numba.njit(cache=True, nogil=True)
def mean_field(odds: Floats, starts: Ints, others: Ints, pull: Floats, chance: Floats, sweeps: int) -> None:
    """Update the chances (n,) of being rock in place, `sweeps` times there and back.

    The neighbours of point i are `others[starts[i]:starts[i + 1]]` with weights `pull`.
    """
    n = len(odds)
    for sweep in range(2 * sweeps):
        for k in range(n):
            i = k if sweep % 2 == 0 else n - 1 - k
            field = odds[i]
            for e in range(starts[i], starts[i + 1]):
                field += pull[e] * (2.0 * chance[others[e]] - 1.0)
            chance[i] = 1.0 / (1.0 + math.exp(-min(max(field, -40.0), 40.0)))
