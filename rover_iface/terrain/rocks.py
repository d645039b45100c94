"""Rocks: how many of which size, where they lie, and what they look like as triangles.

Sizes follow the exponential law of Golombek and Rapp (1997): the share of ground covered by rocks of
diameter D or
more is F(D) = k exp(-q D) with q = 1.79 + 0.152 / k and k the total cover. A rock is a star-shaped body: an
icosphere displaced by smooth noise, cut by random planes so that it has faces and edges, stretched and part
buried. Its shape follows from its own seed alone, so a rock looks the same in every scene. Rocks of another
family than `boulder` are shaped by `rover_iface.terrain.rock_shapes`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mission.codec import Codec
from mission.values import Positive, Share, reads_over, value
from rover_iface.errors import TerrainFormatError
from rover_iface.terrain.rock_shapes import SHARP, Body, Family, radii

Array = NDArray[np.floating]


@value
class Rock:
    """One rock: middle of its foot on the ground (x, y, z), largest width and height above ground, metres.

    `albedo` 0 is drawn from the id; `dust` is how much of what faces up is under it. `sides` are azimuth,
    rad, and distance from the middle, m, of the joints round a plate; none: as its seed has them. `lean` is
    the slope of its beds to east and to north.
    """

    id: str
    x: float
    y: float
    z: float
    diameter: Positive
    height: Positive
    yaw: float = 0.0
    elongation: float = 0.8
    burial: float = 0.3
    seed: int = 0
    family: Family = "boulder"
    albedo: Share = 0.0
    dust: Share = 0.0
    sides: tuple[tuple[float, float], ...] = ()
    lean: tuple[float, float] = (0.0, 0.0)


@reads_over
@value
class RockList:
    """What a `rocks/1` document holds."""

    rocks: tuple[Rock, ...] = ()


ROCKS = Codec(
    RockList, "rocks/1", "list of rocks", upgrades={"": ("rocks/1", dict)}, error=TerrainFormatError
)


OF_A_GEOLOGY = "family", "albedo", "dust", "sides", "lean"


def rocks_text(rocks: Sequence[Rock]) -> str:
    """Return the `rocks/1` document as text; members that only a geology sets are left out of other rocks."""
    listing = ROCKS.document(RockList(tuple(rocks)))
    for rock, entry in zip(rocks, listing["rocks"], strict=True):
        if rock.family == "boulder":
            for name in OF_A_GEOLOGY:
                del entry[name]
    return json.dumps(listing, separators=(",", ":")) + "\n"


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: vertices [n, 3] float32, site metres; triangles [m, 3] int32, counter-clockwise from
    outside.
    """

    vertices: NDArray[np.float32]
    triangles: NDArray[np.int32]
    id: str = ""


MOST_EXPONENT = 700.0
"""exp(-700) is 1e-304: ground with so few rocks has none, and its table would divide 0 by 0."""


def golombek_rapp_cover(diameter_m: float, total_cover: float) -> float:
    """Return the share of ground covered by rocks of at least `diameter_m`."""
    if not 0 < total_cover < 1:
        raise TerrainFormatError(f"rock cover is {total_cover}; it must lie between 0 and 1")
    return total_cover * math.exp(-(1.79 + 0.152 / total_cover) * diameter_m)


def rock_density(smallest_m: float, largest_m: float, total_cover: float) -> tuple[float, Array, Array]:
    """Return rocks per square metre in a size range, and a table (share, diameter) to draw sizes from.

    Notes
    -----
    A rock of diameter D covers pi D^2 / 4, so n(D) dD = -F'(D) / (pi D^2 / 4) dD.
    """
    golombek_rapp_cover(0.0, total_cover)
    q = 1.79 + 0.152 / total_cover
    size = np.geomspace(smallest_m, largest_m, 4000)
    if q * smallest_m > MOST_EXPONENT:
        return 0.0, np.linspace(0.0, 1.0, size.size), size
    density = total_cover * q * np.exp(-q * size) / (math.pi * size**2 / 4)
    cumulative = np.concatenate([[0.0], np.cumsum(np.diff(size) * (density[1:] + density[:-1]) / 2)])
    total = float(cumulative[-1])
    return total, cumulative / total, size


@lru_cache(maxsize=8)
def icosphere(detail: int) -> tuple[Array, NDArray[np.int32]]:
    """Return unit directions [n, 3] and triangles [m, 3] of an icosahedron split `detail` times."""
    g = (1 + math.sqrt(5)) / 2
    corners: list[tuple[float, float, float]] = [
        (-1, g, 0),
        (1, g, 0),
        (-1, -g, 0),
        (1, -g, 0),
        (0, -1, g),
        (0, 1, g),
    ]
    corners += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11), (1, 5, 9), (5, 11, 4), (11, 10, 2)]
    faces += [(10, 7, 6), (7, 1, 8), (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9), (4, 9, 5)]
    faces += [(2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    points = [np.array(c, dtype=float) / math.sqrt(1 + g * g) for c in corners]
    for _ in range(detail):
        middle: dict[tuple[int, int], int] = {}

        def between(a: int, b: int, middle: dict[tuple[int, int], int] = middle) -> int:
            pair = (min(a, b), max(a, b))
            if pair not in middle:
                p = points[a] + points[b]
                points.append(p / np.linalg.norm(p))
                middle[pair] = len(points) - 1
            return middle[pair]

        split = []
        for a, b, c in faces:
            ab, bc, ca = between(a, b), between(b, c), between(c, a)
            split += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        faces = split
    return np.array(points), np.array(faces, dtype=np.int32)


_WAVES = 6
_CUTS = 9


def _shape_numbers(seed: int) -> Array:
    return np.random.default_rng(seed).random(_WAVES * 5 + _CUTS * 3 + 4)


def _bodies(rocks: Sequence[Rock], directions: Array) -> Array:
    """Return vertices [rocks, n, 3], site frame, for unit directions [n, 3]: all boulders, or none."""
    if rocks[0].family == "boulder":
        return _placed(rocks, _boulders(rocks, directions))
    shapes = [radii(rock.family, _body(rock), directions)[:, None] * directions for rock in rocks]
    return _placed(rocks, np.stack(shapes))


def _body(rock: Rock) -> Body:
    half = rock.diameter / 2
    sides = tuple((azimuth, distance / half) for azimuth, distance in rock.sides)
    return Body(rock.seed, half, rock.height / (1 - rock.burial), sides)


def _boulders(rocks: Sequence[Rock], directions: Array) -> Array:
    """Return boulders [rocks, n, 3], their middle at 0, for unit directions [n, 3]."""
    numbers = np.array([_shape_numbers(rock.seed) for rock in rocks])
    waves = numbers[:, : _WAVES * 5].reshape(-1, _WAVES, 5)
    cuts = numbers[:, _WAVES * 5 : _WAVES * 5 + _CUTS * 3].reshape(-1, _CUTS, 3)
    frequency = np.array([1.6, 2.2, 3.1, 4.4, 6.2, 8.8])
    vector = (waves[..., :3] - 0.5) * 2 * frequency[:, None]
    phase = waves[..., 3] * 2 * math.pi
    weight = 0.34 / frequency * (0.5 + waves[..., 4])
    angle = np.einsum("rwk,nk->rwn", vector, directions) + phase[..., None]
    radius = 1.0 + np.einsum("rw,rwn->rn", weight, np.sin(angle))
    # Facets: a half space n . p <= c caps the radius in its direction at c / (n . d).
    azimuth = cuts[..., 0] * 2 * math.pi
    up = cuts[..., 1] * 1.6 - 0.6
    flat = np.sqrt(np.clip(1 - up**2, 0, None))
    normal = np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), up], axis=-1)
    offset = 0.62 + 0.34 * cuts[..., 2]
    facing = np.einsum("rck,nk->rcn", normal, directions)
    limit = np.where(facing > 0.05, offset[..., None] / np.maximum(facing, 0.05), np.inf)
    radius = np.minimum(radius, limit.min(axis=1))
    radius += 0.012 * np.sin(np.einsum("rwk,nk->rwn", vector * 4.3, directions) + 2 * phase[..., None]).sum(
        axis=1
    )
    return np.asarray(radius[..., None] * directions)


def _placed(rocks: Sequence[Rock], body: Array) -> Array:
    """Return bodies [rocks, n, 3] stretched to their sizes, turned and moved to the site frame."""
    half = np.array([rock.diameter / 2 for rock in rocks])
    stretch = np.array([rock.elongation for rock in rocks])
    wide = np.hypot(body[..., 0], body[..., 1]).max(axis=1)
    wide = np.where([bool(rock.sides) for rock in rocks], 1.0, wide)  # those are measured already
    body[..., 0] *= (half / wide)[:, None]
    body[..., 1] *= (half * stretch / wide)[:, None]
    # The part above ground measures `height`, the buried part `burial` of the whole.
    top = body[..., 2].max(axis=1)
    bottom = body[..., 2].min(axis=1)
    height = np.array([rock.height for rock in rocks])
    burial = np.array([rock.burial for rock in rocks])
    whole = height / (1 - burial)
    body[..., 2] = (body[..., 2] - top[:, None]) / (top - bottom)[:, None] * whole[:, None] + height[:, None]
    yaw = np.array([rock.yaw for rock in rocks])
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    place = np.array([(rock.x, rock.y, rock.z) for rock in rocks])
    vertices = np.stack(
        [
            c * body[..., 0] - s * body[..., 1] + place[:, None, 0],
            s * body[..., 0] + c * body[..., 1] + place[:, None, 1],
            body[..., 2] + place[:, None, 2],
        ],
        axis=-1,
    )
    lean = np.array([rock.lean for rock in rocks])
    if lean.any():
        away = vertices[..., :2] - place[:, None, :2]
        vertices[..., 2] += np.einsum("rk,rnk->rn", lean, away)
    return vertices


def natural_detail(diameter_m: float, family: Family = "boulder") -> int:
    """Return how often the icosphere is split for a rock of this size: edges of about 2 to 6 cm; half of that
    for families with edges and beds.
    """
    split = 2 if diameter_m < 0.2 else 3 if diameter_m < 0.7 or family == "plate" else 4
    return split + (family in SHARP)


def rock_meshes(rocks: Sequence[Rock], *, detail: int | None = None) -> list[Mesh]:
    """Return one closed mesh per rock, in the order given, in the site frame.

    `detail` is the number of splits of the icosahedron (2: 320 triangles, 3: 1,280, 4: 5,120); by size if
    absent.
    """
    meshes: list[Mesh | None] = [None] * len(rocks)
    groups: dict[tuple[int, bool], list[int]] = {}
    for k, rock in enumerate(rocks):
        level = natural_detail(rock.diameter, rock.family) if detail is None else detail
        groups.setdefault((level, rock.family == "boulder"), []).append(k)
    for (level, _), members in groups.items():
        directions, triangles = icosphere(level)
        for start in range(0, len(members), 512):
            part = members[start : start + 512]
            vertices = _bodies([rocks[k] for k in part], directions).astype(np.float32)
            for k, v in zip(part, vertices, strict=True):
                meshes[k] = Mesh(v, triangles, rocks[k].id)
    return [mesh for mesh in meshes if mesh is not None]


def raise_rocks(
    heights: Array,
    west: float,
    south: float,
    spacing: float,
    rocks: Sequence[Rock],
    *,
    detail: int | None = None,
) -> Array:
    """Return heights [rows, columns], m (row 0 south), with rocks put on: the higher of ground and rock at
    each post.
    """
    from rover_iface.terrain.raster import drape_triangles

    result = np.array(heights, dtype=np.float64)
    if not rocks:
        return result
    groups: dict[tuple[int, bool], list[Rock]] = {}
    for rock in rocks:
        level = _raster_detail(rock.diameter, spacing) if detail is None else detail
        groups.setdefault((level, rock.family == "boulder"), []).append(rock)
    for level, boulder in sorted(groups):
        chosen = groups[level, boulder]
        directions, triangles = icosphere(level)
        for start in range(0, len(chosen), 1024):
            body = _bodies(chosen[start : start + 1024], directions)
            drape_triangles(result, west, south, spacing, np.ascontiguousarray(body), triangles)
    return result


def _raster_detail(diameter_m: float, spacing_m: float) -> int:
    """Return a split that is not coarser than the posts need nor finer than the meshes."""
    posts = diameter_m / spacing_m
    return min(natural_detail(diameter_m), 1 if posts < 3 else 2 if posts < 8 else 3)


def draw_rocks(
    rng: np.random.Generator,
    *,
    west: float,
    south: float,
    east: float,
    north: float,
    total_cover: float,
    smallest_m: float,
    largest_m: float = 2.0,
) -> Array:
    """Return places x, y and diameters [n, 3], site frame, m, of rocks, uniform over a rectangle, by the
    law of Golombek and Rapp (1997).
    """
    density, share, size = rock_density(smallest_m, largest_m, total_cover)
    count = int(rng.poisson(density * (east - west) * (north - south)))
    return np.column_stack(
        [
            rng.uniform(west, east, count),
            rng.uniform(south, north, count),
            np.interp(rng.random(count), share, size),
        ]
    )
