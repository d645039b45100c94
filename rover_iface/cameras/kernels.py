"""Compiled kernels of the camera models; one flat parameter vector per camera.

Layout of `p`, 26 float64: C 0:3, A 3:6, H 6:9, V 9:12, O 12:15 (unit), R 15:18, E 18:21, kind 21
(0 CAHV, 1 CAHVOR, 2 CAHVORE), linearity 22, largest usable squared radius 23 (lambda^2/omega^2 in CAHVOR,
chi^2 in CAHVORE), 24 whether O is not quite unit (CAHVORE), 25 spare. Formulas: Yakimovsky and Cunningham
1978 (CAHV), Gennery 1993 (CAHVOR), Gennery 2006 (CAHVORE).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[np.float64]

CAHV, CAHVOR, CAHVORE = 0, 1, 2
PARAMETERS = 26
SMALL = 1e-9


@njit(cache=True, nogil=True, inline="always")
def _dot(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> float:
    return ax * bx + ay * by + az * bz


@njit(cache=True, nogil=True)
def _chi_of_theta(theta: float, linearity: float) -> tuple[float, float]:
    """Return chi and d chi/d theta: tan, identity and sine for linearity +, 0 and -."""
    if linearity > 1e-15:
        c = math.cos(linearity * theta)
        return math.tan(linearity * theta) / linearity, 1.0 / (c * c)
    if linearity < -1e-15:
        return math.sin(linearity * theta) / linearity, math.cos(linearity * theta)
    return theta, 1.0


@njit(cache=True, nogil=True)
def _entrance_angle(omega: float, lam: float, e0: float, e1: float, e2: float) -> tuple[float, float]:
    """Return the angle theta at which the ray meets the moving entrance pupil, and d(F)/d(theta); Newton."""
    theta = math.atan2(lam, omega)
    slope = omega * math.cos(theta) + lam * math.sin(theta)
    for _ in range(60):
        s, c = math.sin(theta), math.cos(theta)
        t2 = theta * theta
        g = e0 + t2 * (e1 + t2 * e2)
        dg = theta * (2.0 * e1 + 4.0 * e2 * t2)
        slope = omega * c + lam * s - (1.0 - c) * g - (theta - s) * dg
        step = (omega * s - lam * c - (theta - s) * g) / slope
        theta -= step
        if abs(step) < 1e-13:
            break
    return theta, slope


@njit(cache=True, nogil=True)
def _project_formula(p: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return (sample, line, depth along A) of a point; NaN pixels when it is not in front."""
    dx, dy, dz = x - p[0], y - p[1], z - p[2]
    kind = int(p[21])
    if kind >= 1:
        omega = _dot(dx, dy, dz, p[12], p[13], p[14])
        lx, ly, lz = dx - omega * p[12], dy - omega * p[13], dz - omega * p[14]
        lam2 = lx * lx + ly * ly + lz * lz
        if kind == 1:
            if omega <= 0.0:
                return math.nan, math.nan, -1.0
            tau = lam2 / (omega * omega)
            if tau > p[23]:
                return math.nan, math.nan, -1.0
            mu = p[15] + tau * (p[16] + tau * p[17])
            dx, dy, dz = dx + mu * lx, dy + mu * ly, dz + mu * lz
        else:
            lam = math.sqrt(lam2)
            if lam > SMALL * abs(omega):
                theta, _slope = _entrance_angle(omega, lam, p[18], p[19], p[20])
                if abs(theta * p[22]) >= 0.5 * math.pi or theta <= 0.0 or theta > 0.95 * math.pi:
                    return math.nan, math.nan, -1.0
                chi, _dchi = _chi_of_theta(theta, p[22])
                chi2 = chi * chi
                if chi2 > p[23]:
                    return math.nan, math.nan, -1.0
                zeta = lam / chi
                mu = 1.0 + p[15] + chi2 * (p[16] + chi2 * p[17])
                dx, dy, dz = zeta * p[12] + mu * lx, zeta * p[13] + mu * ly, zeta * p[14] + mu * lz
            elif omega <= 0.0:
                return math.nan, math.nan, -1.0
    alpha = _dot(dx, dy, dz, p[3], p[4], p[5])
    if alpha <= 1e-12:
        return math.nan, math.nan, -1.0
    return (
        _dot(dx, dy, dz, p[6], p[7], p[8]) / alpha,
        _dot(dx, dy, dz, p[9], p[10], p[11]) / alpha,
        alpha,
    )


@njit(cache=True, nogil=True)
def _undistort(target: float, r0: float, r1: float, r2: float) -> float:
    """Solve (1 + r0) u + r1 u^3 + r2 u^5 = target for u near target; Newton."""
    u = target
    for _ in range(60):
        u2 = u * u
        f = u * (1.0 + r0 + u2 * (r1 + u2 * r2)) - target
        df = 1.0 + r0 + u2 * (3.0 * r1 + 5.0 * r2 * u2)
        if df < 1e-6:
            u *= 0.8
            continue
        step = f / df
        u -= step
        if abs(step) < 1e-14 * (1.0 + abs(u)):
            break
    return u


@njit(cache=True, nogil=True)
def back_project_one(p: Array, sample: float, line: float) -> tuple[float, float, float, float, float, float]:
    """Return ray origin (x, y, z), m, and unit direction of a pixel, in the frame of camera `p` [26]."""
    ax, ay, az = p[9] - line * p[3], p[10] - line * p[4], p[11] - line * p[5]
    bx, by, bz = p[6] - sample * p[3], p[7] - sample * p[4], p[8] - sample * p[5]
    rx, ry, rz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    # (V - yA) x (H - xA) points along A when A . (V x H) > 0, against it otherwise
    vhx, vhy, vhz = p[10] * p[8] - p[11] * p[7], p[11] * p[6] - p[9] * p[8], p[9] * p[7] - p[10] * p[6]
    n = math.sqrt(rx * rx + ry * ry + rz * rz)
    if _dot(p[3], p[4], p[5], vhx, vhy, vhz) < 0.0:
        n = -n
    rx, ry, rz = rx / n, ry / n, rz / n
    kind = int(p[21])
    ox, oy, oz = p[0], p[1], p[2]
    if kind == 0:
        return ox, oy, oz, rx, ry, rz
    zeta = _dot(rx, ry, rz, p[12], p[13], p[14])
    lx, ly, lz = rx - zeta * p[12], ry - zeta * p[13], rz - zeta * p[14]
    lam = math.sqrt(lx * lx + ly * ly + lz * lz)
    if lam < SMALL * abs(zeta):
        return ox, oy, oz, p[12], p[13], p[14]
    u = _undistort(lam / zeta, p[15], p[16], p[17])
    if kind == 1:
        s, c = u, 1.0
        m = math.sqrt(s * s + c * c)
        s, c = s / m, c / m
    else:
        if p[22] > 1e-15:
            theta = math.atan(p[22] * u) / p[22]
        elif p[22] < -1e-15:
            theta = math.asin(min(1.0, max(-1.0, p[22] * u))) / p[22]
        else:
            theta = u
        s, c = math.sin(theta), math.cos(theta)
        t2 = theta * theta
        shift = (theta / s - 1.0) * (p[18] + t2 * (p[19] + t2 * p[20]))
        ox, oy, oz = ox + shift * p[12], oy + shift * p[13], oz + shift * p[14]
    k = s / lam
    return ox, oy, oz, c * p[12] + k * lx, c * p[13] + k * ly, c * p[14] + k * lz


@njit(cache=True, nogil=True)
def project_one(p: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return (sample, line, depth) of a point in the frame of camera `p` [26], the exact inverse of
    `back_project_one`.

    Pixels and metres; the pixel is NaN when the point is not in front. Labels print O to six digits.
    Back-projection uses it as printed (the missions' definition); with an O that is not quite unit the
    forward formula then misses by up to 0.005 px, which two corrections remove.
    """
    u, v, alpha = _project_formula(p, x, y, z)
    if p[24] == 0.0 or math.isnan(u):
        return u, v, alpha
    qx, qy, qz = x, y, z
    for _ in range(2):
        ox, oy, oz, dx, dy, dz = back_project_one(p, u, v)
        t = _dot(x - ox, y - oy, z - oz, dx, dy, dz)
        qx, qy, qz = qx + x - ox - t * dx, qy + y - oy - t * dy, qz + z - oz - t * dz
        u, v, alpha = _project_formula(p, qx, qy, qz)
        if math.isnan(u):
            break
    return u, v, alpha


@njit(cache=True, nogil=True)
def jacobian_one(p: Array, x: float, y: float, z: float, out: Array) -> None:
    """Fill `out` (2, 3) with d(sample, line)/d(point); NaN when the point is not in front.

    Pixels per metre, by a point in the frame of camera `p` (26,).
    """
    u, v, _alpha = project_one(p, x, y, z)
    if math.isnan(u):
        out[:, :] = math.nan
        return
    q = np.empty(3)
    q[0], q[1], q[2] = x - p[0], y - p[1], z - p[2]
    # D = d(apparent ray)/d(point)
    D = np.eye(3)
    kind = int(p[21])
    if kind >= 1:
        o = p[12:15]
        omega = q[0] * o[0] + q[1] * o[1] + q[2] * o[2]
        L = q - omega * o
        lam2 = L[0] * L[0] + L[1] * L[1] + L[2] * L[2]
        if kind == 1:
            tau = lam2 / (omega * omega)
            mu = p[15] + tau * (p[16] + tau * p[17])
            dmu = p[16] + 2.0 * tau * p[17]
            for i in range(3):
                dtau = 2.0 * (L[i] - tau * omega * o[i]) / (omega * omega)
                for k in range(3):
                    dl = (1.0 if i == k else 0.0) - o[i] * o[k]
                    D[k, i] += mu * dl + L[k] * dmu * dtau
            q = q + mu * L
        else:
            lam = math.sqrt(lam2)
            if lam > SMALL * abs(omega):
                theta, slope = _entrance_angle(omega, lam, p[18], p[19], p[20])
                chi, dchi = _chi_of_theta(theta, p[22])
                chi2 = chi * chi
                mu = 1.0 + p[15] + chi2 * (p[16] + chi2 * p[17])
                dmu = chi * (2.0 * p[16] + 4.0 * p[17] * chi2)
                s, c = math.sin(theta), math.cos(theta)
                zeta = lam / chi
                for i in range(3):
                    dlam = L[i] / lam
                    dtheta = (c * dlam - s * o[i]) / slope
                    dzeta = dlam / chi - zeta / chi * dchi * dtheta
                    for k in range(3):
                        dl = (1.0 if i == k else 0.0) - o[i] * o[k]
                        D[k, i] = dzeta * o[k] + mu * dl + L[k] * dmu * dchi * dtheta
                q = zeta * o + mu * L
            else:
                for i in range(3):
                    for k in range(3):
                        D[k, i] += p[15] * ((1.0 if i == k else 0.0) - o[i] * o[k])
    alpha = q[0] * p[3] + q[1] * p[4] + q[2] * p[5]
    for i in range(3):
        da = p[3] * D[0, i] + p[4] * D[1, i] + p[5] * D[2, i]
        dh = p[6] * D[0, i] + p[7] * D[1, i] + p[8] * D[2, i]
        dv = p[9] * D[0, i] + p[10] * D[1, i] + p[11] * D[2, i]
        out[0, i] = (dh - u * da) / alpha
        out[1, i] = (dv - v * da) / alpha


@njit(cache=True, nogil=True)
def project_many(p: Array, points: Array, pixels: Array) -> None:
    """Write the pixels [n, 2] of points [n, 3], m, in the frame of camera `p` [26]; NaN where a point is not
    in front of the camera.
    """
    for i in range(points.shape[0]):
        u, v, _a = project_one(p, points[i, 0], points[i, 1], points[i, 2])
        pixels[i, 0] = u
        pixels[i, 1] = v


@njit(cache=True, nogil=True)
def back_project_many(p: Array, pixels: Array, origins: Array, directions: Array) -> None:
    """Write origins, m, and unit directions [n, 3], frame of camera `p` [26], of rays of pixels [n, 2]."""
    for i in range(pixels.shape[0]):
        a, b, c, d, e, f = back_project_one(p, pixels[i, 0], pixels[i, 1])
        origins[i, 0], origins[i, 1], origins[i, 2] = a, b, c
        directions[i, 0], directions[i, 1], directions[i, 2] = d, e, f


@njit(cache=True, nogil=True)
def jacobian_many(p: Array, points: Array, out: Array) -> None:
    """Write the derivatives [n, 2, 3], px/m, of pixels by points [n, 3] in the frame of camera `p` [26]."""
    for i in range(points.shape[0]):
        jacobian_one(p, points[i, 0], points[i, 1], points[i, 2], out[i])


@njit(cache=True, nogil=True)
def warp_map(p_out: Array, p_in: Array, width: int, height: int, range_m: float, map_xy: Array) -> None:
    """Fill `map_xy` (height, width, 2) with the pixel of camera `p_in` seen by each pixel of `p_out`.

    `p_out` and `p_in` (26,) are in one frame; what they see lies at `range_m`.
    """
    for j in range(height):
        for i in range(width):
            ox, oy, oz, dx, dy, dz = back_project_one(p_out, float(i), float(j))
            u, v, _a = project_one(p_in, ox + range_m * dx, oy + range_m * dy, oz + range_m * dz)
            map_xy[j, i, 0] = u
            map_xy[j, i, 1] = v


@njit(cache=True, nogil=True, inline="always")
def between(image: Array, x: float, y: float) -> float:
    """Return an image [rows, columns] between its pixels, bilinearly, at a sample x and line y inside it."""
    i, j = min(int(x), image.shape[1] - 2), min(int(y), image.shape[0] - 2)
    fx, fy = x - i, y - j
    top = image[j, i] * (1.0 - fx) + image[j, i + 1] * fx
    low = image[j + 1, i] * (1.0 - fx) + image[j + 1, i + 1] * fx
    return top * (1.0 - fy) + low * fy


@njit(cache=True, nogil=True)
def sample_bilinear(image: Array, map_xy: Array, fill: float, out: Array) -> None:
    """Fill `out` [rows, columns] with `image` [h, w] sampled bilinearly; `fill` where that is outside.

    `map_xy` [rows, columns, 2] holds the (sample, line) in `image` of each pixel of `out`.
    """
    rows, columns = image.shape
    for j in range(out.shape[0]):
        for i in range(out.shape[1]):
            x, y = map_xy[j, i, 0], map_xy[j, i, 1]
            if not (0.0 <= x <= columns - 1.0 and 0.0 <= y <= rows - 1.0):
                out[j, i] = fill
                continue
            out[j, i] = between(image, x, y)
