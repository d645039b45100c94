"""Compiled kernels of the renderer: rays of a window, surface points, radiance, sensor noise."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from rover_iface.cameras.kernels import back_project_one
from rover_iface.simulator.render.gravel import Stones, gravel
from rover_iface.simulator.render.texture import (
    DRIFT_QUIET,
    grains,
    ripple,
    rock_grains,
    sand_grains,
    scramble,
)
from rover_iface.simulator.render.texture_blocks import (
    BLOCK,
    DEEP,
    FIELDS,
    FOOTPRINT,
    GX,
    GY,
    GZ,
    LIGHT,
    LOOSE,
    NX,
    NY,
    NZ,
    SHADE,
    TINT,
    VX,
    VY,
    VZ,
    X,
    Y,
    Z,
    sand,
    soil,
    stone,
)

CLOSE_UP_M = 1.0e-3
"""Pixels wider than this resolve no grain."""

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]


@njit(cache=True, nogil=True)
def window_rays(
    p: F64, left: float, top: float, width: int, height: int, origin: F64, origins: F32, directions: F32
) -> None:
    """Fill float32 rays of a window of camera `p` [26], row by row, relative to the scene's `origin` [3].

    `origins`, m, and `directions` (unit) are [width height, 3], site axes; `p` is laid out as in
    `rover_iface.cameras.kernels`.
    """
    for j in range(height):
        for i in range(width):
            ox, oy, oz, dx, dy, dz = back_project_one(p, left + i, top + j)
            n = j * width + i
            origins[n, 0], origins[n, 1], origins[n, 2] = ox - origin[0], oy - origin[1], oz - origin[2]
            directions[n, 0], directions[n, 1], directions[n, 2] = dx, dy, dz


@njit(cache=True, nogil=True)
def surface(
    tfar: F32,
    prim: I32,
    u: F32,
    v: F32,
    origins: F32,
    directions: F32,
    triangles: I32,
    normals: F32,
    albedo: F32,
    gravels: F32,
    sun: F64,
    lift: float,
    points: F32,
    normal: F32,
    base: F32,
    loose: F32,
    shadow_origins: F32,
    shadow_index: I32,
) -> int:
    """Fill points, normals and albedo of the hits; return how many shadow rays were written.

    Of n rays with hits `tfar` (m), `prim` (triangle, -1 for none), `u` and `v` (barycentric) [n] are filled:
    `points` and `normal` [n, 3], `base` (albedo) and `loose` (gravel) [n], and, of those that may see
    the sun, `shadow_origins` [n, 3] and `shadow_index` [n]. `origins` and `directions` are [n, 3], `sun` [3]
    is the unit direction to the sun; all in site axes, m. The mesh is `triangles` [m, 3] with `normals` [k,
    3], `albedo` and `gravels` [k] of its vertices. `lift`, m, keeps a shadow ray off its own surface.
    """
    count = 0
    for n in range(prim.shape[0]):
        if prim[n] < 0:
            continue
        a, b, c = triangles[prim[n], 0], triangles[prim[n], 1], triangles[prim[n], 2]
        w = 1.0 - u[n] - v[n]
        nx = w * normals[a, 0] + u[n] * normals[b, 0] + v[n] * normals[c, 0]
        ny = w * normals[a, 1] + u[n] * normals[b, 1] + v[n] * normals[c, 1]
        nz = w * normals[a, 2] + u[n] * normals[b, 2] + v[n] * normals[c, 2]
        k = 1.0 / math.sqrt(max(1e-20, nx * nx + ny * ny + nz * nz))
        # a smoothed normal may look away from the ray at a silhouette
        if nx * directions[n, 0] + ny * directions[n, 1] + nz * directions[n, 2] > 0.0:
            k = -k
        normal[n, 0], normal[n, 1], normal[n, 2] = nx * k, ny * k, nz * k
        for axis in range(3):
            points[n, axis] = origins[n, axis] + tfar[n] * directions[n, axis]
        base[n] = w * albedo[a] + u[n] * albedo[b] + v[n] * albedo[c]
        loose[n] = w * gravels[a] + u[n] * gravels[b] + v[n] * gravels[c]
        facing = normal[n, 0] * sun[0] + normal[n, 1] * sun[1] + normal[n, 2] * sun[2]
        if facing > -0.25:
            up = lift + 2e-4 * tfar[n]
            for axis in range(3):
                shadow_origins[count, axis] = points[n, axis] + up * (normal[n, axis] + 0.5 * sun[axis])
            shadow_index[count] = n
            count += 1
    return count


@njit(cache=True, nogil=True)
def tell(
    tfar: F32,
    prim: I32,
    lit: F32,
    objects: I32,
    range_m: F32,
    object_index: I32,
    is_lit: npt.NDArray[np.bool_],
) -> None:
    """Fill what n rays met: range, m, infinite for the sky, number of the body, -1 for the sky, and whether
    the sun reaches it.

    `tfar` (m), `prim` and `lit` [n] are those of `surface`, `objects` [triangles] is the body of each.
    """
    for n in range(prim.shape[0]):
        met = prim[n] >= 0
        range_m[n] = tfar[n] if met else np.inf
        object_index[n] = objects[prim[n]] if met else -1
        is_lit[n] = lit[n] > 0.0


@njit(cache=True, nogil=True)
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
    kept: Stones,
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
    [11] (`Look.parameters`), `kept` the loose stones of pictures in this light (`no_stones`).
    """
    block, index = np.empty(FIELDS * BLOCK), np.empty(BLOCK, np.int64)
    cells, places, owners, stones = kept
    level = math.sqrt(max(1e-9, sun[0] * sun[0] + sun[1] * sun[1]))
    sun_x, sun_y = sun[0] / level, sun[1] / level
    sun_slope = max(0.05, sun[2] / level)
    for n in range(prim.shape[0]):
        if prim[n] < 0:
            # brighter towards the sun and the horizon
            c = directions[n, 0] * sun[0] + directions[n, 1] * sun[1] + directions[n, 2] * sun[2]
            out[n] = diffuse * (0.9 + 0.5 * max(0.0, c) ** 8 + 0.25 * (1.0 - max(0.0, directions[n, 2])))
    for material in range(3):
        count = 0
        for n in range(prim.shape[0] + 1):
            last = n == prim.shape[0]
            if not last and prim[n] >= 0 and materials[objects[prim[n]]] == material:
                index[count] = n
                count += 1
            if count == BLOCK or (last and count > 0):
                _place(block, index, count, tfar, directions, points, normal, lit, origin, pixel_rad)
                if material == 0:
                    _soil(block, index, count, loose, parameters, seed)
                    gravel(
                        block,
                        count,
                        parameters[9],
                        sun_x,
                        sun_y,
                        sun_slope,
                        seed + 101,
                        cells,
                        places,
                        owners,
                        stones,
                    )
                elif material == 1:
                    _rock(block, count, parameters, seed)
                _reflect(block, count, sun, direct, diffuse, limb, parameters[3])
                for k in range(count):
                    # a bump that hides the sun also hides some sky
                    tint = 1.0 + min(1.2, max(-0.75, block[k + TINT]))
                    out[index[k]] = max(0.02, base[index[k]] * tint) * block[k + LIGHT]
                count = 0


@njit(cache=True, nogil=True, error_model="numpy")
def _place(
    block: F64,
    index: I64,
    count: int,
    tfar: F32,
    directions: F32,
    points: F32,
    normal: F32,
    lit: F32,
    origin: F64,
    pixel_rad: float,
) -> None:
    """Fill a block with the points of `count` rays of `index`, without texture."""
    for k in range(count):
        n = index[k]
        block[k + X], block[k + Y] = origin[0] + points[n, 0], origin[1] + points[n, 1]
        block[k + Z] = origin[2] + points[n, 2]
        nx, ny, nz = float(normal[n, 0]), float(normal[n, 1]), float(normal[n, 2])
        vx, vy, vz = -directions[n, 0], -directions[n, 1], -directions[n, 2]
        facing = max(0.12, nx * vx + ny * vy + nz * vz)
        block[k + FOOTPRINT] = tfar[n] * pixel_rad / math.sqrt(facing)
        block[k + NX], block[k + NY], block[k + NZ] = nx, ny, nz
        block[k + VX], block[k + VY], block[k + VZ] = vx, vy, vz
        block[k + SHADE] = float(1.0 - lit[n])
        block[k + TINT], block[k + GX], block[k + GY], block[k + GZ] = 0.0, 0.0, 0.0, 0.0


@njit(cache=True, nogil=True)
def _soil(block: F64, index: I64, count: int, loose: F32, parameters: F64, seed: int) -> None:
    """Texture a block of soil with sand, ripples and grains, and fill how stony it is.

    Parameters are those of `radiance`.
    """
    cover, grain, ripples, close_up = parameters[5], parameters[6], parameters[7], parameters[10]
    soil(block, count, parameters[0], parameters[4], seed)
    for k in range(count):
        block[k + DEEP] = 0.0
    if cover > 0.0:
        sand(block, count, cover, seed + 707)
    wind_x, wind_y = math.cos(parameters[8]), math.sin(parameters[8])
    for k in range(count):
        x, y, footprint, deep = block[k + X], block[k + Y], block[k + FOOTPRINT], block[k + DEEP]
        stones = float(loose[index[k]])
        if cover > 0.0:
            stones *= 1.0 - DRIFT_QUIET[2] * deep
        if ripples > 0.0:
            t, hx, hy = ripple(x, y, footprint, wind_x, wind_y, seed + 1301)
            steep = ripples * (0.25 + 0.75 * deep)
            block[k + TINT] += steep * t
            block[k + GX] += steep * hx
            block[k + GY] += steep * hy
        if close_up > 0.0 and footprint < CLOSE_UP_M:
            t, hx, hy = sand_grains(x, y, footprint, seed + 1511)
            block[k + TINT] += close_up * t
            block[k + GX] += close_up * hx
            block[k + GY] += close_up * hy
        if grain > 0.0:
            block[k + TINT] += grain * grains(x, y, footprint, seed + 911)
        block[k + LOOSE] = stones


@njit(cache=True, nogil=True)
def _rock(block: F64, count: int, parameters: F64, seed: int) -> None:
    """Texture a block of rock; parameters are those of `radiance`."""
    close_up = parameters[10]
    stone(block, count, parameters[1], parameters[2], seed + 303)
    for k in range(count):
        if close_up > 0.0 and block[k + FOOTPRINT] < CLOSE_UP_M:
            place = block[k + X], block[k + Y], block[k + Z]
            nx, ny, nz = block[k + NX], block[k + NY], block[k + NZ]
            tx, hx, hy, hz = rock_grains(*place, nx, ny, nz, block[k + FOOTPRINT], seed + 1601)
            block[k + TINT] += close_up * tx
            block[k + GX] += close_up * hx
            block[k + GY] += close_up * hy
            block[k + GZ] += close_up * hz
        block[k + TINT] += 0.22 * (block[k + NZ] - 0.3)  # dust settles on what faces up


@njit(cache=True, nogil=True, error_model="numpy")
def _reflect(
    block: F64, count: int, sun: F64, direct: float, diffuse: float, limb: float, bounce: float
) -> None:
    """Fill the light that a white surface would send on, its bumps and the shadow of stones counted."""
    sx, sy, sz = sun[0], sun[1], sun[2]
    for k in range(count):
        nx, ny, nz = block[k + NX], block[k + NY], block[k + NZ]
        gx, gy, gz = block[k + GX], block[k + GY], block[k + GZ]
        along = gx * nx + gy * ny + gz * nz
        nx, ny, nz = nx - (gx - along * nx), ny - (gy - along * ny), nz - (gz - along * nz)
        long = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx * long, ny * long, nz * long
        mu0 = nx * sx + ny * sy + nz * sz
        mu = max(0.05, nx * block[k + VX] + ny * block[k + VY] + nz * block[k + VZ])
        reflect = limb * 2.0 * mu0 / (mu0 + mu) + (1.0 - limb) * mu0
        reflect = reflect if mu0 > 0.0 else 0.0
        open_sky = 0.5 + 0.5 * nz
        sunny = direct * (1.0 - block[k + SHADE]) * reflect
        block[k + LIGHT] = sunny + diffuse * (open_sky + bounce * (1.0 - open_sky))


@njit(cache=True, nogil=True, inline="always")
def gauss(i: int, j: int, k: int, salt: int) -> float:
    """Return a standard normal number of four integers (Box and Muller)."""
    a = (scramble(i, j, k, salt) + 1.0) * (1.0 / 4294967297.0)
    b = scramble(i, j, k, salt + 1013) * (6.283185307179586 / 4294967296.0)
    return math.sqrt(-2.0 * math.log(a)) * math.cos(b)


@njit(cache=True, nogil=True)
def expose(
    light: F32,
    gain: float,
    full_well: float,
    read_noise: float,
    levels: int,
    left: int,
    top: int,
    salt: int,
    out: npt.NDArray[np.uint16],
) -> None:
    """Fill digital numbers `out` [rows, columns] of `light * gain` (1 fills the well) with shot and read
    noise.

    `light` is [rows, columns]; `full_well` and `read_noise` are in electrons, `levels` is the count of
    numbers. Noise belongs to the pixel's place on the detector and to `salt`, so a window has the noise of
    the frame.
    """
    for j in range(light.shape[0]):
        for i in range(light.shape[1]):
            electrons = max(0.0, light[j, i] * gain) * full_well
            spread = math.sqrt(electrons + read_noise * read_noise)
            electrons += spread * gauss(left + i, top + j, 5, salt)
            value = math.floor(electrons / full_well * (levels - 1) + 0.5)
            out[j, i] = int(min(levels - 1.0, max(0.0, value)))
