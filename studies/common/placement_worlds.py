"""Views of generated ground that the studies of segmentation and placement share.

One view is a stereo pair from a pose of the K9 on rocky ground, with the body and the range behind each
pixel: of the hazcams, or of the navcams from the same pose with the mast tilted to the ground before the
rover. Pairs are rendered once and kept in a folder for later studies.
"""

from __future__ import annotations

import math
import pickle
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel
from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.errors import RenderError
from rover_iface.frames import Pose
from rover_iface.mobility import settled_pose
from rover_iface.profile import load_profile
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.terrain.generate import generate_terrain
from rover_iface.terrain.terrain import Terrain

VERSION = 2
VIEWS_PER_WORLD = 4
MAST_M = (0.15, 0.0, 1.45)
NAVCAM_TILT_RAD = math.radians(-26.0)
"""The navcams' frame then holds the ground from 1.5 to 11 m before the mast."""


@dataclass(frozen=True)
class StereoView:
    """A stereo pair and its truth; cameras in the rover frame.

    `body` is the number of the rock behind each pixel of the left image (-1: none), an index into `rocks`,
    which holds (id, diameter, height) of each.
    """

    seed: int
    sensor: str
    left: npt.NDArray[np.uint8]
    right: npt.NDArray[np.uint8]
    left_camera: CameraModel
    right_camera: CameraModel
    pose: Pose
    range_m: npt.NDArray[np.float32]
    body: npt.NDArray[np.int32]
    lit: npt.NDArray[np.bool_]
    rocks: tuple[tuple[str, float, float], ...]

    @property
    def images(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Return both images as float32 in 0..1."""
        one, two = ((i / np.float32(255.0)).astype(np.float32) for i in (self.left, self.right))
        return one, two


def world(seed: int) -> Terrain:
    """Return ground with 4 to 12 % of rocks; relief and roughness differ from seed to seed."""
    rng = np.random.default_rng([seed, 0x91A])
    return generate_terrain(
        7000 + seed,
        32.0,
        rock_cover=float(rng.uniform(0.04, 0.12)),
        inner_m=24.0,
        inner_spacing_m=0.05,
        crater=False,
        outcrop=False,
        ripples=bool(rng.random() < 0.3),
        relief_m=float(rng.uniform(0.4, 2.0)),
        rough=float(rng.uniform(0.6, 1.3)),
        clear_start_m=0.0,
        ortho=False,
    )


def views(
    seed: int, folder: Path, count: int = VIEWS_PER_WORLD, *, sensor: str = "hazcam"
) -> list[StereoView]:
    """Return the views of one world, rendered now or kept in `folder` from an earlier study.

    `sensor` is `hazcam` or `navcam`; both see the same ground from the same poses.
    """
    kept = folder / f"placement_{VERSION}_{seed}_{count}_{sensor}.pickle"
    if kept.is_file():
        with kept.open("rb") as stream:
            found: list[StereoView] = pickle.load(stream)
        return found
    made = list(_render(seed, count, sensor))
    folder.mkdir(parents=True, exist_ok=True)
    with kept.open("wb") as stream:
        pickle.dump(made, stream)
    return made


def _render(seed: int, count: int, sensor: str) -> Iterator[StereoView]:
    terrain, profile = world(seed), load_profile("k9")
    rig = CameraRig(load_cameras("k9"), MAST_M)
    renderer = Renderer(scene_from_terrain(terrain, (0.0, 0.0), radius_m=12.0, far_m=24.0, seed=seed))
    rng = np.random.default_rng([seed, 0x9EE])
    made = 0
    for _ in range(400):
        x, y, heading = rng.uniform(-6, 6), rng.uniform(-6, 6), rng.uniform(-math.pi, math.pi)
        pose = settled_pose(terrain, profile, x, y, heading)
        sun = Sun.from_angles(rng.uniform(0, math.tau), math.radians(float(rng.uniform(25, 65))))
        if _blocked(terrain, pose):
            continue
        noise = (int(rng.integers(1 << 30)), int(rng.integers(1 << 30)))
        try:
            yield _view(seed, sensor, terrain, renderer, rig, pose, sun, noise)
        except RenderError:
            continue
        made += 1
        if made == count:
            return


def _view(
    seed: int,
    sensor: str,
    terrain: Terrain,
    renderer: Renderer,
    rig: CameraRig,
    pose: Pose,
    sun: Sun,
    noise: tuple[int, int],
) -> StereoView:
    names = (f"{sensor}_left", f"{sensor}_right")
    left, right = (rig.camera(name, 0.0, NAVCAM_TILT_RAD) for name in names)
    chip = rig.mounted(names[0]).sensor
    one = renderer.render(left, pose, sun, sensor=chip, seed=noise[0])
    two = renderer.render(right, pose, sun, sensor=chip, exposure=one.exposure, seed=noise[1])
    truth = one.truth
    known = {r.id: (r.id, r.diameter, r.height) for r in terrain.rocks}
    index = np.full(len(truth.ids) + 1, -1, np.int32)
    rocks: list[tuple[str, float, float]] = []
    for k in np.unique(truth.object_index):
        if k >= 0 and truth.ids[k] in known:
            index[k] = len(rocks)
            rocks.append(known[truth.ids[k]])
    return StereoView(
        seed,
        sensor,
        one.image8,
        two.image8,
        left,
        right,
        pose,
        truth.range_m,
        index[truth.object_index],
        truth.lit,
        tuple(rocks),
    )


def _blocked(terrain: Terrain, pose: Pose) -> bool:
    """Return whether a rock lies under the body or right in front of the cameras."""
    c, s = math.cos(pose.heading), math.sin(pose.heading)
    for rock in terrain.rocks_near(pose.x, pose.y, 1.6):
        dx, dy = rock.x - pose.x, rock.y - pose.y
        ahead, aside = c * dx + s * dy, -s * dx + c * dy
        reach = 0.5 * rock.diameter
        if -0.6 - reach < ahead < 0.75 + reach and abs(aside) < 0.45 + reach and rock.height > 0.1:
            return True
    return False
