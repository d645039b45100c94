"""Small scenes that the tests of renderer, stereo and trackers share; built once a session."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.frames import Pose
from rover_iface.simulator.render.picture import Frame
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.render.scene import Material, Scene, SceneMesh
from rover_iface.terrain.rocks import Rock, rock_meshes

PIVOT = (0.3, 0.0, 1.4)
SUN = Sun.from_angles(math.radians(240.0), math.radians(45.0))


def ground(size_m: float = 30.0, step_m: float = 0.25) -> SceneMesh:
    """Return a gently waved ground."""
    axis = np.arange(-size_m, size_m + step_m / 2, step_m)
    x, y = np.meshgrid(axis, axis)
    z = 0.04 * np.sin(0.8 * x) * np.cos(0.6 * y)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    triangles = np.concatenate((np.stack((a, b, c), 1), np.stack((a, c, d), 1)))
    return SceneMesh(np.stack((x, y, z), -1).reshape(-1, 3), triangles)


@lru_cache(maxsize=1)
def rock_renderer() -> Renderer:
    """Return a scene with one rock of 1.1 m at the origin and a few small ones."""
    rocks = [
        Rock("BIG", 0.0, 0.0, 0.0, diameter=1.1, height=0.8, elongation=0.9, burial=0.25, seed=7),
        Rock("SMALL", 1.5, -1.0, 0.0, diameter=0.3, height=0.2, seed=8),
    ]
    meshes = [
        SceneMesh(m.vertices, m.triangles, m.id, Material.ROCK, albedo=0.2)
        for m in rock_meshes(rocks, detail=4)
    ]
    return Renderer(Scene([ground(), *meshes], seed=3))


@lru_cache(maxsize=4)
def rig(preset: str = "k9") -> CameraRig:
    """Return the cameras of a preset on a mast."""
    return CameraRig(load_cameras(preset), PIVOT)


LOOK = np.array([0.0, 0.0, 0.4])


def picture(
    pose: Pose,
    name: str = "navcam_left",
    *,
    preset: str = "k9",
    half: int = 80,
    sun: Sun = SUN,
    exposure: float | None = None,
    seed: int = 1,
) -> Frame:
    """Return a subframe of a mast camera, the rock's face in its middle."""
    cameras = rig(preset)
    target = pose.site_from_rover.inverse().apply(LOOK)
    pan, tilt = cameras.point_at(target, "navcam_left")
    camera = cameras.camera(name, pan, tilt)
    middle = camera.project(target)
    left, top = (round(float(v)) - half for v in middle)
    return rock_renderer().render(
        camera,
        pose,
        sun,
        window=(left, top, 2 * half + 1, 2 * half + 1),
        sensor=cameras.mounted(name).sensor,
        exposure=exposure,
        seed=seed,
    )
