"""Rendered drives: what visual odometry says of every step beside the truth, kept part by part.

A drive leads over generated ground along straight pieces, bends and turns on the spot. At each stop the
pair of navcams is rendered, the middle 480 x 400 pixels of each; the mast does not move between stops and
the cameras are those that odometry is told. The sun goes on between stops. A part of about 8 m is drawn in
one scene and begins at the stop where the one before ended, so each step lies within one scene.
"""

from __future__ import annotations

import itertools
import math
import pickle
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np

from rover_iface.cameras.model import CameraModel
from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.frames import Pose, Transform, wrap_angle
from rover_iface.localization.bundle_adjustment import small_motion
from rover_iface.localization.visual_odometry import Step, VisualOdometer
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.terrain.generate import generate_terrain
from rover_iface.terrain.rocks import Rock
from rover_iface.terrain.terrain import Terrain
from rover_iface.vision.tracker import StereoView
from studies.common.domain_painters import Painter, painter
from studies.common.domain_split import Purpose
from studies.common.tracking_worlds import PIVOT, Array

Kind = Literal["straight", "bend", "spot"]
KINDS: tuple[Kind, ...] = ("straight", "bend", "spot")
STEP_M = 0.75
SPOT_RAD = math.radians(8.0)
"""A turn on the spot in one step: of 24 degrees of view, two thirds of a picture are in the next one too."""
BEND_M = 5.4
"""Radius of a bend: a step of it turns by as much as one on the spot."""
PART_M = 8.0
"""Longest part: with the 7 m that the pictures show it lies within the 12 m of small stones of its scene."""
SIZE = (480, 400)
"""Pixels of the middle of a navcam picture that are used, 24 by 20 degrees: a step takes a second."""
TILT_RAD = -0.42
"""Tilt of the mast: the picture begins 2.3 m in front of the mast and ends 6 m away."""
SUN_RAD = math.radians(0.17)
"""What the sun goes on in a step: 40 s of a Mars day."""
CLEAR_M = 0.9
"""Half the width of the rover and a little: nothing higher than a few centimetres lies there on its path."""
WHEEL_SHARE, WHEEL_TURN = 0.05, math.radians(0.5)
TOLD_TILT = math.radians(0.3)


@dataclass(frozen=True, slots=True)
class Stop:
    """Where the rover stands, site frame, and what kind of step leads there."""

    pose: Pose
    kind: Kind


@dataclass(frozen=True, eq=False, slots=True)
class FlownStep:
    """One step of visual odometry and the truth.

    Attributes
    ----------
    true
        Pose of the rover after the step in its frame before.
    step
        What odometry says of it.
    kind
        Of the step.
    """

    true: Transform
    step: Step
    kind: Kind

    @property
    def error(self) -> Array:
        """Return the small motion [6] (turn, rad, shift, m, axes after the step) from truth to answer."""
        return small_motion(self.true, self.step.old_from_new)

    @property
    def nees(self) -> float:
        """Return the squared error over the covariance told; 6 is expected."""
        return float(self.error @ np.linalg.solve(self.step.covariance, self.error))


@dataclass(frozen=True, slots=True)
class Drive:
    """What is driven.

    Attributes
    ----------
    ground
        Seed of terrain and path.
    run
        Seed of all else: attitudes, offsets from the path, sun, wheels, noise. Runs of one ground have the
        same first and the same last pose.
    domain
        Who takes the pictures (`studies.common.domain_painters`).
    length_m
        Of the path.
    """

    ground: int
    run: int
    domain: str
    length_m: float
    purpose: Purpose

    @property
    def name(self) -> str:
        """Return the name of its files."""
        return f"drive_{self.domain}_{self.purpose}_{self.ground}_{self.run}_{self.length_m:g}"


@dataclass(eq=False)
class Flown:
    """A drive as flown: steps in order, and where each part begins."""

    drive: Drive
    steps: list[FlownStep] = field(default_factory=list)


def path_of(ground: int, length_m: float) -> list[tuple[Kind, float]]:
    """Return the pieces of a path: metres of a straight piece, radians (left is positive) of a turn."""
    rng = np.random.default_rng([ground, 0x9A7])
    pieces: list[tuple[Kind, float]] = []
    course, gone = 0.0, 0.0
    while gone < length_m - 1e-6:
        straight = min(float(rng.uniform(4.0, 9.0)), length_m - gone)
        pieces.append(("straight", straight))
        gone += straight
        # never more than 60 degrees from east, so that the path does not meet itself
        turn = math.copysign(float(rng.uniform(0.3, 0.9)), rng.normal() - 2.0 * course)
        turn = float(np.clip(course + turn, -1.05, 1.05)) - course
        kind: Kind = "bend" if rng.random() < 0.5 else "spot"
        left = length_m - gone
        if kind == "bend":
            turn = math.copysign(min(abs(turn), left / BEND_M), turn)
            gone += abs(turn) * BEND_M
        if left > 1e-6:
            pieces.append((kind, turn))
            course += turn
    return pieces


def stops_of(terrain: Terrain, drive: Drive) -> list[Stop]:
    """Return the stops of a drive; the path lies round the middle of the terrain."""
    rng = np.random.default_rng([drive.ground, drive.run, 0x570])
    places: list[tuple[float, float, float, Kind]] = [(-0.5 * drive.length_m, 0.0, 0.0, "straight")]
    for kind, amount in path_of(drive.ground, drive.length_m):
        x, y, course, _ = places[-1]
        wanted = SPOT_RAD if kind == "spot" else STEP_M if kind == "straight" else STEP_M / BEND_M
        count = max(1, round(abs(amount) / (wanted * float(rng.uniform(0.9, 1.1)))))
        for k in range(1, count + 1):
            part = amount * k / count
            if kind == "straight":
                at = x + part * math.cos(course), y + part * math.sin(course), course
            elif kind == "spot":
                at = x, y, course + part
            else:
                radius = math.copysign(BEND_M, amount)
                at = (
                    x + radius * (math.sin(course + part) - math.sin(course)),
                    y - radius * (math.cos(course + part) - math.cos(course)),
                    course + part,
                )
            places.append((*at, kind))
    stops = []
    for number, (x, y, course, kind) in enumerate(places):
        # the rover is not quite on its path and rocks on its wheels, but for the two ends that runs share
        loose = 0.0 if number in (0, len(places) - 1) else 1.0
        aside = loose * rng.normal(0, 0.05, 2)
        turned = loose * rng.normal(0, math.radians(1.5))
        tilt = [loose * math.radians(rng.normal(0, sigma)) for sigma in (1.0, 2.0)]
        x, y = x + float(aside[0]), y + float(aside[1])
        height = float(terrain.height(x, y, ground=True))
        stops.append(Stop(Pose(x, y, height, wrap_angle(course + turned), *tilt), kind))
    return stops


@lru_cache(maxsize=1)
def ground_of(ground: int, length_m: float) -> Terrain:
    """Return the terrain of a path, without rocks that the rover would have to climb."""
    rng = np.random.default_rng([ground, 0x62D])
    terrain = generate_terrain(
        ground,
        max(64.0, math.ceil(length_m) + 40.0),
        rock_cover=float(rng.uniform(0.02, 0.08)),
        inner_m=8.0,
        inner_spacing_m=0.1,
        spacing_m=0.25,
        crater=False,
        outcrop=False,
        relief_m=float(rng.uniform(0.4, 1.0)),
        ortho=False,
        smallest_rock_m=0.10,
    )
    stops = stops_of(terrain, Drive(ground, 0, "own", length_m, Purpose.TUNING))
    path = np.array([(s.pose.x, s.pose.y) for s in stops])
    return replace(terrain, rocks=tuple(r for r in terrain.rocks if _beside(r, path)))


def _beside(rock: Rock, path: Array) -> bool:
    away = float(np.hypot(path[:, 0] - rock.x, path[:, 1] - rock.y).min())
    return rock.height < 0.06 or away > CLEAR_M + 0.5 * rock.diameter


def parts_of(stops: Sequence[Stop]) -> list[range]:
    """Return the stops of each part, about as many in each; the last of one is the first of the next."""
    places = np.array([(s.pose.x, s.pose.y) for s in stops])
    gone = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))))
    count = max(1, math.ceil(gone[-1] / PART_M))
    cuts = [int(np.searchsorted(gone, gone[-1] * k / count)) for k in range(count)] + [len(stops) - 1]
    return [range(first, last + 1) for first, last in itertools.pairwise(cuts)]


def flown(drive: Drive, imagery: Path, folder: Path, parts: int | None = None) -> Flown:
    """Return a drive or its first `parts`, rendered now or taken from `folder` where they are kept."""
    folder.mkdir(parents=True, exist_ok=True)
    terrain = ground_of(drive.ground, drive.length_m)
    stops = stops_of(terrain, drive)
    out = Flown(drive)
    for number, part in enumerate(parts_of(stops)[:parts]):
        kept = folder / f"{drive.name}_{number}.pickle"
        if kept.is_file():
            with kept.open("rb") as stream:
                steps: list[FlownStep] = pickle.load(stream)
        else:
            steps = _part(drive, number, terrain, [stops[k] for k in part], part.start, imagery)
            with kept.open("wb") as stream:
                pickle.dump(steps, stream)
            worst = max((s.nees for s in steps), default=math.nan)
            mean = np.mean([s.nees for s in steps])
            print(
                f"  {drive.name} part {number}: {len(steps)} steps, NEES {mean:.1f}, worst {worst:.1f}",
                flush=True,
            )
        out.steps += steps
    return out


def _part(
    drive: Drive, number: int, terrain: Terrain, stops: list[Stop], first: int, imagery: Path
) -> list[FlownStep]:
    rng = np.random.default_rng([drive.ground, drive.run, number, 0x9A2])
    whole = np.random.default_rng([drive.ground, drive.run, 0x50A])
    azimuth, elevation = float(whole.uniform(0, math.tau)), math.radians(float(whole.uniform(25, 60)))
    claimed = 1.0 + float(whole.normal(0, WHEEL_SHARE / math.sqrt(2)))
    middle = stops[len(stops) // 2].pose
    scene = scene_from_terrain(terrain, (middle.x, middle.y), radius_m=14.0, far_m=60.0, seed=drive.ground)
    rig = CameraRig(load_cameras("k9"), PIVOT)
    sensor = rig.mounted("navcam_left").sensor
    about = np.array([middle.x, middle.y, middle.z])
    paint = painter(drive.domain, Renderer(scene), sensor, drive.purpose, imagery, drive.ground, about)
    odometer, out = VisualOdometer(), []
    try:
        for k, stop in enumerate(stops):
            sun = Sun.from_angles(azimuth + SUN_RAD * (first + k), elevation)
            view = view_at(rig, paint, stop.pose, sun, rng)
            true = Transform.identity()
            if k:
                true = stops[k - 1].pose.site_from_rover.inverse() * stop.pose.site_from_rover
            step = odometer.step(view, wheels_of(true, claimed, rng))
            if step is not None:
                out.append(FlownStep(true, step, stop.kind))
    finally:
        paint.close()
    return out


def wheels_of(true: Transform, claimed: float, rng: np.random.Generator) -> Transform:
    """Return what wheels and inclinometer say of a motion.

    They are 5 % off along it, half of the variance (`claimed`) the same on the whole drive, 1 cm across,
    half a degree in heading, 0.3 degrees in roll and pitch.
    """
    share = claimed + rng.normal(0, WHEEL_SHARE / math.sqrt(2))
    off = Transform.from_rpy(
        float(rng.normal(0, TOLD_TILT)),
        float(rng.normal(0, TOLD_TILT)),
        float(rng.normal(0, WHEEL_TURN)),
    )
    return Transform(true.rotation @ off.rotation, share * true.translation + rng.normal(0, 0.01, 3))


def view_at(rig: CameraRig, paint: Painter, pose: Pose, sun: Sun, rng: np.random.Generator) -> StereoView:
    """Return the pair that is seen from a pose, cameras in the rover frame."""
    gain: float | None = None
    images, cameras = [], []
    for name in ("navcam_left", "navcam_right"):
        camera: CameraModel = rig.camera(name, 0.0, TILT_RAD)
        window = ((camera.width - SIZE[0]) // 2, (camera.height - SIZE[1]) // 2, *SIZE)
        image, _, gain = paint(
            camera.transformed(pose.site_from_rover), window, sun, gain, int(rng.integers(1 << 30))
        )
        images.append(image.astype(np.float32) / np.float32(255.0))
        cameras.append(camera.window(*window))
    return StereoView(images[0], images[1], cameras[0], cameras[1])
