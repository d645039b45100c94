"""Compiled parts of the rock matching: the likelihood of a pose on a raster of poses."""

from __future__ import annotations

import math

import numba as nb
import numpy as np


@nb.njit(cache=True, nogil=True)
def pair_terms(ax, ay, bx, by, cov_a, cov_b, heading, wide_m2, turn_rad2):  # type: ignore[no-untyped-def]
    """Return offsets a - R b [n, m, 2], inverse covariances [n, m, 3] (xx, xy, yy) and log determinants.

    `wide_m2` is added for the width of a cell of the raster, `turn_rad2` for the step in heading.
    """
    n, m = len(ax), len(bx)
    offset = np.empty((n, m, 2))
    inverse = np.empty((n, m, 3))
    logdet = np.empty((n, m))
    c, s = math.cos(heading), math.sin(heading)
    for j in range(m):
        x, y = c * bx[j] - s * by[j], s * bx[j] + c * by[j]
        p, q, r = cov_b[j, 0], cov_b[j, 1], cov_b[j, 2]
        xx = c * c * p - 2 * c * s * q + s * s * r + wide_m2 + turn_rad2 * y * y
        yy = s * s * p + 2 * c * s * q + c * c * r + wide_m2 + turn_rad2 * x * x
        xy = c * s * p + (c * c - s * s) * q - c * s * r - turn_rad2 * x * y
        for i in range(n):
            axx, axy, ayy = xx + cov_a[i, 0], xy + cov_a[i, 1], yy + cov_a[i, 2]
            det = axx * ayy - axy * axy
            offset[i, j, 0], offset[i, j, 1] = ax[i] - x, ay[i] - y
            inverse[i, j, 0], inverse[i, j, 1], inverse[i, j, 2] = ayy / det, -axy / det, axx / det
            logdet[i, j] = math.log(det)
    return offset, inverse, logdet


@nb.njit(cache=True, nogil=True)
def score_shifts(offset, inverse, logdet, gain, log_clutter, detected, tx, ty, gate):  # type: ignore[no-untyped-def]
    """Return the log likelihood ratio of each shift (tx[k], ty[l]) against "nothing in common".

    `gain` [n, m] is the log ratio of sizes, `log_clutter` [n] the log density of rocks round each of the
    first stop, `detected` [m] the odds that a rock of the second is among them.
    """
    n, m = gain.shape
    out = np.zeros((len(tx), len(ty)))
    for j in range(m):
        gained = np.zeros((len(tx), len(ty)))
        for i in range(n):
            # reach of the gate in each direction bounds the part of the raster that this pair can touch
            a, b, d = inverse[i, j, 0], inverse[i, j, 1], inverse[i, j, 2]
            det = a * d - b * b
            reach_x, reach_y = math.sqrt(gate * d / det), math.sqrt(gate * a / det)
            x0, y0 = offset[i, j, 0], offset[i, j, 1]
            level = gain[i, j] - log_clutter[i] - 0.5 * logdet[i, j] - math.log(2 * math.pi)
            for k in range(len(tx)):
                dx = x0 - tx[k]
                if abs(dx) > reach_x:
                    continue
                for l in range(len(ty)):
                    dy = y0 - ty[l]
                    if abs(dy) > reach_y:
                        continue
                    far = a * dx * dx + 2 * b * dx * dy + d * dy * dy
                    if far < gate:
                        gained[k, l] += math.exp(level - 0.5 * far)
        for k in range(len(tx)):
            for l in range(len(ty)):
                out[k, l] += math.log(1.0 - detected[j] + detected[j] * gained[k, l])
    return out
