"""Compiled kernels of triangulation: points and covariances of pairs of pixels, normals of patches."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from rover_iface.cameras.kernels import back_project_one, jacobian_one, project_one
from rover_iface.cameras.model import Array

STEPS = 3


@njit(cache=True, nogil=True)
def invert_symmetric(m: Array, out: Array) -> bool:
    """Fill `out` (3, 3) with the inverse of a symmetric matrix (3, 3); False where there is none."""
    a, b, c, d, e, f = m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2]
    xx, xy, xz = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * xx + b * xy + c * xz
    if not abs(determinant) > 0.0:
        return False
    out[0, 0], out[0, 1], out[0, 2] = xx, xy, xz
    out[1, 0], out[1, 1], out[1, 2] = xy, a * f - c * c, b * c - a * e
    out[2, 0], out[2, 1], out[2, 2] = xz, b * c - a * e, a * d - b * b
    out /= determinant
    return True


@njit(cache=True, nogil=True)
def triangulate_many(
    p_left: Array, p_right: Array, left_px: Array, right_px: Array, points: Array, inverses: Array
) -> None:
    """Fill points (n, 3), m, and inverse normal matrices (n, 3, 3), m^2/px^2, of pixels (n, 2) in two images;
    in the frame of both cameras.

    Least squares over the four coordinates, `STEPS` times Gauss and Newton from the middle of the shortest
    line between the rays; NaN where the rays do not meet in front of the cameras.
    """
    slope = np.empty((4, 3))
    r = np.empty(4)
    g = np.empty(3)
    normal = np.empty((3, 3))
    for n in range(left_px.shape[0]):
        points[n, :] = math.nan
        inverses[n, :, :] = math.nan
        ax, ay, az, ux, uy, uz = back_project_one(p_left, left_px[n, 0], left_px[n, 1])
        bx, by, bz, vx, vy, vz = back_project_one(p_right, right_px[n, 0], right_px[n, 1])
        gx, gy, gz = bx - ax, by - ay, bz - az
        c = ux * vx + uy * vy + uz * vz
        gu, gv = gx * ux + gy * uy + gz * uz, gx * vx + gy * vy + gz * vz
        den = 1.0 - c * c
        if not den > 0.0:
            continue
        s, t = (gu - c * gv) / den, (c * gu - gv) / den
        if not (s > 0.0 and t > 0.0):
            continue
        x = 0.5 * (ax + s * ux + bx + t * vx)
        y = 0.5 * (ay + s * uy + by + t * vy)
        z = 0.5 * (az + s * uz + bz + t * vz)
        good = True
        for _ in range(STEPS):
            jacobian_one(p_left, x, y, z, slope[:2])
            jacobian_one(p_right, x, y, z, slope[2:])
            r[0], r[1], _d = project_one(p_left, x, y, z)
            r[2], r[3], _e = project_one(p_right, x, y, z)
            r[0], r[1] = left_px[n, 0] - r[0], left_px[n, 1] - r[1]
            r[2], r[3] = right_px[n, 0] - r[2], right_px[n, 1] - r[3]
            for i in range(3):
                g[i] = 0.0
                for k in range(4):
                    g[i] += slope[k, i] * r[k]
                for j in range(3):
                    normal[i, j] = 0.0
                    for k in range(4):
                        normal[i, j] += slope[k, i] * slope[k, j]
            if math.isnan(g[0] + g[1] + g[2]) or not invert_symmetric(normal, inverses[n]):
                good = False
                break
            m = inverses[n]
            x += m[0, 0] * g[0] + m[0, 1] * g[1] + m[0, 2] * g[2]
            y += m[1, 0] * g[0] + m[1, 1] * g[1] + m[1, 2] * g[2]
            z += m[2, 0] * g[0] + m[2, 1] * g[1] + m[2, 2] * g[2]
        if good:
            points[n, 0], points[n, 1], points[n, 2] = x, y, z
        else:
            inverses[n, :, :] = math.nan


@njit(cache=True, nogil=True)
def plane_normal(p: Array, x: float, y: float, plane: Array, out: Array) -> None:
    """Fill `out` (3,) with the unit normal, towards the camera, of a patch round a pixel.

    The inverse range of the patch is plane[0] + plane[1:] . (pixel - (x, y)).

    `plane` (3,) is in 1/m and 1/m per pixel; the normal is in the frame of camera `p` (26,).
    """
    corner = np.empty((3, 3))
    sx, sy, sz = 0.0, 0.0, 0.0
    for n in range(3):
        across, down = 8.0 * (n == 1), 8.0 * (n == 2)
        ox, oy, oz, dx, dy, dz = back_project_one(p, x + across, y + down)
        range_m = 1.0 / max(plane[0] + across * plane[1] + down * plane[2], 1e-4)
        corner[n, 0], corner[n, 1], corner[n, 2] = ox + range_m * dx, oy + range_m * dy, oz + range_m * dz
        if n == 0:
            sx, sy, sz = dx, dy, dz
    ax, ay, az = corner[1, 0] - corner[0, 0], corner[1, 1] - corner[0, 1], corner[1, 2] - corner[0, 2]
    bx, by, bz = corner[2, 0] - corner[0, 0], corner[2, 1] - corner[0, 1], corner[2, 2] - corner[0, 2]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    if nx * sx + ny * sy + nz * sz > 0.0:
        size = -size
    out[0], out[1], out[2] = nx / size, ny / size, nz / size
