"""Rendered approaches that the studies of feature tracker, shape tracker and hand-off share.

One world is one rock on generated ground, approached from 10 m to the arm's reach in steps of 10 % along a
bent path while the sun moves on. Pictures are rendered once and kept in a folder for later studies.
"""

from __future__ import annotations

import math
import pickle
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel
from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.frames import Pose, Transform
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.picture import AutoExposure, Frame
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.terrain.generate import generate_terrain
from rover_iface.terrain.rocks import Rock
from rover_iface.vision.tracker import StereoView
from studies.common.tracking_worlds import BIG, PIVOT, Array, Believed

HALF = (230, 190)
FIRST_M, LAST_M, SHARE = 10.0, 1.45, 0.10
VERSION = 1
TRAINING = 4
"""Worlds below this set what there is to set in trackers and hand-off; no table uses them."""


@dataclass(frozen=True)
class Shot:
    """One picture: image in 0..255, the camera as it was and as the rover believed it, and what it saw."""

    image: npt.NDArray[np.uint8]
    true: CameraModel
    told: CameraModel
    range_m: npt.NDArray[np.float32]
    lit: npt.NDArray[np.bool_]
    on_rock: npt.NDArray[np.bool_]

    @property
    def unit(self) -> npt.NDArray[np.float32]:
        """Return the image as float32 in 0..1."""
        return (self.image / np.float32(255.0)).astype(np.float32)

    def points(self) -> Array:
        """Return the surface point of every pixel (height, width, 3), site frame."""
        u, v = np.meshgrid(np.arange(self.image.shape[1]), np.arange(self.image.shape[0]))
        origins, rays = self.true.back_project(np.stack((u, v), axis=-1).astype(float))
        with np.errstate(invalid="ignore"):
            return np.asarray(origins + self.range_m[..., None].astype(np.float64) * rays)

    def at(self, pixel: npt.ArrayLike) -> Array:
        """Return the surface point under a pixel (sample, line), by the nearest ray's range."""
        x, y = np.asarray(pixel, dtype=np.float64)
        origin, ray = self.true.back_project((x, y))
        i, j = (
            int(np.clip(x, 0, self.image.shape[1] - 1.001)),
            int(np.clip(y, 0, self.image.shape[0] - 1.001)),
        )
        fx, fy = x - i, y - j
        weights = np.array([[(1 - fx) * (1 - fy), fx * (1 - fy)], [(1 - fx) * fy, fx * fy]])
        return np.asarray(origin + float((weights * self.range_m[j : j + 2, i : i + 2]).sum()) * ray)


@dataclass(frozen=True)
class Halt:
    """One stop of an approach: the navcam pair, where the rover was and where it believed to be."""

    left: Shot
    right: Shot
    pose: Pose
    told: Transform
    sun: Sun
    travelled_m: float

    def view(self) -> StereoView:
        """Return the pair with the cameras as the rover believes them to be."""
        return StereoView(
            self.left.unit, self.right.unit, self.left.told, self.right.told, travelled_m=self.travelled_m
        )


@dataclass(frozen=True)
class Sequence:
    """An approach: its halts, the hazcam pair at the last one, a pancam picture from about 4.5 m."""

    seed: int
    halts: list[Halt]
    hazcam: tuple[Shot, Shot]
    pancam: Shot
    rock: Rock
    targets: list[tuple[Array, Array]]


def approach(seed: int, folder: Path) -> Sequence:
    """Return approach number `seed`, rendered now or kept in `folder` from an earlier study."""
    kept = folder / f"approach_{VERSION}_{seed}.pickle"
    if kept.is_file():
        with kept.open("rb") as stream:
            found: Sequence = pickle.load(stream)
        return found
    made = _render(seed)
    folder.mkdir(parents=True, exist_ok=True)
    with kept.open("wb") as stream:
        pickle.dump(made, stream)
    return made


def rock_scene(seed: int) -> tuple[Renderer, Rock, Sun, CameraRig, object]:
    """Return a renderer of rough ground with a rock of 0.5 to 1.1 m at the origin, the sun behind."""
    rng = np.random.default_rng([seed, 0x5EE])
    terrain = generate_terrain(
        5000 + seed,
        64.0,
        rock_cover=0.05,
        inner_m=30.0,
        crater=False,
        outcrop=False,
        relief_m=0.6,
        ortho=False,
    )
    width = float(rng.uniform(0.5, 1.1))
    keep = tuple(
        r
        for r in terrain.rocks
        if r.diameter < 0.30
        and math.hypot(r.x, r.y) > 0.5 * width + r.diameter + 0.1
        and not (-3.2 < r.x < -0.4 * width and abs(r.y) < 0.6 and r.diameter > 0.12)
    )
    rock = Rock(
        BIG,
        0.0,
        0.0,
        float(terrain.height(0.0, 0.0, ground=True)),
        diameter=width,
        height=width * float(rng.uniform(0.55, 0.75)),
        yaw=float(rng.uniform(0, math.tau)),
        elongation=0.9,
        burial=0.25,
        seed=9000 + seed,
    )
    terrain = replace(terrain, rocks=(rock, *keep))
    scene = scene_from_terrain(terrain, (0.0, 0.0), radius_m=14.0, far_m=60.0, seed=seed)
    sun = Sun.from_angles(
        math.radians(270.0 + rng.uniform(-55, 55)), math.radians(float(rng.uniform(30, 60)))
    )
    return Renderer(scene), rock, sun, CameraRig(load_cameras("k9"), PIVOT), terrain


def _shot(frame: Frame, told: CameraModel) -> Shot:
    truth = frame.truth
    return Shot(
        frame.image8,
        frame.camera,
        told,
        truth.range_m,
        truth.lit,
        truth.object_index == truth.ids.index(BIG),
    )


def _render(seed: int) -> Sequence:
    renderer, rock, first_sun, rig, terrain = rock_scene(seed)
    rng = np.random.default_rng([seed, 0xA99])
    look = np.array([0.0, 0.0, rock.z + 0.45 * rock.height])
    bend = math.radians(float(rng.uniform(-30, 30)))
    azimuth = math.atan2(first_sun.direction[0], first_sun.direction[1])
    elevation = math.asin(first_sun.direction[2])
    believed, halts = Believed(), []
    remaining, travelled = FIRST_M, 0.0
    last = LAST_M + 0.3 * (rock.diameter - 0.8)
    pancam: Shot | None = None

    def picture(name: str, pan: float, tilt: float, aim: Array, exposure: AutoExposure | float) -> Shot:
        true_camera, told_camera = (
            rig.camera(name, p, t) for p, t in ((pan + mast[0], tilt + mast[1]), (pan, tilt))
        )
        told_camera = told_camera.transformed(told)
        window = None
        if not name.startswith("hazcam"):
            middle = told_camera.project(aim)
            size = 2 * HALF[0] + 1, 2 * HALF[1] + 1
            left = int(np.clip(round(middle[0]) - HALF[0], 0, told_camera.width - size[0]))
            top = int(np.clip(round(middle[1]) - HALF[1], 0, told_camera.height - size[1]))
            window = (left, top, *size)
            told_camera = told_camera.window(*window)
        frame = renderer.render(
            true_camera,
            pose,
            sun,
            window=window,
            sensor=rig.mounted(name).sensor,
            exposure=exposure,
            seed=int(rng.integers(1 << 30)),
        )
        shot = _shot(frame, told_camera)
        exposures.append(frame.exposure)
        return shot

    while True:
        share = (remaining - last) / (FIRST_M - last)
        bearing = math.pi + bend * share
        x, y = remaining * math.cos(bearing), remaining * math.sin(bearing)
        heading = math.remainder(bearing + math.pi + rng.normal(0, 0.04), math.tau)
        x, y = x - PIVOT[0] * math.cos(heading), y - PIVOT[0] * math.sin(heading)
        pose = Pose(
            x,
            y,
            float(terrain.height_at(x, y)),  # type: ignore[attr-defined]
            heading,
            math.radians(rng.normal(0, 1.0)),
            math.radians(rng.normal(0, 2.0)),
        )
        told = believed.of(pose, rng)
        sun = Sun.from_angles(azimuth + math.radians(0.8) * len(halts), elevation)
        mast = rng.normal(0, math.radians(0.07), 2)
        exposures: list[float] = []
        aim = told.apply(pose.site_from_rover.inverse().apply(look)) + rng.normal(0, 0.02, 3)
        pan, tilt = rig.point_at(told.inverse().apply(aim), "navcam_left")
        left = picture("navcam_left", pan, tilt, aim, AutoExposure())
        right = picture("navcam_right", pan, tilt, aim, exposures[0])
        halts.append(Halt(left, right, pose, told, sun, travelled))
        if remaining <= 4.7 and pancam is None:
            angles = rig.point_at(told.inverse().apply(aim), "pancam_left")
            pancam = picture("pancam_left", *angles, aim, AutoExposure())
        if remaining <= last + 1e-9:
            break
        moved = min(SHARE * remaining, remaining - last)
        believed.drift(rng, pose, moved, 0.03, math.radians(0.3))
        remaining -= moved
        travelled += moved
    mast = np.zeros(2)
    one = picture("hazcam_left", 0.0, 0.0, aim, AutoExposure())
    two = picture("hazcam_right", 0.0, 0.0, aim, exposures[-1])
    assert pancam is not None
    return Sequence(seed, halts, (one, two), pancam, rock, _targets(halts, one, renderer))


def _targets(halts: list[Halt], hazcam: Shot, renderer: Renderer) -> list[tuple[Array, Array]]:
    """Return (pixel in the first view, true point) of up to 12 targets on lit faces that stay in sight.

    As in the published trials none lies on an occluding edge: the face seen at 10 m is flat enough over a
    window of 9 px, and it is seen at the last stop and by the hazcam less than 65 degrees off its normal.
    """
    first, points = halts[0].left, halts[0].left.points()
    half, found = 4, []
    lines, samples = np.nonzero(first.on_rock)
    for y, x in zip(lines, samples, strict=True):
        if x % 3 or y % 3 or not (20 < x < first.image.shape[1] - 20 and 20 < y < first.image.shape[0] - 20):
            continue
        cut = (slice(y - half, y + half + 1), slice(x - half, x + half + 1))
        if not first.on_rock[cut].all() or first.lit[cut].mean() < 0.8 or np.ptp(first.range_m[cut]) > 0.12:
            continue
        point = points[y, x]
        normal = np.cross(points[y, x + 3] - points[y, x - 3], points[y - 3, x] - points[y + 3, x])
        normal /= np.linalg.norm(normal)
        seen = True
        for camera, margin in (
            (halts[-1].left.true, 30.0),
            (halts[-1].right.true, 30.0),
            (hazcam.true, 40.0),
        ):
            toward = camera.C - point
            seen &= bool(camera.sees(point, margin)) and bool(renderer.scene.sees(camera.C, point[None])[0])
            seen &= float(abs(normal @ toward)) / float(np.linalg.norm(toward)) > math.cos(math.radians(65.0))
        if seen:
            found.append((np.array([x, y], dtype=np.float64), point))
    if len(found) > 12:
        found = [found[i] for i in np.linspace(0, len(found) - 1, 12).round().astype(int)]
    return found
