"""Legs of the localisation studies: generated terrain, a stop at each end, what stereo sees, the truth."""

from __future__ import annotations

import hashlib
import math
import pickle
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.panorama import Panorama
from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.frames import Pose
from rover_iface.localization.ground_points import (
    CELL_RAD,
    GroundPoints,
    direction_raster,
    points_of_panorama,
)
from rover_iface.localization.rock_extraction import ExtractionOptions, extract_rocks
from rover_iface.localization.rock_matching import LegPrior
from rover_iface.localization.seen_rock import SeenRock
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.panorama import take_panorama
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.render.scene import Scene
from rover_iface.terrain.generate import generate_terrain
from rover_iface.terrain.rocks import Rock, rock_meshes
from rover_iface.terrain.terrain import Terrain

Array = npt.NDArray[np.float64]
MAST_M = 1.5
RANGE_FACTOR = 235.4
SEEN_CELLS = 12
SEEN_HEIGHT_M = 0.15


@dataclass(frozen=True, eq=False)
class Leg:
    """One leg: the ground and two stops with opposite views, each looking at the other."""

    terrain: Terrain
    scene: Scene
    eyes: tuple[Array, Array]
    looks: tuple[float, float]


def make_leg(seed: int, length_m: float = 26.0, *, rock_cover: float | None = None) -> Leg:
    """Return leg number `seed` on a terrain of its own; rocks cover 1 to 8 % of the ground."""
    rng = np.random.default_rng([seed, 0x1E6])
    cover = float(rng.uniform(0.01, 0.08)) if rock_cover is None else rock_cover
    terrain = generate_terrain(
        seed,
        64.0,
        rock_cover=cover,
        inner_m=8.0,
        inner_spacing_m=0.1,
        spacing_m=0.25,
        crater=False,
        outcrop=False,
        relief_m=1.0,
        ortho=False,
        smallest_rock_m=0.12,
    )
    scene = scene_from_terrain(
        terrain, (0.0, 0.0), radius_m=32.0, spacing_m=0.25, far_m=40.0, stones_per_m2=0.0, seed=seed
    )
    turn = float(rng.uniform(-math.pi, math.pi))
    half = 0.5 * length_m * np.array([math.cos(turn), math.sin(turn)])
    eyes = []
    for sign in (-1.0, 1.0):
        xy = sign * half + rng.uniform(-0.2, 0.2, 2)
        eyes.append(np.array([*xy, terrain.height_at(*xy) + MAST_M]))
    look = math.atan2(*(eyes[1] - eyes[0])[1::-1])
    return Leg(terrain, scene, (eyes[0], eyes[1]), (look, look + math.pi))


@dataclass(frozen=True, eq=False)
class Sight:
    """What one stop sees: true ranges and bodies on the raster of directions."""

    eye: Array
    directions: Array
    ranges: Array
    bodies: npt.NDArray[np.int32]
    on_rock: npt.NDArray[np.bool_]


def look(leg: Leg, end: int, *, span_rad: float = math.radians(120.0)) -> Sight:
    """Return the true ranges of one end of a leg towards the other."""
    azimuth = np.arange(-span_rad / 2, span_rad / 2, CELL_RAD) + leg.looks[end]
    elevation = np.arange(math.radians(3.0), math.radians(-22.0), -CELL_RAD)
    level = np.cos(elevation)[:, None]
    z = np.broadcast_to(np.sin(elevation)[:, None], (len(elevation), len(azimuth)))
    directions = np.stack((level * np.cos(azimuth), level * np.sin(azimuth), z), axis=-1)
    flat = directions.reshape(-1, 3)
    hit = leg.scene.cast(np.broadcast_to(leg.eyes[end], flat.shape), flat)
    far = hit["tfar"].astype(np.float64)
    prim = hit["primID"].astype(np.int64)
    bodies = np.where(far < 1e30, leg.scene.objects[np.clip(prim, 0, len(leg.scene.objects) - 1)], -1)
    ranges = np.where(far < 1e30, far, np.inf)
    shape = directions.shape[:2]
    rock = np.array([bool(name) for name in leg.scene.ids])[bodies] & (bodies >= 0)
    return Sight(
        leg.eyes[end],
        directions,
        ranges.reshape(shape),
        bodies.reshape(shape).astype(np.int32),
        rock.reshape(shape),
    )


@dataclass(frozen=True)
class StereoNoise:
    """How far off modelled disparities are, px.

    Each kind has a part that hangs together over `width_cells` (a Gauss filter's) and one of each cell's own;
    a stop has one bias. Measured on one end each of eight rendered legs
    (`python -m studies.localization --only noise`, terrains 10000 to 10007; the table is on the page of
    results). Of near and far the larger is taken: rocks to 15 m, ground beyond. The bias is that of rocks and
    of ground to 15 m; ground beyond has 0.1 px, which stands for nothing here, as rocks are placed by their
    own points.
    """

    rock_px: float = 0.106
    rock_white_px: float = 0.131
    ground_px: float = 0.328
    ground_white_px: float = 0.257
    bias_px: float = 0.02
    width_cells: float = 1.3
    grown: float = 0.33


def stereo_points(sight: Sight, rng: np.random.Generator, noise: StereoNoise | None = None) -> GroundPoints:
    """Return the points that stereo would give of a sight.

    A near body grows by a cell at its edge in a share of the places (the window's width), and 3 % of the
    cells are missing.
    """
    from scipy.ndimage import gaussian_filter, maximum_filter

    noise = noise or StereoNoise()
    disparity = RANGE_FACTOR / sight.ranges
    grown = maximum_filter(disparity, size=3)
    disparity = np.where(rng.random(disparity.shape) < noise.grown, grown, disparity)
    blob = gaussian_filter(rng.standard_normal(disparity.shape), noise.width_cells)
    together = np.where(sight.on_rock, noise.rock_px, noise.ground_px)
    white = np.where(sight.on_rock, noise.rock_white_px, noise.ground_white_px)
    seen = disparity + together * blob / blob.std() + white * rng.standard_normal(disparity.shape)
    seen += noise.bias_px * rng.standard_normal()
    good = (seen > RANGE_FACTOR / 45.0) & np.isfinite(sight.ranges) & (rng.random(disparity.shape) > 0.03)
    points = sight.eye + sight.directions[good] * (RANGE_FACTOR / seen[good])[:, None]
    return GroundPoints(points, sight.eye, RANGE_FACTOR)


@dataclass(frozen=True, eq=False)
class Seen:
    """What was extracted at one end, and the truth about it.

    Attributes
    ----------
    rocks
        In the frame of the stop: level, axes of the site, origin at the eye.
    bodies
        For each rock the ids of the bodies that fill at least a fifth of it; empty: ground.
    visible
        Ids of the rocks that could be found: `SEEN_CELLS` cells or more, `SEEN_HEIGHT_M` high, within reach.
    windowed
        As `bodies`, of the cells next to a body too: what stereo matches is a window, and that moves a patch
        of a few cells. Only of rendered ends.
    """

    rocks: list[SeenRock]
    bodies: list[frozenset[str]]
    visible: frozenset[str]
    windowed: tuple[frozenset[str], ...] = ()


def see(leg: Leg, end: int, seed: int, *, models: bool = True, farthest_m: float = 24.0) -> Seen:
    """Return the rocks extracted from modelled stereo at one end of a leg."""
    sight = look(leg, end)
    points = stereo_points(sight, np.random.default_rng([seed, end]))
    local = points.from_eye()
    rocks = extract_rocks(local, models=models)
    bodies = bodies_of(leg, leg.eyes[end], local, rocks)
    return Seen(rocks, bodies, visible_rocks(leg, sight, farthest_m))


def bodies_of(
    leg: Leg, eye: Array, local: GroundPoints, rocks: list[SeenRock], *, reach: int = 0
) -> list[frozenset[str]]:
    """Return the bodies that fill at least a fifth of each rock, all seen from `eye` (3,).

    A cell is filled by what its ray hits, and those of the cells up to `reach` beside it.
    """
    raster = direction_raster(local, farthest_m=ExtractionOptions().farthest_m + 6.0)
    rays = raster.directions().reshape(-1, 3)
    hit = leg.scene.cast(np.broadcast_to(eye, rays.shape), rays)
    count = len(leg.scene.objects)
    on = leg.scene.objects[np.clip(hit["primID"].astype(np.int64), 0, count - 1)]
    rows, columns = raster.inverse.shape
    beside = np.arange(-reach, reach + 1)
    found = []
    for rock in rocks:
        row, column = np.divmod(rock.cells, columns)
        row = np.clip(row[:, None, None] + beside[:, None], 0, rows - 1)
        column = np.clip(column[:, None, None] + beside, 0, columns - 1)
        near = on[row * columns + column].reshape(len(rock.cells), -1)
        large = [k for k in np.unique(near) if (near == k).any(axis=1).mean() >= 0.2]
        found.append(frozenset(leg.scene.ids[k] for k in large if leg.scene.ids[k]))
    return found


def visible_rocks(leg: Leg, sight: Sight, farthest_m: float) -> frozenset[str]:
    """Return the ids of the rocks that stereo could find from one end."""
    values, cells = np.unique(sight.bodies, return_counts=True)
    shown = {leg.scene.ids[k]: int(n) for k, n in zip(values, cells, strict=True) if k >= 0}
    return frozenset(
        rock.id
        for rock in leg.terrain.rocks
        if shown.get(rock.id, 0) >= SEEN_CELLS
        and rock.height >= SEEN_HEIGHT_M
        and math.hypot(rock.x - sight.eye[0], rock.y - sight.eye[1]) <= farthest_m
    )


@dataclass(frozen=True, eq=False)
class LegRecord:
    """What a study keeps of a leg: both ends as seen, and where they truly are.

    `eyes` are in the site frame, `shapes` the true height, radius sqrt(a b) and surface above ground of the
    rocks seen.
    """

    seed: int
    rendered: bool
    ends: tuple[Seen, Seen]
    eyes: tuple[Array, Array]
    shapes: dict[str, tuple[float, float, float]]
    cpu_s: float


def noise_name() -> str:
    """Return a name of the noise of modelled stereo, another for each other noise."""
    return hashlib.sha256(repr(StereoNoise()).encode()).hexdigest()[:8]


def leg_record(
    seed: int,
    length_m: float = 26.0,
    *,
    rendered: bool = False,
    models: bool = True,
    cache: Path | None = None,
) -> LegRecord:
    """Return leg number `seed` as seen; kept in and taken from the folder `cache` when one is given.

    A modelled leg is kept by its noise, so none is taken that was drawn with another.
    """
    drawn = "r" if rendered else f"m_{noise_name()}"
    kept = None if cache is None else cache / f"leg_{seed}_{length_m:.2f}_{drawn}.pickle"
    if kept is not None and kept.exists():
        record: LegRecord = pickle.loads(kept.read_bytes())
        return record
    began = time.process_time()
    leg = make_leg(seed, length_m)
    if rendered:
        ends, eyes = _rendered_ends(leg, seed, models=models)
    else:
        ends, eyes = (see(leg, 0, seed, models=models), see(leg, 1, seed, models=models)), leg.eyes
    wanted = frozenset().union(*ends[0].bodies, *ends[1].bodies)
    shapes = {rock.id: true_shape(rock) for rock in leg.terrain.rocks if rock.id in wanted}
    record = LegRecord(seed, rendered, ends, eyes, shapes, time.process_time() - began)
    if kept is not None:
        kept.parent.mkdir(parents=True, exist_ok=True)
        kept.write_bytes(pickle.dumps(record))
    return record


def true_shape(rock: Rock) -> tuple[float, float, float]:
    """Return height, radius sqrt(a b) and surface above its foot of a rock, m and m2."""
    mesh = rock_meshes([rock])[0]
    corners = mesh.vertices.astype(np.float64)[mesh.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(normal, axis=1)
    above = corners[..., 2].mean(axis=1) > rock.z
    return rock.height, 0.5 * rock.diameter * math.sqrt(rock.elongation), float(area[above].sum())


def rendered_panorama(leg: Leg, end: int, *, seed: int) -> Panorama:
    """Return the navcam panorama of one end, 1024 x 1024, three wedges of 45 degrees."""
    rig = CameraRig(load_cameras("mer"), (0.0, 0.0, MAST_M - 0.15))
    x, y, z = leg.eyes[end]
    return take_panorama(
        Renderer(leg.scene),
        rig,
        Pose(x, y, z - MAST_M, leg.looks[end]),
        Sun.from_angles(math.radians(200.0), math.radians(45.0)),
        from_azimuth_rad=math.radians(60.0),
        span_rad=math.radians(120.0),
        tilts_rad=(-0.2,),
        overlap=0.05,
        seed=seed,
    )


def _rendered_ends(leg: Leg, seed: int, *, models: bool) -> tuple[tuple[Seen, Seen], tuple[Array, Array]]:
    """Return both ends as seen in rendered navcam panoramas."""
    ends, eyes = [], []
    for end in (0, 1):
        seen = points_of_panorama(rendered_panorama(leg, end, seed=seed))
        local = seen.from_eye()
        rocks = extract_rocks(local, models=models)
        visible = visible_rocks(leg, look(leg, end), 24.0)
        bodies, windowed = (bodies_of(leg, seen.eye, local, rocks, reach=reach) for reach in (0, 1))
        ends.append(Seen(rocks, bodies, visible, tuple(windowed)))
        eyes.append(seen.eye)
    return (ends[0], ends[1]), (eyes[0], eyes[1])


def wheel_prior(
    leg: Leg | LegRecord,
    rng: np.random.Generator,
    *,
    share: float = 0.05,
    most_turn_rad: float = math.radians(5.0),
) -> LegPrior:
    """Return what wheel odometry says: 5 % of the leg in each direction, heading off by up to 5 degrees."""
    true = leg.eyes[1] - leg.eyes[0]
    length = float(np.hypot(*true[:2]))
    off = rng.normal(0.0, share * length, 2)
    return LegPrior(
        float(true[0] + off[0]),
        float(true[1] + off[1]),
        float(true[2] + rng.normal(0.0, 0.3)),
        float(rng.uniform(-most_turn_rad, most_turn_rad)),
        sigma_m=share * length,
        sigma_heading_rad=most_turn_rad / math.sqrt(3.0),
    )
