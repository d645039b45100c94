"""One rock before the rover, as the study of placements needs it: bodies, truth under the tool, stereo
clouds.

All in the rover frame. The truth is cast on the triangles and knows nothing of segmentation or plane fits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel
from rover_iface.cameras.rig import load_cameras
from rover_iface.frames import Pose
from rover_iface.simulator.render.renderer import Sun
from rover_iface.simulator.render.scene import Material, Scene, SceneMesh
from rover_iface.terrain.fractal import spectral_noise
from rover_iface.terrain.rocks import Rock, icosphere, rock_meshes
from studies.common.placement_stereo import RockView, Seen, StereoModel, mast_view
from studies.common.true_surface import TrueLimits, TruePatch, true_patch

Array = npt.NDArray[np.float64]

NEAREST_M = 0.35
TARGET = "target"


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
        return true_patch(self.scene, self.target_index, at, normal, radius_m, limits)

    @cached_property
    def hazcam(self) -> RockView:
        """Return what the hazard cameras see of the rock."""
        left, right = (camera.window(*self.window) for camera in (self.left, self.right))
        return RockView(self.scene, self.sun, left, right, "hazcam_left", NEAREST_M, StereoModel())

    @property
    def seen(self) -> Seen:
        """Return what the left hazard camera truly sees."""
        return self.hazcam.seen

    def navcam(self, at: Array) -> RockView:
        """Return what the mast's pair sees when it is turned to a point (3,).

        The mast stands at other angles than those that are read, and the pair is out of calibration:
        `MAST_ERROR_RAD`, `OFF_PX`.
        """
        return mast_view(self.scene, self.sun, self.seed, at)


HERE = Pose(0.0, 0.0)


def rock_scene(seed: int, stand: Pose = HERE) -> RockScene:
    """Return rock number `seed`: smooth to rough, alone or among others, lit from anywhere; in the frame of
    the rover as it stands at `stand`, a pose of the frame in which it came.
    """
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
    rover = stand.site_from_rover.inverse()
    meshes = [replace(mesh, vertices=rover.apply(mesh.vertices)) for mesh in (ground, *bodies)]
    to_sun = np.asarray(rover.rotate(sun.direction))
    return RockScene(
        seed,
        Scene(meshes, seed=seed),
        replace(sun, direction=(float(to_sun[0]), float(to_sun[1]), float(to_sun[2]))),
        cameras["hazcam_left"].model,
        cameras["hazcam_right"].model,
        np.asarray(rover.apply(np.array([x, y, z]))),
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
