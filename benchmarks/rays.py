"""Primary rays a second that one core casts into the scene of a generated site."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.common.clock import median_spent
from benchmarks.common.figure import Figure, command
from rover_iface.cameras.model import pinhole
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.terrain.generate import generate_terrain

QUICK = {"repeat": 1}
BUDGET_S = 60.0


def figures(repeat: int = 9) -> Iterator[Figure]:
    """Yield the rate of 640 x 480 rays by processor time, which counts every thread."""
    terrain = generate_terrain(3, rock_cover=0.07, ortho=False)
    scene = scene_from_terrain(terrain, (0.0, 0.0), seed=1)
    eye = (0.0, 0.0, terrain.height_at(0.0, 0.0) + 1.5)
    camera = pinhole(focal_px=560, width=640, height=480, center=eye, forward=(1, 0, -0.3))
    pixels = np.stack(np.meshgrid(np.arange(640.0), np.arange(480.0)), axis=-1)
    rays = np.ascontiguousarray(camera.back_project(pixels)[1].reshape(-1, 3), dtype=np.float32)
    eyes = np.tile((camera.C - scene.origin).astype(np.float32), (len(rays), 1))
    rate = len(rays) / median_spent(lambda: scene.cast_local(eyes, rays), repeat) / 1e6
    yield Figure(f"primary rays into {scene.triangle_count:,} triangles", rate, "million/s")


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
