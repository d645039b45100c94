"""Stops and maps of the relocalisation study: grounds, what a stop sees by cast rays, maps by their kind."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.frames import Pose, rotation_rpy
from rover_iface.localization.ground_points import CELL_RAD, GroundPoints
from rover_iface.localization.relief_map import ReliefMap
from rover_iface.localization.stop_relief import StopView, view_of_panorama
from rover_iface.simulator.render import shade
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.gravel import no_stones
from rover_iface.simulator.render.look import Look
from rover_iface.simulator.render.panorama import take_panorama
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.render.scene import Scene
from rover_iface.terrain.generate import generate_terrain
from rover_iface.terrain.terrain import Terrain
from studies.common.localization_legs import MAST_M, RANGE_FACTOR, Sight, stereo_points

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Lit:
    """Hits of rays and how bright they are: ranges (n,), inf for none, bodies (n,), light (n,)."""

    ranges: Array
    bodies: npt.NDArray[np.int32]
    light: Array


def lit(scene: Scene, origins: Array, directions: Array, sun: Sun, *, pixel_rad: float) -> Lit:
    """Return what rays (n, 3), site frame, m, meet, and its radiance by the renderer's own kernels."""
    count = len(directions)
    start = np.ascontiguousarray(np.broadcast_to(origins, (count, 3)) - scene.origin, dtype=np.float32)
    rays = np.ascontiguousarray(directions, dtype=np.float32)
    hit = scene.cast_local(start, rays)
    far, prim = hit["tfar"], hit["primID"]
    points, normal = np.zeros((count, 3), np.float32), np.zeros((count, 3), np.float32)
    base, loose = np.zeros(count, np.float32), np.zeros(count, np.float32)
    shadow, index = np.empty((count, 3), np.float32), np.empty(count, np.int32)
    to_sun = np.array(sun.direction)
    found = shade.surface(
        far, prim, hit["u"], hit["v"], start, rays, scene.triangles, scene.normals, scene.albedo,
        scene.gravel, to_sun, 2e-3, points, normal, base, loose, shadow, index,
    )  # fmt: skip
    bright = np.zeros(count, np.float32)
    if found:
        towards = np.ascontiguousarray(np.broadcast_to(to_sun.astype(np.float32), (found, 3)))
        bright[index[:found]] = ~scene.occluded_local(shadow[:found], towards)
    light = np.empty(count, np.float32)
    shade.radiance(
        far, prim, rays, points, normal, base, loose, bright, scene.objects, scene.materials, scene.origin,
        to_sun, sun.direct, sun.diffuse, 0.6, pixel_rad,
        Look().parameters(), scene.seed, no_stones(), light,
    )  # fmt: skip
    met = prim >= 0
    bodies = np.where(met, scene.objects[np.maximum(prim, 0)], -1).astype(np.int32)
    return Lit(np.where(met, far, np.inf).astype(float), bodies, light.astype(float))


FARTHEST_M = 25.0
AZIMUTH_STEP, ELEVATION_STEP = 3 * CELL_RAD, CELL_RAD
"""Columns are three times as wide as those of the product's grid, which costs a third; their noise hangs
together over as much more."""


@dataclass(frozen=True, eq=False)
class Ground:
    """A place: what is truly there, and where stops may stand (centre and half side of a square, m)."""

    name: str
    terrain: Terrain
    scene: Scene
    half_m: float

    def eye_at(self, xy: npt.ArrayLike) -> Array:
        """Return the eye (3,) of a stop at a place (2,), moved into the square if it lies outside."""
        x, y = np.clip(np.asarray(xy, dtype=float), -self.half_m, self.half_m)
        return np.array([x, y, self.terrain.height_at(float(x), float(y)) + MAST_M])

    def place(self, rng: np.random.Generator) -> Array:
        """Return the eye (3,) of a stop somewhere on it, off the rocks."""
        return self._free(lambda: rng.uniform(-self.half_m, self.half_m, 2))

    def near(self, eye: Array, most_m: float, rng: np.random.Generator) -> Array:
        """Return the eye (3,) of a stop up to `most_m` from another along each axis, off the rocks."""
        return self._free(lambda: eye[:2] + rng.uniform(-most_m, most_m, 2))

    def _free(self, draw: Callable[[], Array]) -> Array:
        for _ in range(100):
            eye = self.eye_at(draw())
            near = self.terrain.nearest_rock(float(eye[0]), float(eye[1]))
            if near is None or near[1] > 0.3:
                return eye
        raise RuntimeError(f"no free place on {self.name}")


def generated_ground(seed: int) -> Ground:
    """Return a generated ground of 128 m: relief and rock cover are drawn, brightness does not follow it."""
    from dataclasses import replace

    from rover_iface.terrain.fractal import spectral_noise
    from rover_iface.terrain.grid import Ortho

    rng = np.random.default_rng([seed, 0x2E10])
    terrain = generate_terrain(
        seed,
        128.0,
        rock_cover=float(rng.uniform(0.005, 0.06)),
        inner_m=8.0,
        inner_spacing_m=0.1,
        spacing_m=0.25,
        crater=bool(rng.random() < 0.5),
        outcrop=bool(rng.random() < 0.5),
        ripples=bool(rng.random() < 0.5),
        relief_m=float(rng.uniform(0.5, 2.5)),
        ortho=False,
        smallest_rock_m=0.15,
    )
    tone = spectral_noise(np.random.default_rng([seed, 0x2E11]), 1024, 2.0)
    grey = np.clip(128.0 * (1.0 + 0.25 * tone), 20, 250).astype(np.uint8)
    ortho = Ortho((-64.0, -64.0, 64.0, 64.0), pixels=np.repeat(grey[..., None], 3, axis=2))
    terrain = replace(terrain, orthos=(ortho,))
    scene = scene_from_terrain(
        terrain, radius_m=45.0, spacing_m=0.25, far_m=64.0, stones_per_m2=0.0, gravel=0.0, seed=seed
    )
    return Ground(f"generated {seed}", terrain, scene, 14.0)


def real_ground(terrain: Terrain, seed: int) -> Ground:
    """Return a real ground: heights and colours as its maps have them."""
    scene = scene_from_terrain(
        terrain, radius_m=45.0, spacing_m=0.2, far_m=64.0, stones_per_m2=0.0, gravel=0.0, seed=seed
    )
    return Ground(terrain.name, terrain, scene, 14.0)


def modelled_view(ground: Ground, eye: Array, sun: Sun, rng: np.random.Generator) -> StopView:
    """Return what stereo would see all round from `eye` (3,), in the site frame, exact attitude."""
    azimuth = np.arange(-math.pi, math.pi, AZIMUTH_STEP)
    elevation = np.arange(math.radians(4.0), math.radians(-36.0), -ELEVATION_STEP)
    level = np.cos(elevation)[:, None]
    z = np.broadcast_to(np.sin(elevation)[:, None], (len(elevation), len(azimuth)))
    directions = np.stack((level * np.cos(azimuth), level * np.sin(azimuth), z), axis=-1)
    shape = directions.shape[:2]
    found = lit(ground.scene, eye, directions.reshape(-1, 3), sun, pixel_rad=ELEVATION_STEP)
    rock = np.array([bool(name) for name in ground.scene.ids])[found.bodies] & (found.bodies >= 0)
    sight = Sight(
        eye, directions, found.ranges.reshape(shape), found.bodies.reshape(shape), rock.reshape(shape)
    )
    points = stereo_points(sight, rng).points
    rays = points - eye
    row = np.rint((elevation[0] - np.arctan2(rays[:, 2], np.hypot(rays[:, 0], rays[:, 1]))) / ELEVATION_STEP)
    column = np.rint((np.arctan2(rays[:, 1], rays[:, 0]) + math.pi) / AZIMUTH_STEP)
    at = row.astype(np.int64) * shape[1] + column.astype(np.int64) % shape[1]
    light = found.light[at] * (1.0 + 0.02 * rng.standard_normal(len(at)))  # 8 bits and shot noise: 2 %
    near = np.hypot(rays[:, 0], rays[:, 1]) < 1.2 * FARTHEST_M
    return StopView(GroundPoints(points[near], eye, RANGE_FACTOR), light[near])


@dataclass(frozen=True, slots=True)
class OrbitalMap:
    """An orbital map: posts of heights, their error (rms, m, hanging together over `error_m`), pixel of the
    image and how far it is bent along each axis (rms, m).
    """

    posts_m: float
    sigma_m: float = 0.15
    error_m: float = 3.0
    pixel_m: float = 0.25
    bend_m: float = 0.1


def orbital_map(
    ground: Ground, kind: OrbitalMap, sun: Sun, rng: np.random.Generator, half_m: float = 58.0
) -> ReliefMap:
    """Return the map of a ground as from orbit: heights and light are cast from above, blurred, with errors.

    Heights are means over a post, smoothed by half a post more, with errors; brightness has a point spread of
    half a pixel and 1 % of noise.
    """
    from scipy.ndimage import gaussian_filter, map_coordinates

    fine = 0.125
    count = 2 * round(half_m / fine)
    axis = (np.arange(count) + 0.5) * fine - half_m
    x, y = np.meshgrid(axis, axis)
    eyes = np.stack([x.ravel(), y.ravel(), np.full(x.size, 200.0)], axis=-1)
    down = np.broadcast_to([0.0, 0.0, -1.0], eyes.shape)
    seen = lit(ground.scene, eyes, down, sun, pixel_rad=fine / 200.0)
    heights = (200.0 - seen.ranges).reshape(count, count)
    heights = np.where(np.isfinite(heights), heights, np.nan)
    light = np.where(np.isfinite(heights), seen.light.reshape(count, count), np.nan)
    hole = np.where(np.isfinite(heights), heights, np.nanmean(heights))
    blur = kind.posts_m / fine
    posts = gaussian_filter(hole, 0.6 * blur)[:: round(blur), :: round(blur)]
    error = gaussian_filter(rng.standard_normal(posts.shape), kind.error_m / kind.posts_m / 2.0)
    posts = posts + kind.sigma_m * error / error.std()
    spacing = 0.25
    ratio = round(spacing / fine)
    rows = (np.arange(count // ratio) + 0.5) * ratio - 0.5
    at = np.meshgrid(rows / blur, rows / blur, indexing="ij")
    sampled = map_coordinates(posts, at, order=1, mode="nearest")
    bright = gaussian_filter(np.nan_to_num(light, nan=float(np.nanmean(light))), 0.5 * kind.pixel_m / fine)
    bright = bright.reshape(len(rows), ratio, len(rows), ratio).mean(axis=(1, 3))
    # distortion that the camera's jitter leaves in an ortho image: smooth over 15 m
    bent = [gaussian_filter(rng.standard_normal(bright.shape), 15.0 / spacing / 2.0) for _ in range(2)]
    index = np.indices(bright.shape, dtype=float)
    moved = [i + kind.bend_m / spacing * b / b.std() for i, b in zip(index, bent, strict=True)]
    bright = map_coordinates(bright, moved, order=1, mode="nearest")
    bright *= 1.0 + 0.01 * rng.standard_normal(bright.shape)
    first = 0.5 * spacing - half_m
    return ReliefMap(sampled.astype(np.float32), first, first, spacing, bright.astype(np.float32))


@dataclass(frozen=True, eq=False, slots=True)
class Believed:
    """A stop as the rover believed it: the view in that frame, and the true (east, north, up, turn)."""

    view: StopView
    truth: Array


def believed(
    view: StopView,
    rng: np.random.Generator,
    *,
    shift_m: tuple[float, float] | None = None,
    most_m: float = 10.0,
    most_rad: float = math.radians(10.0),
    tilt_rad: float = math.radians(0.3),
) -> Believed:
    """Return a view from a pose believed wrongly: up to `most_m` along each axis, `most_rad` of heading.

    `shift_m` is a given shift instead. Roll and pitch err by `tilt_rad` (rms), height by up to a metre.
    """
    eye = view.seen.eye
    given = rng.uniform(-most_m, most_m, 2) if shift_m is None else np.asarray(shift_m)
    turn = float(rng.uniform(-most_rad, most_rad))
    roll, pitch = rng.normal(0.0, tilt_rad, 2)
    wrong = rotation_rpy(float(roll), float(pitch), -turn)
    there = eye - np.array([*given, rng.uniform(-1.0, 1.0)])
    points = (view.seen.points - eye) @ wrong.T + there
    seen = GroundPoints(points, there, view.seen.range_factor)
    return Believed(StopView(seen, view.brightness), np.array([*eye, turn]))


def rendered_view(ground: Ground, eye: Array, sun: Sun, seed: int) -> StopView:
    """Return what stereo gives of a rendered navcam panorama all round, 1024 x 1024, from `eye` (3,)."""
    rig = CameraRig(load_cameras("mer"), (0.0, 0.0, MAST_M - 0.15))
    x, y, z = eye
    panorama = take_panorama(Renderer(ground.scene), rig, Pose(x, y, z - MAST_M, 0.0), sun, seed=seed)
    return view_of_panorama(panorama)
