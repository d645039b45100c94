"""Primary rays a second that one core casts into the scene of a generated site; for docs/results/cameras.md.

.venv/bin/python -m benchmarks.rays
"""

from __future__ import annotations

import time

import numpy as np

from rover_iface.cameras.model import pinhole
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.terrain.generate import generate_terrain


def main() -> None:
    """Cast 640 x 480 rays nine times and print the rate in CPU time, which counts every thread."""
    terrain = generate_terrain(3, rock_cover=0.07, ortho=False)
    scene = scene_from_terrain(terrain, (0.0, 0.0), seed=1)
    eye = (0.0, 0.0, terrain.height_at(0.0, 0.0) + 1.5)
    camera = pinhole(focal_px=560, width=640, height=480, center=eye, forward=(1, 0, -0.3))
    pixels = np.stack(np.meshgrid(np.arange(640.0), np.arange(480.0)), axis=-1)
    rays = np.ascontiguousarray(camera.back_project(pixels)[1].reshape(-1, 3), dtype=np.float32)
    eyes = np.tile((camera.C - scene.origin).astype(np.float32), (len(rays), 1))
    rates = []
    for _ in range(9):
        started = time.process_time()
        scene.cast_local(eyes, rays)
        rates.append(len(rays) / (time.process_time() - started) / 1e6)
    print(
        f"{scene.triangle_count:,} triangles: {np.median(rates):.1f} million primary rays per CPU second "
        f"(median of 9, {min(rates):.1f} to {max(rates):.1f})"
    )


if __name__ == "__main__":
    main()
