"""Compiled kernel of warping between linear cameras, whose pixels are a projective map of each other."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from rover_iface.cameras.kernels import between
from rover_iface.cameras.model import Array

Image = npt.NDArray[np.float32]


@njit(cache=True, nogil=True)
def warp_linear(image: Image, p_out: Array, p_in: Array, range_m: float, fill: float, out: Image) -> None:
    """Fill `out` [rows, columns] with an image [h, w] of camera `p_in` as `p_out` would have taken it.

    Both [26] are CAHV cameras as `kernels` lays them out; what they see lies at `range_m`, and what the image
    does not show is `fill`. The ray of a pixel is linear in it (Yakimovsky and Cunningham 1978), so that only
    its length takes a root.
    """
    rays = np.empty((3, 3))
    _cross(p_out[9:12], p_out[6:9], rays[0])
    _cross(p_out[3:6], p_out[9:12], rays[1])
    _cross(p_out[6:9], p_out[3:6], rays[2])
    if _dot(p_out[3:6], rays[0]) < 0.0:
        rays *= -1.0
    # sample, line and depth of the ray and of the step from centre to centre, in the image's camera
    seen, step = np.empty((3, 3)), np.empty(3)
    for k in range(3):
        axis = p_in[6:9] if k == 0 else p_in[9:12] if k == 1 else p_in[3:6]
        step[k] = _dot(p_out[0:3] - p_in[0:3], axis) / range_m
        for n in range(3):
            seen[n, k] = _dot(rays[n], axis)
    rows, columns = image.shape
    for j in range(out.shape[0]):
        for i in range(out.shape[1]):
            long2 = 0.0
            for k in range(3):
                along = rays[0, k] + i * rays[1, k] + j * rays[2, k]
                long2 += along * along
            long = math.sqrt(long2)
            depth = seen[0, 2] + i * seen[1, 2] + j * seen[2, 2] + step[2] * long
            out[j, i] = fill
            if not depth > 1e-12 * long:
                continue
            x = (seen[0, 0] + i * seen[1, 0] + j * seen[2, 0] + step[0] * long) / depth
            y = (seen[0, 1] + i * seen[1, 1] + j * seen[2, 1] + step[1] * long) / depth
            if not (0.0 <= x <= columns - 1.0 and 0.0 <= y <= rows - 1.0):
                continue
            out[j, i] = between(image, x, y)


@njit(cache=True, nogil=True)
def _cross(a: Array, b: Array, out: Array) -> None:
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True, nogil=True)
def _dot(a: Array, b: Array) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
