"""Shapes of rocks by family: plates and slabs with beds, cracked blocks, ventifacts, rounded float.

Each is a star-shaped body: a distance from its middle in every direction, so it is closed and may be sampled
as finely as its use needs. Sizes are in units of its half width; whoever places it stretches it.

Beds are 1 to 10 cm thick ("very thin" and "thin" of Ingram 1954). A ventifact has faces ground by wind that
meet in keels, and pits and flutes on the windward side (Laity and Bridges 2009). Other figures are set by eye
beside the frames of Spirit, Opportunity and Curiosity in `studies/common/real_frames.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.floating]
Family = Literal["boulder", "slab", "plate", "block", "layered", "ventifact", "rounded"]
"""`boulder` is the one family of a site without a geology; `rover_iface.terrain.rocks` makes it."""

SHARP: frozenset[Family] = frozenset(("slab", "plate", "block", "layered", "ventifact"))
"""Families whose faces meet in edges."""

CREASE_RAD = math.radians(35.0)
"""Faces that meet at more than this keep an edge: above the turns between triangles of one worn face (some
20 degrees), below those of a joint (40 and more)."""

BED_M = 0.012, 0.06
"""Thickness of beds, m: from the middle of Ingram's "very thin" to that of his "thin"."""


@dataclass(frozen=True, slots=True)
class Body:
    """What the shape of one rock depends on.

    Attributes
    ----------
    seed
        Of everything that is drawn.
    half_m, height_m
        Half its width and its whole height, m: beds and cracks have sizes of their own.
    sides
        (azimuth, distance in half widths) of the joints round a plate; none: drawn.
    """

    seed: int
    half_m: float
    height_m: float
    sides: tuple[tuple[float, float], ...] = ()

    def rng(self) -> np.random.Generator:
        """Return the stream of the rock's shape."""
        return np.random.default_rng([self.seed, 0x5AFE])


def radii(family: Family, body: Body, directions: Array) -> Array:
    """Return the distance [n] of the surface from the middle in unit directions [n, 3], in half widths.

    The rock's z axis is its height, x the way the wind comes from (a ventifact's). Raises `KeyError` for a
    family that has no shape here.
    """
    return _SHAPES[family](body, directions)


def _within(planes: Array, directions: Array) -> Array:
    """Return the distance [n] at which directions [n, 3] leave half spaces (normal, offset) [k, 4]."""
    facing = directions @ planes[:, :3].T
    reach = np.where(facing > 1e-3, planes[:, 3] / np.maximum(facing, 1e-3), np.inf)
    return np.asarray(reach.min(axis=1))


def _plane(azimuth: float, up: float, offset: float) -> tuple[float, float, float, float]:
    """Return a half space by its normal's azimuth, rad, and height on the unit sphere, and its offset."""
    level = math.sqrt(max(0.0, 1.0 - up * up))
    return level * math.cos(azimuth), level * math.sin(azimuth), up, offset


def _waves(
    rng: np.random.Generator, directions: Array, frequencies: Sequence[float], strength: float
) -> Array:
    """Return smooth noise [n] of directions [n, 3], each frequency weaker by its size."""
    total = np.zeros(len(directions))
    for frequency in frequencies:
        vector = rng.normal(size=3) * frequency
        total += (
            strength * frequencies[0] / frequency * np.sin(directions @ vector + rng.uniform(0, math.tau))
        )
    return total


def _sides(rng: np.random.Generator, count: int, lean: float) -> list[tuple[float, float, float, float]]:
    """Return upright faces round a body, their azimuths and distances uneven."""
    turn = rng.uniform(0, math.tau)
    step = math.tau / count
    return [
        _plane(
            turn + step * (k + rng.uniform(-0.28, 0.28)), rng.uniform(-lean, lean), rng.uniform(0.62, 0.95)
        )
        for k in range(count)
    ]


def _bedded(
    rng: np.random.Generator, body: Body, directions: Array, reach: Array, *, deep: float, dip_rad: float
) -> Array:
    """Return `reach` [n] with its flanks cut back bed by bed; `deep` is the most, a share of the half width.

    The thickness of beds is that of rock, whatever the size of the stone; hard beds stand out.
    """
    beds = int(np.clip(round(body.height_m / rng.uniform(*BED_M)), 2, 12))
    edges = np.sort(rng.uniform(0.06, 0.94, beds - 1)) - 0.5
    back = rng.uniform(0.0, deep, beds)
    back[1::2] += 0.5 * deep
    phase, lobes = rng.uniform(0, math.tau, beds), rng.integers(2, 6, beds)
    azimuth = np.arctan2(directions[:, 1], directions[:, 0])
    strike = rng.uniform(0, math.tau)
    slope = math.tan(dip_rad) * body.half_m / max(body.height_m, 1e-3)
    height = reach * (
        directions[:, 2] - slope * (directions[:, 0] * math.cos(strike) + directions[:, 1] * math.sin(strike))
    )
    bed = np.searchsorted(edges, height)
    cut = back[bed] * (1.0 + 0.3 * np.sin(lobes[bed] * azimuth + phase[bed]))
    flank = np.clip(np.hypot(directions[:, 0], directions[:, 1]) * reach / 0.5, 0.0, 1.0)
    return np.asarray(reach * (1.0 - flank * cut))


def _cracked(rng: np.random.Generator, body: Body, directions: Array, reach: Array, count: int) -> Array:
    """Return `reach` [n] with open cracks: grooves of centimetres where joint planes meet the surface."""
    out = reach.copy()
    width = float(np.clip(0.012 / body.half_m, 0.025, 0.09))
    for _ in range(count):
        azimuth, lean = rng.uniform(0, math.tau), rng.uniform(-0.25, 0.25)
        normal = np.array(_plane(azimuth, lean, 0.0)[:3])
        bend = 0.05 * np.sin(5.0 * directions[:, 2] + 3.0 * directions[:, 0] + rng.uniform(0, math.tau))
        away = np.abs(directions @ normal * reach - rng.uniform(-0.4, 0.4) - bend)
        out -= rng.uniform(0.05, 0.12) * np.exp(-((away / width) ** 2)) * np.minimum(1.0, reach)
    return np.maximum(out, 0.15)


def _slab(body: Body, directions: Array) -> Array:
    rng = body.rng()
    planes = _sides(rng, int(rng.integers(4, 8)), 0.12)
    planes += [_plane(rng.uniform(0, math.tau), math.cos(rng.uniform(0.0, 0.12)), 0.5), (0.0, 0.0, -1.0, 0.5)]
    reach = _within(np.array(planes), directions)
    reach = _bedded(rng, body, directions, reach, deep=0.08, dip_rad=0.0)
    return reach + _waves(rng, directions, (4.0, 7.0, 12.0), 0.012)


def _plate(body: Body, directions: Array) -> Array:
    rng = body.rng()
    planes = [_plane(azimuth, 0.0, offset) for azimuth, offset in body.sides] or _sides(rng, 6, 0.05)
    planes += [_plane(rng.uniform(0, math.tau), math.cos(rng.uniform(0.0, 0.05)), 0.5), (0.0, 0.0, -1.0, 0.5)]
    reach = _within(np.array(planes), directions)
    reach = _bedded(rng, body, directions, reach, deep=0.05, dip_rad=0.0)
    reach = reach + _waves(rng, directions, (3.0, 6.0, 11.0, 17.0), 0.02)
    return _cracked(rng, body, directions, reach, int(rng.integers(0, 3)))


def _block(body: Body, directions: Array) -> Array:
    rng = body.rng()
    turn = rng.uniform(0, math.tau)
    planes = []
    for k in range(4):  # two sets of upright joints, roughly square to each other
        azimuth = turn + 0.5 * math.pi * k + rng.normal(0.0, 0.2)
        planes.append(_plane(azimuth, rng.uniform(-0.25, 0.35), rng.uniform(0.55, 0.9)))
    planes += [_plane(rng.uniform(0, math.tau), rng.uniform(0.9, 1.0), rng.uniform(0.45, 0.65))]
    planes += [(0.0, 0.0, -1.0, 0.6)]
    for _ in range(int(rng.integers(2, 6))):  # broken corners
        planes.append(_plane(rng.uniform(0, math.tau), rng.uniform(-0.2, 0.8), rng.uniform(0.62, 0.85)))
    reach = _within(np.array(planes), directions) + _waves(rng, directions, (4.0, 9.0, 15.0), 0.014)
    return _cracked(rng, body, directions, reach, int(rng.integers(0, 3)))


def _layered(body: Body, directions: Array) -> Array:
    rng = body.rng()
    planes = _sides(rng, int(rng.integers(4, 8)), 0.25)
    planes += [_plane(rng.uniform(0, math.tau), math.cos(rng.uniform(0.0, 0.4)), 0.5), (0.0, 0.0, -1.0, 0.5)]
    reach = _within(np.array(planes), directions)
    reach = _bedded(rng, body, directions, reach, deep=0.10, dip_rad=rng.uniform(0.0, 0.35))
    reach = reach + _waves(rng, directions, (4.0, 9.0, 16.0), 0.016)
    return _cracked(rng, body, directions, reach, int(rng.integers(0, 2)))


def _ventifact(body: Body, directions: Array) -> Array:
    rng = body.rng()
    # ground faces: towards the wind, 30 to 60 degrees steep
    planes = [
        _plane(rng.uniform(-0.9, 0.9), rng.uniform(0.5, 0.87), rng.uniform(0.42, 0.6))
        for _ in range(int(rng.integers(2, 4)))
    ]
    planes += [
        _plane(math.pi + rng.uniform(-1.4, 1.4), rng.uniform(-0.1, 0.6), rng.uniform(0.6, 0.85))
        for _ in range(int(rng.integers(2, 5)))
    ]
    planes += [(0.0, 0.0, -1.0, 0.55)]
    round_ = 0.95 + _waves(rng, directions, (2.0, 3.5), 0.05)
    reach = np.minimum(round_, _within(np.array(planes), directions))
    windward = np.clip(0.25 + directions[:, 0] + 0.5 * directions[:, 2], 0.0, 1.0)
    # pits of 0.5 to 2 cm, as wide as twice their depth or more
    for _ in range(int(rng.integers(10, 40))):
        middle = rng.normal(size=3) + np.array((0.8, 0.0, 0.5))
        middle /= np.linalg.norm(middle)
        wide = float(np.clip(rng.uniform(0.005, 0.02) / body.half_m, 0.05, 0.16))
        away = np.arccos(np.clip(directions @ middle, -1.0, 1.0)) / wide
        reach = reach - 0.4 * wide * windward * np.exp(-(away**2))
    flutes = np.sin(rng.uniform(14.0, 22.0) * directions[:, 1] + rng.uniform(0, math.tau))
    return np.asarray(reach - 0.012 * windward * flutes)


def _rounded(body: Body, directions: Array) -> Array:
    rng = body.rng()
    reach = 0.9 + _waves(rng, directions, (1.5, 2.5, 4.0), 0.08)
    worn = np.array([_plane(rng.uniform(0, math.tau), rng.uniform(-0.5, 1.0), rng.uniform(0.72, 0.9))])
    cap = _within(worn, directions)
    # a worn face passes into the round without an edge
    return np.asarray(-np.log(np.exp(-14.0 * reach) + np.exp(-14.0 * np.minimum(cap, 3.0))) / 14.0)


_SHAPES: Mapping[Family, Callable[[Body, Array], Array]] = {
    "slab": _slab,
    "plate": _plate,
    "block": _block,
    "layered": _layered,
    "ventifact": _ventifact,
    "rounded": _rounded,
}
