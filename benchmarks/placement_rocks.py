"""One rock before the rover, as the study of placements needs it: bodies, truth under the tool, stereo
clouds.

All in the rover frame. The truth is cast on the triangles and knows nothing of segmentation or plane fits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.linear import aligned_pair
from rover_iface.cameras.model import CameraModel
from rover_iface.cameras.rig import load_cameras
from rover_iface.cameras.stereo import Cloud, dense_stereo
from rover_iface.placement.cloud import SurfaceCloud, cloud_of_stereo
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.render.scene import Material, Scene, SceneMesh
from rover_iface.terrain.fractal import spectral_noise
from rover_iface.terrain.rocks import Rock, icosphere, rock_meshes

Array = npt.NDArray[np.float64]

NEAREST_M = 0.35
TARGET = "target"


@dataclass(frozen=True)
class TrueLimits:
    """What the instrument bears, whatever the rover believes: lengths in metres.

    `tilt_rad` is what the arm may leave between tool and normal at a place that counts as safe and in reach.
    """

    protrusion_m: float = 0.020
    depth_m: float = 0.030
    slope_rad: float = math.radians(20.0)
    rock_share: float = 0.97
    arm_error_m: float = 0.002
    tilt_rad: float = math.radians(14.0)


@dataclass(frozen=True)
class TruePatch:
    """The true surface under the tool; `wrong` names what the instrument does not bear."""

    protrusion_m: float
    depth_m: float
    slope_rad: float
    rock_share: float
    wrong: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class RockScene:
    """A rock of 0.18 to 0.7 m within the arm's reach, on rough ground, with neighbours and the sun."""

    seed: int
    scene: Scene
    sun: Sun
    left: CameraModel
    right: CameraModel
    centre: Array
    diameter_m: float

    @cached_property
    def target_index(self) -> int:
        """Return the number of the rock among the scene's bodies."""
        return self.scene.ids.index(TARGET)

    @cached_property
    def window(self) -> tuple[int, int, int, int]:
        """Return the part of both cameras' frames that shows the rock and as much ground round it."""
        corners = [(a, b, c) for a in (-0.9, 1.1) for b in (-1, 1) for c in (-0.2, 0.7)]
        around = self.centre + 0.75 * self.diameter_m * np.array(corners)
        pixels = np.concatenate([camera.project(around) for camera in (self.left, self.right)])
        low = np.clip(np.nanmin(pixels, axis=0), 0, None)
        high = np.minimum(np.nanmax(pixels, axis=0), (self.left.width - 1, self.left.height - 1))
        width, height = (max(64, int(v)) for v in high - low)
        left = int(min(low[0], self.left.width - width))
        return left, int(min(low[1], self.left.height - height)), width, height

    def true_patch(
        self, point: Array, normal: Array, radius_m: float, limits: TrueLimits, error: Array | None = None
    ) -> TruePatch:
        """Return the surface that a tool of `radius_m` meets when it comes down along -normal on `point`."""
        at = point if error is None else point + error
        first = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
        first /= np.linalg.norm(first)
        second = np.cross(normal, first)
        line = np.arange(-radius_m, radius_m + 1e-9, 0.002)
        u, v = (g.ravel() for g in np.meshgrid(line, line))
        inside = np.hypot(u, v) <= radius_m
        u, v = u[inside], v[inside]
        above = 0.14
        starts = at + u[:, None] * first + v[:, None] * second + above * normal
        hit = self.scene.cast(starts, np.broadcast_to(-normal, starts.shape))
        far = hit["tfar"].astype(np.float64)
        met = far < 1e30
        height = above - far
        on_rock = met & (self.scene.objects[np.maximum(hit["primID"], 0)] == self.target_index)
        share = float(on_rock.mean())
        if on_rock.sum() < 8:
            return TruePatch(math.inf, math.inf, math.pi / 2, share, ("missed",))
        # the tool's face rests on the upper part; what is a hand's breadth below is no support
        close = on_rock & (height > np.quantile(height[on_rock], 0.5) - 0.05)
        design = np.column_stack((u, v, np.ones_like(u)))
        plane = np.linalg.lstsq(design[close], height[close], rcond=None)[0]
        off = np.where(met, height - design @ plane, -math.inf)
        protrusion, depth = float(off.max()), float(-off.min())
        slope = math.atan(math.hypot(plane[0], plane[1]))
        wrong = tuple(
            name
            for name, bad in (
                ("missed", share < limits.rock_share),
                ("protrusion", protrusion > limits.protrusion_m),
                ("edge", depth > limits.depth_m),
                ("slope", slope > limits.slope_rad),
            )
            if bad
        )
        return TruePatch(protrusion, depth, slope, share, wrong)

    def rendered_cloud(self, seed: int) -> SurfaceCloud:
        """Return the cloud that dense stereo makes of a rendered pair."""
        renderer = Renderer(self.scene)
        sensor = load_cameras("k9")["hazcam_left"].sensor
        window = self.window
        one = renderer.render(self.left, None, self.sun, window=window, sensor=sensor, seed=seed)
        two = renderer.render(
            self.right,
            None,
            self.sun,
            window=window,
            sensor=sensor,
            exposure=one.exposure,
            seed=seed + 1,
        )
        left, right = (camera.window(*window) for camera in (self.left, self.right))
        return cloud_of_stereo(
            dense_stereo(one.unit, two.unit, left, right, nearest_m=NEAREST_M), farthest_m=3.0
        )

    @cached_property
    def seen(self) -> tuple[CameraModel, CameraModel, Array, npt.NDArray[np.int32], Array]:
        """Return the aligned pair, and for each pixel of the left one range (inf: none), body and normal."""
        one, two = aligned_pair(*(camera.window(*self.window) for camera in (self.left, self.right)))
        u, v = np.meshgrid(np.arange(one.width), np.arange(one.height))
        origins, rays = one.back_project(np.stack((u, v), axis=-1).reshape(-1, 2).astype(float))
        hit = self.scene.cast(origins, rays)
        far = hit["tfar"].astype(np.float64)
        met = far < 1e30
        body = np.where(met, self.scene.objects[np.maximum(hit["primID"], 0)], -1).astype(np.int32)
        normal = hit["Ng"].astype(np.float64)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        normal *= np.where((normal * rays).sum(axis=1) > 0, -1.0, 1.0)[:, None]
        shape = (one.height, one.width)
        return (
            one,
            two,
            np.where(met, far, np.inf).reshape(shape),
            body.reshape(shape),
            normal.reshape(*shape, 3),
        )

    def lit(self, points: Array, normals: Array) -> npt.NDArray[np.bool_]:
        """Return which surface points (n, 3) the sun reaches."""
        to_sun = np.array(self.sun.direction)
        start = points + 3e-3 * normals
        free = ~np.isfinite(self.scene.ranges(start, np.broadcast_to(to_sun, start.shape)))
        return np.asarray(free & (normals @ to_sun > 0))

    def cast_cloud(self, seed: int, model: StereoModel | None = None) -> SurfaceCloud:
        """Return a cloud like that of stereo from cast ranges: what it costs is a twentieth of a rendered
        one.

        Disparities are averaged over the matched block, the foreground grows over its edge, errors are shared
        by neighbours; what the right camera does not see has no point, nor have patches that are drawn by
        light and slant, and some patches are matched falsely.
        """
        import cv2

        model = model or StereoModel()
        rng = np.random.default_rng([seed, 0xCA57])
        one, two, far, _, normal = self.seen
        shape = far.shape
        u, v = np.meshgrid(np.arange(shape[1]), np.arange(shape[0]))
        eye, rays = one.back_project(np.stack((u, v), axis=-1).astype(float))
        known = np.isfinite(far)
        points = eye + np.where(known, far, 1.0)[..., None] * rays
        baseline = float(np.linalg.norm(two.C - one.C))
        depth = np.where(known, (points - one.C) @ one.A, 1e3)
        true = (one.hs * baseline / depth).astype(np.float32)
        toward = two.C - points.reshape(-1, 3)
        distance = np.linalg.norm(toward, axis=1)
        back = self.scene.ranges(two.C, -toward / distance[:, None])
        both = known & (back > distance - 0.01).reshape(shape)

        block = np.ones((model.block_px, model.block_px), np.uint8)
        highest = cv2.dilate(true, block)
        one_surface = highest - cv2.erode(true, block) < 1.5
        smooth = cv2.blur(true, (model.block_px, model.block_px))
        grown = (highest - true > 1.0) & (_field(rng, shape, 8.0) > 0.0)
        disparity = np.where(one_surface, smooth, np.where(grown, highest, true))
        noise = _field(rng, shape, model.shared_px)
        disparity = disparity + model.disparity_rad * one.hs * noise
        wrong = _field(rng, shape, 4.0) > model.wrong_above
        disparity = np.where(wrong, disparity + 2.5 * _field(rng, shape, 6.0), disparity)

        slant = np.clip(-(normal * rays).sum(axis=-1), 0.0, 1.0)
        lit = self.lit(points.reshape(-1, 3), normal.reshape(-1, 3)).reshape(shape)
        chance = np.where(lit, model.lost_lit, model.lost_shade) + model.lost_slant * (slant < 0.2)
        from scipy.special import ndtr

        lost = ndtr(_field(rng, shape, model.hole_px)) < chance
        valid = (both | grown) & known & ~lost & (disparity > 0.5)
        # single points are taken away by the speckle filter
        valid &= cv2.blur(valid.astype(np.float32), (7, 7)) > 0.4
        lines, samples = np.nonzero(valid)
        d = disparity[lines, samples].astype(np.float64)
        ray = rays[lines, samples]
        place = one.C + ray * (one.hs * baseline / d / (ray @ one.A))[:, None]
        cloud = Cloud(
            place,
            np.column_stack((samples, lines)).astype(np.float64),
            d,
            one,
            baseline,
            np.where(lit, np.clip(normal @ np.array(self.sun.direction), 0.1, 1.0), 0.05)[lines, samples]
            .astype(np.float32)
            .clip(0, 1),
        )
        return cloud_of_stereo(cloud, farthest_m=3.0)


@dataclass(frozen=True)
class StereoModel:
    """The cheap model of stereo; defaults are fitted to rendered pairs (`benchmarks.placement
    --validate`)."""

    block_px: int = 5
    disparity_rad: float = 0.0011
    shared_px: float = 2.5
    wrong_above: float = 2.6
    lost_lit: float = 0.003
    lost_shade: float = 0.15
    lost_slant: float = 0.20
    hole_px: float = 10.0


def _field(rng: np.random.Generator, shape: tuple[int, ...], sigma_px: float) -> Array:
    """Return noise of deviation 1 whose neighbours within `sigma_px` are alike."""
    import cv2

    white = cv2.GaussianBlur(rng.standard_normal(shape).astype(np.float32), (0, 0), sigma_px)
    return np.asarray(white / max(float(white.std()), 1e-9), dtype=np.float64)


def rock_scene(seed: int) -> RockScene:
    """Return rock number `seed`: smooth to rough, alone or among others, lit from anywhere."""
    rng = np.random.default_rng([seed, 0x90C])
    diameter = float(rng.uniform(0.18, 0.7))
    distance = float(rng.uniform(0.68, 0.90)) + 0.35 * diameter
    bearing = float(rng.uniform(-0.35, 0.35))
    x, y = 0.1 + distance * math.cos(bearing), distance * math.sin(bearing)
    tilt = rng.uniform(-0.08, 0.08, 2)
    bumps = float(rng.uniform(0.004, 0.02))
    posts = np.linspace(-2.0, 2.0, 129)
    px, py = np.meshgrid(posts + x, posts + y)
    noise = spectral_noise(rng, 129, 3.0)
    pz = tilt[0] * px + tilt[1] * py + bumps * (noise - noise[64, 64])

    def ground_at(gx: float, gy: float) -> float:
        i = int(np.clip(round((gy - y + 2.0) / 4.0 * 128), 0, 128))
        j = int(np.clip(round((gx - x + 2.0) / 4.0 * 128), 0, 128))
        return float(pz[i, j])

    z = ground_at(x, y)
    height = diameter * float(rng.uniform(0.35, 0.8))
    rock = Rock(
        TARGET,
        x,
        y,
        z - 0.01,
        diameter,
        height,
        yaw=float(rng.uniform(0, math.tau)),
        elongation=float(rng.uniform(0.6, 1.0)),
        burial=float(rng.uniform(0.1, 0.5)),
        seed=int(rng.integers(1 << 30)),
    )
    bodies = [_rough(rock, rng)]
    for number in range(int(rng.integers(0, 5))):
        size = float(rng.uniform(0.05, 0.25))
        way = float(rng.uniform(0, math.tau))
        off = 0.5 * diameter + size * float(rng.uniform(0.2, 1.0))
        nx, ny = x + off * math.cos(way), y + off * math.sin(way)
        near = Rock(
            f"other-{number}",
            nx,
            ny,
            ground_at(nx, ny) - 0.01,
            size,
            size * float(rng.uniform(0.35, 0.8)),
            seed=int(rng.integers(1 << 30)),
        )
        bodies.append(_rough(near, rng))
    cells = np.arange(129 * 129).reshape(129, 129)
    a, b, c, d = (v.ravel() for v in (cells[:-1, :-1], cells[:-1, 1:], cells[1:, 1:], cells[1:, :-1]))
    triangles = np.concatenate((np.column_stack((a, b, c)), np.column_stack((a, c, d))))
    ground = SceneMesh(np.column_stack((px.ravel(), py.ravel(), pz.ravel())), triangles, "")
    cameras = load_cameras("k9")
    sun = Sun.from_angles(float(rng.uniform(0, math.tau)), math.radians(float(rng.uniform(25, 70))))
    return RockScene(
        seed,
        Scene([ground, *bodies], seed=seed),
        sun,
        cameras["hazcam_left"].model,
        cameras["hazcam_right"].model,
        np.array([x, y, z]),
        diameter,
    )


def _rough(rock: Rock, rng: np.random.Generator) -> SceneMesh:
    """Return the rock with edges of about 1 cm, bumps of 2 to 8 cm across and, on one in four, ledges."""
    detail = 5 if rock.diameter > 0.35 else 4
    mesh = rock_meshes([rock], detail=detail)[0]
    v = mesh.vertices.astype(np.float64)
    out = np.asarray(icosphere(detail)[0])
    rise = np.zeros(len(v))
    strength = float(rng.choice([0.0, 0.003, 0.008, 0.015]))
    for _ in range(10):
        length = float(rng.uniform(0.02, 0.08))
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        rise += strength / 3.2 * np.sin(math.tau * (v @ way) / length + rng.uniform(0, math.tau))
    if rng.random() < 0.25:
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        layer = float(rng.uniform(0.06, 0.15))
        rise += float(rng.uniform(0.01, 0.03)) * (np.floor((v @ way) / layer) % 2)
    return SceneMesh(v + rise[:, None] * out, mesh.triangles, rock.id, Material.ROCK, albedo=0.22)
