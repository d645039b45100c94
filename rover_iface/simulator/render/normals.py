"""Compiled kernel: normals of bodies with edges."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]


@njit(cache=True, nogil=True)
def creased(face: F64, triangles: I64, first: I64, around: I64, least_cosine: float, out: F64) -> None:
    """Fill unit normals `out` [3 m, 3] of the corners of `triangles` [m, 3].

    Each is the mean of the normals `face` [m, 3] (as long as twice the triangle's area) of those triangles
    round its vertex whose cosine with its own is at least `least_cosine`. Round vertex v are
    `around[first[v]]` to `around[first[v + 1] - 1]`.
    """
    for f in range(triangles.shape[0]):
        own = math.sqrt(face[f, 0] ** 2 + face[f, 1] ** 2 + face[f, 2] ** 2)
        for corner in range(3):
            v = triangles[f, corner]
            x, y, z = 0.0, 0.0, 0.0
            for k in range(first[v], first[v + 1]):
                g = around[k]
                size = math.sqrt(face[g, 0] ** 2 + face[g, 1] ** 2 + face[g, 2] ** 2)
                dot = face[f, 0] * face[g, 0] + face[f, 1] * face[g, 1] + face[f, 2] * face[g, 2]
                if g == f or dot >= least_cosine * own * size:
                    x, y, z = x + face[g, 0], y + face[g, 1], z + face[g, 2]
            length = math.sqrt(x * x + y * y + z * z)
            n = 3 * f + corner
            if length > 0.0:
                out[n, 0], out[n, 1], out[n, 2] = x / length, y / length, z / length
            else:
                out[n, 0], out[n, 1], out[n, 2] = 0.0, 0.0, 1.0
