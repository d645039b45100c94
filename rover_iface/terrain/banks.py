"""Sand that wind has banked against rocks: ramps to windward, skirts, and tails in their lee."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rover_iface.streams import stream
from rover_iface.terrain.fractal import smooth_step
from rover_iface.terrain.rocks import Rock

Array = NDArray[np.floating]

STEEPEST = 0.5
"""Slope of banked sand: 27 degrees, a little under its angle of repose (some 30 to 35 degrees)."""

BANKED_M = 0.14
"""Rocks narrower than this hold no bank that posts of 5 cm would show."""

TAIL = 2.5, 5.0
"""Length of the sand in a rock's lee, in heights of the rock; by eye, Spirit's Pancam and Navcam frames."""


def wind_of(seed: int) -> float:
    """Return the azimuth, rad, that the wind of a site comes from."""
    return float(stream("wind", seed).uniform(0.0, math.tau))


def bank_depth(xs: Array, ys: Array, rocks: Sequence[Rock], banks: float, wind_rad: float) -> Array:
    """Return the depth of sand, m, that wind has banked against rocks, on the raster [len(ys), len(xs)].

    To windward a ramp climbs a third of a rock, all round a skirt hides its foot, in its lee a tail runs out
    to a point. A share `banks` of the rocks has any; which, and how much, follows from their seeds.
    """
    depth = np.zeros((len(ys), len(xs)))
    c, s = math.cos(wind_rad), math.sin(wind_rad)
    for rock in rocks:
        share = ((rock.seed >> 7) % 1024) / 1024
        if rock.family == "plate" or rock.diameter < BANKED_M or share >= banks:
            continue
        much = 1.0 - 0.6 * share / banks
        half = 0.5 * rock.diameter * (0.5 + 0.5 * rock.elongation)
        tail = rock.height * (TAIL[0] + (TAIL[1] - TAIL[0]) * much)
        reach = half + max(tail, 2.5 * half)
        columns = slice(*np.searchsorted(xs, (rock.x - reach, rock.x + reach)))
        rows = slice(*np.searchsorted(ys, (rock.y - reach, rock.y + reach)))
        dx, dy = xs[None, columns] - rock.x, ys[rows, None] - rock.y
        if not dx.size or not dy.size:
            continue
        lee, aside = -(c * dx + s * dy), np.abs(c * dy - s * dx)
        beyond = np.hypot(dx, dy) - 0.85 * half
        high = min(rock.height * 0.45, STEEPEST * half) * much
        skirt = 0.35 * high * np.clip(1.0 - beyond / (0.7 * half), 0.0, 1.0) ** 1.5
        ramp = (
            0.8 * high * np.clip(1.0 - beyond / (1.1 * half), 0.0, 1.0) * np.clip(-lee / (half + 0.02), 0, 1)
        )
        left = np.clip(1.0 - (lee - 0.3 * half) / tail, 0.0, 1.0)
        wide = np.maximum(0.95 * half * (0.25 + 0.75 * left), 0.02)
        crest = high * left * np.clip(1.0 - aside / wide, 0.0, 1.0) * (lee > 0)
        here = np.maximum(np.maximum(skirt, ramp), crest)
        np.maximum(depth[rows, columns], here, out=depth[rows, columns])
    return depth


def sandy(depth_m: Array) -> Array:
    """Return which share of the ground is hidden by sand of a depth [...], m: none shows below 1 cm of it."""
    return np.asarray(smooth_step(depth_m / 0.01))
