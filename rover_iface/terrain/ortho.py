"""The ortho image of a generated terrain: what a camera overhead would see of it.

Colours follow the true ortho images of four Curiosity sites (shadow 90, 64, 47; ground 150, 117, 97; bright
dust 200, 160, 133): reddish dust, darker sand, paler bedrock slabs, greyer rocks with dust on their tops.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rover_iface.terrain.fractal import smooth_step, spectral_noise
from rover_iface.terrain.landscape import Landscape
from rover_iface.terrain.rocks import Rock, raise_rocks

Array = NDArray[np.floating]

SUN_AZIMUTH_RAD = math.radians(125.0)
SUN_HEIGHT_RAD = math.radians(42.0)

_SOIL = np.array([156.0, 117.0, 92.0])
_SAND = np.array([128.0, 97.0, 79.0])
_DUST = np.array([183.0, 140.0, 112.0])
_SLAB = np.array([187.0, 150.0, 124.0])
_ROCK = np.array([126.0, 104.0, 91.0])
_SHADOW = np.array([0.50, 0.46, 0.42])


def paint(site: Landscape, rocks: list[Rock], extent_m: float, pixel_m: float) -> NDArray[np.uint8]:
    """Return the ortho image [rows, columns, 3], RGB of 8 bits, row 0 in the north, of a square round the
    origin.
    """
    from rover_iface.terrain.raster import cast_shadow

    count = round(extent_m / pixel_m)
    axis = (np.arange(count) + 0.5) * pixel_m - extent_m / 2
    west = float(axis[0])
    ground = site.ground(axis, axis)
    grain_rng = np.random.default_rng([site.recipe.seed, 91, count])
    side = 512
    tile = spectral_noise(grain_rng, side, 1.5)
    repeat = -(-count // side)
    grain = np.tile(tile, (repeat, repeat))[:count, :count]
    speckle = np.roll(grain[::-1, ::-1], (137, 211), axis=(0, 1))
    # Small stones below the size of modelled rocks: peaks of the grain stand out of the ground.
    tone, cover = site.tone.at(axis, axis), site.cover.at(axis, axis)
    stony = smooth_step(0.5 + 0.55 * cover)
    stones = np.clip(grain + 0.5 * speckle - 1.55, 0, None) * stony
    sandy = np.zeros_like(ground)
    slabs = np.zeros_like(ground)
    if site.recipe.outcrop:
        slabs = site.outcrop_mask(axis, axis)
    if site.recipe.ripples:
        sandy = site.ripple_mask(axis, axis) * (1 - slabs)
    stones *= (1 - 0.95 * sandy) * (1 - 0.6 * slabs)
    relief = ground + 0.5 * pixel_m * np.minimum(stones, 1.6) + 0.05 * pixel_m * grain * (1 - 0.6 * sandy)
    surface = raise_rocks(relief, west, west, pixel_m, rocks)
    stone = surface - relief
    is_rock = stone > 0.004

    colour = _mix(_SOIL, _DUST, smooth_step(0.45 + 0.28 * tone))
    colour = _blend(colour, _SAND, 0.55 * smooth_step(0.3 - 0.5 * cover))
    if site.recipe.ripples:
        crest = site._ripple(axis, axis)
        colour = _blend(colour, _SAND, sandy * (0.75 - 0.45 * crest))
    if site.recipe.outcrop and site.recipe.geology is None:
        crack, label = site.cracks(axis, axis)
        plate = _SLAB[None, None, :] * (0.90 + 0.18 * label + 0.03 * grain)[..., None]
        # Sand lies in the low parts and in the cracks.
        buried = np.clip(smooth_step(0.25 - 0.9 * site.detail.at(axis, axis) + 0.25 * tone), 0, 0.85)
        open_ = slabs * (1 - buried) * smooth_step((crack - 0.012) / 0.045)
        colour = colour * (1 - open_[..., None]) + plate * open_[..., None]
    if site.recipe.tracks:
        # Pressed soil is smooth and darker: the bright dust is gone.
        colour = _blend(colour, _SAND * 0.82, 0.7 * site.ruts(axis, axis))
    pebble = np.clip(stones * 1.4, 0, 0.8)
    colour = _blend(colour, _ROCK * 0.92, pebble)
    if rocks:
        tint, dusty = _rock_tint(rocks, axis, pixel_m, stone)
        rock = (_ROCK[None, None, :] * tint[..., None]) * (1 + 0.07 * grain[..., None])
        rock = rock * (1 - dusty[..., None]) + _DUST * 0.98 * dusty[..., None]
        colour = np.where(is_rock[..., None], rock, colour)

    gx = np.gradient(surface, pixel_m, axis=1)
    gy = np.gradient(surface, pixel_m, axis=0)
    east, north = math.sin(SUN_AZIMUTH_RAD), math.cos(SUN_AZIMUTH_RAD)
    rise = math.tan(SUN_HEIGHT_RAD)
    norm = np.sqrt(gx**2 + gy**2 + 1)
    sun = (-gx * east - gy * north + rise) / norm / math.hypot(1.0, rise)
    flat = rise / math.hypot(1.0, rise)
    lit = cast_shadow(surface, pixel_m, east, north, rise, 2.5)
    sky = 1 / norm
    # Creases are darker than crests: height against its surroundings.
    hollow = np.clip((surface - _box_mean(surface, max(2, round(0.12 / pixel_m)))) / 0.05, -1, 1)
    light = 0.27 * sky * (1 + 0.22 * hollow) + 0.73 * np.clip(sun, 0, None) / flat * lit
    shaded = colour * light[..., None]
    shadow = colour * _SHADOW * (0.55 + 0.45 * sky[..., None])
    shaded = np.maximum(shaded, shadow * 0.62)
    shaded *= (1 + 0.028 * grain + 0.022 * speckle)[..., None]
    return np.clip(np.rint(shaded), 0, 255).astype(np.uint8)[::-1].copy()


def _mix(a: Array, b: Array, share: Array) -> Array:
    return a + (b - a) * share[..., None]


def _blend(colour: Array, other: Array, share: Array) -> Array:
    return colour + (other - colour) * share[..., None]


def _box_mean(values: Array, radius: int) -> Array:
    """Return the mean over a square of 2 radius + 1 posts, edges repeated."""
    width = 2 * radius + 1
    out = values
    for ax in (0, 1):
        pad = [(0, 0), (0, 0)]
        pad[ax] = (radius + 1, radius)
        total = np.cumsum(np.pad(out, pad, mode="edge"), axis=ax)
        upper = np.take(total, np.arange(width, total.shape[ax]), axis=ax)
        lower = np.take(total, np.arange(0, total.shape[ax] - width), axis=ax)
        out = (upper - lower) / width
    return out


def _rock_tint(rocks: list[Rock], axis: Array, pixel_m: float, stone: Array) -> tuple[Array, Array]:
    """Return brightness per rock and the share of dust on its top, for every pixel."""
    count = len(axis)
    tint = np.ones((count, count))
    dusty = np.zeros((count, count))
    for rock in reversed(rocks):
        r = rock.diameter / 2
        c0 = max(0, math.floor((rock.x - r - axis[0]) / pixel_m))
        c1 = min(count, math.ceil((rock.x + r - axis[0]) / pixel_m) + 1)
        r0 = max(0, math.floor((rock.y - r - axis[0]) / pixel_m))
        r1 = min(count, math.ceil((rock.y + r - axis[0]) / pixel_m) + 1)
        if c0 >= c1 or r0 >= r1:
            continue
        share = ((rock.seed >> 5) % 1000) / 1000
        here = np.s_[r0:r1, c0:c1]
        if rock.family == "boulder":
            tint[here] = 0.82 + 0.36 * share
            top = np.clip(stone[here] / rock.height - 0.55, 0, 0.45) / 0.45
            dusty[here] = (0.25 + 0.5 * ((rock.seed >> 15) % 1000) / 1000) * top
            continue
        over = np.hypot(axis[None, c0:c1] - rock.x, axis[r0:r1, None] - rock.y) < r
        # rocks whose albedo is drawn from their ids have 0.22 in the mean
        tint[here] = np.where(over, rock.albedo / 0.22, tint[here])
        dusty[here] = np.where(over, rock.dust * (stone[here] > 0.5 * rock.height), dusty[here])
    return tint, dusty
