"""Kernels of the segmentation: labels that pull at their neighbours', and rocks parted at saddles."""

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

    The mean field of a Potts model. `odds` (n,) are log odds of each point by itself; the neighbours of point
    i are `others[starts[i]:starts[i + 1]]`, with weights `pull`: `starts` (n + 1,), `others` and `pull` (m,).
    """
    n = len(odds)
    for sweep in range(2 * sweeps):
        for k in range(n):
            i = k if sweep % 2 == 0 else n - 1 - k
            field = odds[i]
            for e in range(starts[i], starts[i + 1]):
                field += pull[e] * (2.0 * chance[others[e]] - 1.0)
            chance[i] = 1.0 / (1.0 + math.exp(-min(max(field, -40.0), 40.0)))


@numba.njit(cache=True, nogil=True)
def part_at_saddles(
    height: Floats,
    starts: Ints,
    others: Ints,
    order: Ints,
    deep: Floats,
    group: Ints,
) -> None:
    """Fill `group` (n,) with the number of the summit that each point of `order` (highest first) belongs to.

    Where two summits meet, they stay apart if the lower one stands at least `deep` (n,) of its own over the
    saddle; otherwise it joins the higher one. Points not in `order` keep -1.

    `height` (n,) and `deep` are in m; neighbours as in `mean_field`.
    """
    parent = np.arange(len(height))
    for i in range(len(height)):
        group[i] = -1
    for k in range(len(order)):
        i = order[k]
        best = -1
        for e in range(starts[i], starts[i + 1]):
            j = others[e]
            if group[j] < 0:
                continue
            root = group[j]
            while parent[root] != root:
                root = parent[root]
            if best < 0:
                best = root
            elif root != best:
                low, high = (root, best) if height[root] < height[best] else (best, root)
                if height[low] - height[i] < deep[low]:
                    parent[low] = high
                    best = high
                elif height[root] > height[best]:
                    best = root
        group[i] = i if best < 0 else best
    for k in range(len(order)):
        root = group[order[k]]
        while parent[root] != root:
            root = parent[root]
        group[order[k]] = root
