"""Compiled kernels: normals of smooth bodies and of such with edges."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]


@njit(cache=True, nogil=True)
def smooth(vertices: F64, triangles: I64, out: F64) -> None:
    """Fill unit normals `out` [n, 3] of `vertices` [n, 3]: the area-weighted mean of the `triangles` [m, 3]
    round each, upwards where there is none.
    """
    out[:] = 0.0
    for k in range(triangles.shape[0]):
        a, b, c = vertices[triangles[k, 0]], vertices[triangles[k, 1]], vertices[triangles[k, 2]]
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        wx, wy, wz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        x, y, z = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        for corner in range(3):
            n = triangles[k, corner]
            out[n, 0] += x
            out[n, 1] += y
            out[n, 2] += z
    for n in range(out.shape[0]):
        length = math.sqrt(out[n, 0] * out[n, 0] + out[n, 1] * out[n, 1] + out[n, 2] * out[n, 2])
        if length > 0.0:
            longest = max(length, 1e-30)
            out[n, 0], out[n, 1], out[n, 2] = out[n, 0] / longest, out[n, 1] / longest, out[n, 2] / longest
        else:
            out[n, 0], out[n, 1], out[n, 2] = 0.0, 0.0, 1.0


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
