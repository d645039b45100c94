"""Textures and radiance point by point, as they were first written: slow, and what the blocks are held to.

What is still worked out point by point (`grains`, `ripple`, ...) is the product's own.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from rover_iface.simulator.render.shade import CLOSE_UP_M
from rover_iface.simulator.render.texture import (
    CHIPS,
    DRIFT_EDGE,
    DRIFT_QUIET,
    DRIFT_TINT,
    DRIFT_WAVE,
    DUST,
    SOIL_STEEP,
    SOIL_TINT,
    SOIL_TURN,
    SOIL_WAVE,
    STONE_DUST,
    STONE_GRAIN,
    STONE_TURN,
    STONE_WAVE,
    TINT_LIMIT,
    grains,
    ripple,
    rock_grains,
    sand_grains,
)

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
MASK = 0xFFFFFFFF


@njit
def scramble(i: int, j: int, k: int, salt: int) -> int:
    """Return 32 well mixed bits of four integers."""
    n = (i * 0x9E3779B1 + j * 0x85EBCA77 + k * 0xC2B2AE3D + salt * 0x27D4EB2F) & MASK
    n = ((n ^ (n >> 15)) * 0x2C1B3C6D) & MASK
    n = ((n ^ (n >> 12)) * 0x297A2D39) & MASK
    return n ^ (n >> 15)


@njit
def unit(i: int, j: int, k: int, salt: int) -> float:
    """Return a number in [0, 1) of four integers."""
    return scramble(i, j, k, salt) * (1.0 / 4294967296.0)


@njit
def noise3(x: float, y: float, z: float, salt: int) -> tuple[float, float, float, float]:
    """Return value noise in [-1, 1] with lattice constant 1, and its gradient."""
    xi, yi, zi = math.floor(x), math.floor(y), math.floor(z)
    i, j, k = int(xi), int(yi), int(zi)
    fx, fy, fz = x - xi, y - yi, z - zi
    ux, uy, uz = fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy), fz * fz * (3.0 - 2.0 * fz)
    dx, dy, dz = 6.0 * fx * (1.0 - fx), 6.0 * fy * (1.0 - fy), 6.0 * fz * (1.0 - fz)
    a, b = unit(i, j, k, salt), unit(i + 1, j, k, salt)
    c, d = unit(i, j + 1, k, salt), unit(i + 1, j + 1, k, salt)
    e, f = unit(i, j, k + 1, salt), unit(i + 1, j, k + 1, salt)
    g, h = unit(i, j + 1, k + 1, salt), unit(i + 1, j + 1, k + 1, salt)
    x00, x10, x01, x11 = a + ux * (b - a), c + ux * (d - c), e + ux * (f - e), g + ux * (h - g)
    y0, y1 = x00 + uy * (x10 - x00), x01 + uy * (x11 - x01)
    value = y0 + uz * (y1 - y0)
    gx = dx * (((b - a) * (1 - uy) + (d - c) * uy) * (1 - uz) + ((f - e) * (1 - uy) + (h - g) * uy) * uz)
    gy = dy * ((x10 - x00) * (1 - uz) + (x11 - x01) * uz)
    gz = dz * (y1 - y0)
    return 2.0 * value - 1.0, 2.0 * gx, 2.0 * gy, 2.0 * gz


@njit
def noise2(x: float, y: float, salt: int) -> tuple[float, float, float]:
    """Return value noise in [-1, 1] with lattice constant 1, and its gradient."""
    xi, yi = math.floor(x), math.floor(y)
    i, j = int(xi), int(yi)
    fx, fy = x - xi, y - yi
    ux, uy = fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy)
    a, b = unit(i, j, 7, salt), unit(i + 1, j, 7, salt)
    c, d = unit(i, j + 1, 7, salt), unit(i + 1, j + 1, 7, salt)
    low, high = a + ux * (b - a), c + ux * (d - c)
    gx = 6.0 * fx * (1.0 - fx) * ((b - a) * (1.0 - uy) + (d - c) * uy)
    gy = 6.0 * fy * (1.0 - fy) * (high - low)
    return 2.0 * (low + uy * (high - low)) - 1.0, 2.0 * gx, 2.0 * gy


@njit
def fade(wavelength: float, footprint: float) -> float:
    """Return how much of an octave survives: 0 below 1 pixel a lattice cell (half a wave), 1 above 2."""
    t = wavelength / footprint - 1.0
    if t <= 0.0:
        return 0.0
    if t >= 1.0:
        return 1.0
    return t * t * (3.0 - 2.0 * t)


@njit
def soil(x: float, y: float, footprint: float, slope: float, salt: int) -> tuple[float, float, float]:
    """Return brightness variation and the two slopes of bare soil at a point (m); waves narrower than the
    pixel's `footprint` (m) fade, `slope` is how steep they are.
    """
    tint, hx, hy = 0.0, 0.0, 0.0
    for level in range(len(SOIL_WAVE)):
        wavelength = SOIL_WAVE[level]
        keep = fade(wavelength, footprint)
        if keep <= 0.0:
            break
        c, s = SOIL_TURN[level, 0], SOIL_TURN[level, 1]
        n, gu, gv = noise2((c * x + s * y) / wavelength, (c * y - s * x) / wavelength, salt + level)
        tint += keep * n * SOIL_TINT[level]
        steep = slope * keep * SOIL_STEEP[level]
        hx += steep * (c * gu - s * gv)
        hy += steep * (s * gu + c * gv)
    return tint, hx, hy


@njit
def drift(x: float, y: float, footprint: float, cover: float, salt: int) -> float:
    """Return how deep sand lies over the soil at a point (m): 0 none, 1 all of it hidden.

    About a share `cover` of the ground is under sand; waves narrower than the pixel's `footprint` (m) fade.
    """
    n, weight = 0.0, 1.0
    for level in range(3):
        keep = fade(DRIFT_WAVE[level], footprint)
        if keep <= 0.0:
            break
        c, s = SOIL_TURN[level + 4, 0], SOIL_TURN[level + 4, 1]
        wavelength = DRIFT_WAVE[level]
        value, _, _ = noise2((c * x + s * y) / wavelength, (c * y - s * x) / wavelength, salt + level)
        n += keep * weight * value
        weight *= 0.62
    t = min(1.0, max(0.0, (n + 1.6 * (cover - 0.5)) / DRIFT_EDGE + 0.5))
    return t * t * (3.0 - 2.0 * t)


@njit
def gravel(
    x: float,
    y: float,
    footprint: float,
    cover: float,
    sun_x: float,
    sun_y: float,
    sun_slope: float,
    salt: int,
) -> tuple[float, float, float, float]:
    """Return brightness variation, two slopes and shadow (0..1) of stones from 3 cm down to 2 mm.

    A stone is a truncated pyramid with five unequal sides, found in a jittered grid per size; `sun_x, sun_y`
    is the level unit vector to the sun and `sun_slope` the tangent of its height.
    """
    tint, hx, hy, shade = 0.0, 0.0, 0.0, 0.0
    top = 0.0
    cell = 0.08
    for level in range(5):
        size = 0.5 * cell
        keep = fade(1.3 * size, footprint)
        if keep <= 0.0:
            break
        gi, gj = math.floor(x / cell), math.floor(y / cell)
        dense = cover * (0.35 + 0.13 * level)
        for di in range(-1, 2):
            for dj in range(-1, 2):
                i, j = gi + di, gj + dj
                h = scramble(i, j, level, salt)
                if (h & 0xFFFF) * (1.0 / 65536.0) > dense:
                    continue
                h2 = scramble(i, j, level + 64, salt)
                r = cell * (0.12 + 0.26 * ((h >> 16) & 0xFF) / 255.0 * ((h >> 24) & 0xFF) / 255.0 + 0.03)
                cx = (i + 0.25 + 0.5 * (h2 & 0xFF) / 255.0) * cell
                cy = (j + 0.25 + 0.5 * ((h2 >> 8) & 0xFF) / 255.0) * cell
                ex, ey = x - cx, y - cy
                tall = r * (0.35 + 0.5 * ((h2 >> 16) & 0xFF) / 255.0)
                reach = tall / sun_slope
                far = 1.5 * r
                if ex * ex + ey * ey > (far + reach) * (far + reach):
                    continue
                turn = 6.2831853 * ((h2 >> 24) & 0xFF) / 255.0
                # the sides, seen from the point itself and from where its sun ray passes the stone
                along = -(ex * sun_x + ey * sun_y)
                along = min(max(along, 0.0), reach)
                qx, qy = ex + along * sun_x, ey + along * sun_y
                d, dq, nx, ny = -9.0, -9.0, 0.0, 0.0
                for side in range(5):
                    a = turn + 1.2566371 * side + 0.5 * (unit(i, j, side, salt + 77) - 0.5)
                    ca, sa = math.cos(a), math.sin(a)
                    w = 1.0 / (r * (0.75 + 0.5 * unit(i, j, side + 9, salt + 77)))
                    e = (ex * ca + ey * sa) * w
                    if e > d:
                        d, nx, ny = e, ca * w, sa * w
                    q = (qx * ca + qy * sa) * w
                    dq = max(dq, q)
                if d < 1.0:
                    rise = tall * min(1.0, 2.2 * (1.0 - d))
                    if rise > top:
                        top = rise
                        k = keep
                        tilt = 0.5 * (unit(i, j, 21, salt) - 0.5)
                        tilt2 = 0.5 * (unit(i, j, 22, salt) - 0.5)
                        if 2.2 * (1.0 - d) < 1.0:
                            soft = min(1.0, 1.5 * size / footprint / 3.0)
                            hx, hy = -k * soft * 2.2 * tall * nx + tilt, -k * soft * 2.2 * tall * ny + tilt2
                        else:
                            hx, hy = k * tilt, k * tilt2
                        tint = k * (0.9 * unit(i, j, 23, salt) - 0.40)
                        shade = 0.0
                elif along > 0.0 and dq < 1.0:
                    height = tall * min(1.0, 2.2 * (1.0 - dq)) - along * sun_slope
                    if height > 0.0 and top < 0.3 * tall:
                        shade = max(shade, keep * min(1.0, height / (0.15 * tall)))
        cell *= 0.5
    return tint, hx, hy, shade


@njit
def facets(x: float, y: float, z: float, edge: float, salt: int) -> tuple[float, float, float, float]:
    """Return a brightness and three slopes in [-1, 1] that are constant over cells of a unit lattice.

    `edge` is the width of the passage from cell to cell, 0..1: sharp edges, yet none sharper than the pixel.
    """
    xi, yi, zi = math.floor(x), math.floor(y), math.floor(z)
    i, j, k = int(xi), int(yi), int(zi)
    fx = min(1.0, max(0.0, (x - xi - 0.5) / edge + 0.5))
    fy = min(1.0, max(0.0, (y - yi - 0.5) / edge + 0.5))
    fz = min(1.0, max(0.0, (z - zi - 0.5) / edge + 0.5))
    tint, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
    for a in range(2):
        wa = fx if a == 1 else 1.0 - fx
        for b in range(2):
            wb = wa * (fy if b == 1 else 1.0 - fy)
            for c in range(2):
                w = wb * (fz if c == 1 else 1.0 - fz)
                if w <= 0.0:
                    continue
                h = scramble(i + a, j + b, k + c, salt)
                w /= 127.5
                tint += w * ((h & 255) - 127.5)
                gx += w * (((h >> 8) & 255) - 127.5)
                gy += w * (((h >> 16) & 255) - 127.5)
                gz += w * (((h >> 24) & 255) - 127.5)
    return tint, gx, gy, gz


@njit
def stone(
    x: float, y: float, z: float, footprint: float, slope: float, mottle: float, salt: int
) -> tuple[float, float, float, float]:
    """Return brightness variation and the gradient of a rock surface's height: chipped facets, grain, dust.

    Facets are cells of a lattice bent by the coarser octaves. Where dust lies the grain fades, in patches of
    all sizes: quiet and rough places lie side by side at every range.
    """
    tint, gx, gy, gz = 0.0, 0.0, 0.0, 0.0
    bend, bare, dust = 0.0, 1.0, 0.0
    for level in range(len(STONE_WAVE)):
        wavelength = STONE_WAVE[level]
        keep = fade(wavelength, footprint)
        if keep <= 0.0:
            break
        c, s = STONE_TURN[level, 0], STONE_TURN[level, 1]
        u, v, w = (c * x + s * z) / wavelength, y / wavelength + 3.7 * level, (c * z - s * x) / wavelength
        n, nu, nv, nw = noise3(u, v, w, salt + level)
        if level >= 1:
            dust += n * STONE_DUST[level]
            bare = min(1.0, max(0.0, DUST[0] + DUST[1] * dust))
            bare = DUST[2] + (1.0 - DUST[2]) * bare * bare * (3.0 - 2.0 * bare)
        strength = keep * STONE_GRAIN[level]
        if wavelength < 0.1:
            strength *= bare
        if level % 2 == 1:  # every second octave ridged: cracks
            tint += strength * mottle * (0.5 - 1.6 * abs(n))
            strength = -strength if n > 0.0 else strength
        else:
            tint += strength * mottle * n
        gx += slope * strength * (c * nu - s * nw)
        gy += slope * strength * nv
        gz += slope * strength * (s * nu + c * nw)
        if 1 <= level <= 3:
            size = 0.42 * wavelength
            edge = min(1.0, max(0.06, 1.2 * footprint / size))
            t, hx, hy, hz = facets(
                u / 0.42 + bend, v / 0.42 + 0.6 * bend, w / 0.42 - bend, edge, salt + 40 + level
            )
            k = fade(size, footprint)
            tint += CHIPS[1] * k * t
            gx += CHIPS[0] * k * (c * hx - s * hz)
            gy += CHIPS[0] * k * hy
            gz += CHIPS[0] * k * (s * hx + c * hz)
        bend = CHIPS[2] * 2.0 * n / 0.42
    tint += DUST[3] * (0.5 - bare)
    return tint / math.sqrt(1.0 + (tint / TINT_LIMIT) ** 2), gx, gy, gz


@njit
def radiance(
    tfar: F32,
    prim: I32,
    directions: F32,
    points: F32,
    normal: F32,
    base: F32,
    loose: F32,
    lit: F32,
    objects: I32,
    materials: I32,
    origin: F64,
    sun: F64,
    direct: float,
    diffuse: float,
    limb: float,
    pixel_rad: float,
    parameters: F64,
    seed: int,
    out: F32,
) -> None:
    """Fill the radiance of each ray, in units where a white level plate in full sun has 1.

    `parameters`: soil slope, stone slope, stone mottle, extra light from the ground, factor on the soil's
    brightness, share of the ground under sand, brightness of unresolved grains, slope of wind ripples,
    azimuth of the wind, factor on the gravel's brightness, strength of grains in close-ups. Photometry is
    Lunar-Lambert (McEwen 1996), `limb` its weight.

    Of n rays: `tfar` (m), `prim`, `base`, `loose`, `lit` and `out` [n], `directions`, `points` and `normal`
    [n, 3], as `surface` fills them; site axes. `objects` [triangles] is the body of each, `materials`
    [bodies]; `origin` [3], m, is that of the points, `sun` [3] the unit direction to the sun; `parameters`
    [11] (`Look.parameters`).
    """
    soil_slope, stone_slope, mottle, bounce = parameters[0], parameters[1], parameters[2], parameters[3]
    soil_mottle, sand, grain = parameters[4], parameters[5], parameters[6]
    ripples, wind_x, wind_y = parameters[7], math.cos(parameters[8]), math.sin(parameters[8])
    gravel_mottle, close_up = parameters[9], parameters[10]
    level = math.sqrt(max(1e-9, sun[0] * sun[0] + sun[1] * sun[1]))
    sun_x, sun_y = sun[0] / level, sun[1] / level
    sun_slope = max(0.05, sun[2] / level)
    for n in range(prim.shape[0]):
        if prim[n] < 0:
            # brighter towards the sun and the horizon
            c = directions[n, 0] * sun[0] + directions[n, 1] * sun[1] + directions[n, 2] * sun[2]
            out[n] = diffuse * (0.9 + 0.5 * max(0.0, c) ** 8 + 0.25 * (1.0 - max(0.0, directions[n, 2])))
            continue
        x, y, z = origin[0] + points[n, 0], origin[1] + points[n, 1], origin[2] + points[n, 2]
        nx, ny, nz = float(normal[n, 0]), float(normal[n, 1]), float(normal[n, 2])
        vx, vy, vz = -directions[n, 0], -directions[n, 1], -directions[n, 2]
        facing = max(0.12, nx * vx + ny * vy + nz * vz)
        footprint = tfar[n] * pixel_rad / math.sqrt(facing)
        material = materials[objects[prim[n]]]
        gx, gy, gz, tint, shade = 0.0, 0.0, 0.0, 0.0, float(1.0 - lit[n])
        if material == 0:
            tint, gx, gy = soil(x, y, footprint, soil_slope, seed)
            tint *= soil_mottle
            stones = float(loose[n])
            deep = 0.0
            if sand > 0.0:
                deep = drift(x, y, footprint, sand, seed + 707)
                tint = tint * (1.0 - DRIFT_QUIET[0] * deep) + DRIFT_TINT * deep
                gx *= 1.0 - DRIFT_QUIET[1] * deep
                gy *= 1.0 - DRIFT_QUIET[1] * deep
                stones *= 1.0 - DRIFT_QUIET[2] * deep
            if ripples > 0.0:
                t, hx, hy = ripple(x, y, footprint, wind_x, wind_y, seed + 1301)
                steep = ripples * (0.25 + 0.75 * deep)
                tint += steep * t
                gx += steep * hx
                gy += steep * hy
            if close_up > 0.0 and footprint < CLOSE_UP_M:
                t, hx, hy = sand_grains(x, y, footprint, seed + 1511)
                tint += close_up * t
                gx += close_up * hx
                gy += close_up * hy
            if grain > 0.0:
                tint += grain * grains(x, y, footprint, seed + 911)
            if stones > 0.0:
                t, hx, hy, s = gravel(x, y, footprint, stones, sun_x, sun_y, sun_slope, seed + 101)
                tint += gravel_mottle * t
                gx += hx
                gy += hy
                shade = max(shade, s)
        elif material == 1:
            tint, gx, gy, gz = stone(x, y, z, footprint, stone_slope, mottle, seed + 303)
            if close_up > 0.0 and footprint < CLOSE_UP_M:
                tx, hx, hy, hz = rock_grains(x, y, z, nx, ny, nz, footprint, seed + 1601)
                tint += close_up * tx
                gx += close_up * hx
                gy += close_up * hy
                gz += close_up * hz
            tint += 0.22 * (nz - 0.3)  # dust settles on what faces up
        along = gx * nx + gy * ny + gz * nz
        nx, ny, nz = nx - (gx - along * nx), ny - (gy - along * ny), nz - (gz - along * nz)
        k = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx * k, ny * k, nz * k
        mu0 = nx * sun[0] + ny * sun[1] + nz * sun[2]
        mu = max(0.05, nx * vx + ny * vy + nz * vz)
        reflect = 0.0
        if mu0 > 0.0:
            reflect = limb * 2.0 * mu0 / (mu0 + mu) + (1.0 - limb) * mu0
        open_sky = 0.5 + 0.5 * nz
        light = direct * (1.0 - shade) * reflect + diffuse * (open_sky + bounce * (1.0 - open_sky))
        # a bump that hides the sun also hides some sky
        out[n] = max(0.02, base[n] * (1.0 + min(1.2, max(-0.75, tint)))) * light
