"""Compiled least squares for the rock solids: heights, and a damped Gauss-Newton step within bounds."""

from __future__ import annotations

import math

import numba as nb
import numpy as np

HEMISPHEROID, CONE, TETRAHEDRON, ELLIPSOID = 0, 1, 2, 3


@nb.njit(cache=True, nogil=True)
def heights(family, p, x, y, edge, out):  # type: ignore[no-untyped-def]
    """Write the heights of a solid at x, y [n]; parameters as in `rock_models.FAMILIES`.

    A spheroid's height goes on as a straight line beyond the squared radius share `edge`.
    """
    root = math.sqrt(edge)
    for i in range(len(x)):
        dx, dy = x[i] - p[0], y[i] - p[1]
        if family in (HEMISPHEROID, ELLIPSOID):
            if family == HEMISPHEROID:
                q = 1.0 - (dx * dx + dy * dy) / (p[2] * p[2])
            else:
                c, s = math.cos(p[5]), math.sin(p[5])
                along, across = dx * c + dy * s, dy * c - dx * s
                q = 1.0 - (along / p[2]) ** 2 - (across / p[4]) ** 2
            out[i] = p[3] * (math.sqrt(q) if q > edge else root + (q - edge) / (2.0 * root))
        elif family == CONE:
            out[i] = p[3] * (1.0 - math.sqrt(dx * dx + dy * dy) / p[2])
        else:
            worst = -1e300
            for k in range(3):
                turn = p[4] + math.pi / 3 + 2 * math.pi / 3 * k  # corners at phi, edges at r / 2
                worst = max(worst, dx * math.cos(turn) + dy * math.sin(turn))
            out[i] = p[3] * (1.0 - worst / (p[2] / 2))


@nb.njit(cache=True, nogil=True)
def fit(family, start, low, high, x, y, z, scale, edge, most):  # type: ignore[no-untyped-def]
    """Return parameters, half the sum of squares and the normal matrix of the best fit from a start.

    Levenberg-Marquardt; a step that leaves the bounds is cut off at them. `scale` sizes the differences.
    """
    n, m = len(x), len(start)
    p = np.minimum(np.maximum(start, low), high)
    h, moved = np.empty(n), np.empty(n)
    jac = np.empty((n, m))
    heights(family, p, x, y, edge, h)
    cost = 0.5 * ((h - z) ** 2).sum()
    damping = 1e-3
    normal = np.eye(m)
    small = 1e-6 * scale
    for _ in range(most):
        for k in range(m):
            q = p.copy()
            q[k] += small
            heights(family, q, x, y, edge, moved)
            q[k] -= 2 * small
            jac[:, k] = moved
            heights(family, q, x, y, edge, moved)
            jac[:, k] = (jac[:, k] - moved) / (2 * small)
        normal = jac.T @ jac
        gradient = jac.T @ (h - z)
        better = False
        change = 0.0
        for _ in range(8):
            damped = normal.copy()
            for k in range(m):
                damped[k, k] += damping * normal[k, k] + 1e-12
            step = np.linalg.solve(damped, -gradient)
            q = np.minimum(np.maximum(p + step, low), high)
            heights(family, q, x, y, edge, moved)
            other = 0.5 * ((moved - z) ** 2).sum()
            if other < cost:
                change = (cost - other) / max(cost, 1e-30)
                p, cost = q, other
                h[:] = moved
                damping = max(damping / 5.0, 1e-9)
                better = True
                break
            damping *= 5.0
        if not better or change < 1e-9:
            break
    return p, cost, normal
