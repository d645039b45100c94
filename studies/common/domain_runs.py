"""Approaches to any visible rock, in pictures of several makers: what `studies.domains` measures on.

Rocks are 0.25 to 0.7 m wide and half as high, as real targets are; nothing is cleared away, the sun may stand
up to 100 degrees from behind. Targets are points drawn from what is seen of the rock, at least 3 px inside
its outline; there is no other choice.
"""

from __future__ import annotations

import math
import pickle
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Literal

import numpy as np

from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.frames import Pose, Transform
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.terrain.generate import generate_terrain
from rover_iface.terrain.rocks import Rock
from rover_iface.terrain.terrain import Terrain
from studies.common.domain_painters import LARGEST_PX, Painter, painter
from studies.common.domain_split import Purpose
from studies.common.perception_worlds import Halt, Shot
from studies.common.tracking_worlds import BIG, PIVOT, Array, Believed

Fault = Literal["", "jump", "board", "light"]
FAULTS: tuple[Fault, ...] = ("jump", "board", "light")
SIZE = (361, 301)
LAST_M, SHARE = 1.7, 0.10
JUMP_RAD = math.radians(7.0)


@dataclass(frozen=True)
class Target:
    """A surface point, and at which stops it is in sight of the left camera."""

    point: Array
    visible: tuple[bool, ...]


@dataclass(frozen=True)
class Run:
    """One approach: stops, targets, and from which stop on the fault lasts (its stops, empty without).

    `narrow` is what the mast's narrow pair takes of the rock at the first stop.
    """

    domain: str
    seed: int
    fault: Fault
    halts: list[Halt]
    targets: list[Target]
    hit: range
    narrow: tuple[Shot, Shot]


@dataclass(frozen=True)
class World:
    """A rock at the origin on generated ground, the rover's cameras and the sun."""

    terrain: Terrain
    renderer: Renderer
    rock: Rock
    rig: CameraRig
    sun: Sun


@lru_cache(maxsize=1)
def world_of(seed: int) -> World:
    """Return the world of a seed; the last one is kept."""
    rng = np.random.default_rng([seed, 0xD0A])
    terrain = generate_terrain(
        seed, 64.0, rock_cover=0.06, inner_m=30.0, crater=False, outcrop=False, relief_m=0.6, ortho=False
    )
    width = float(rng.uniform(0.25, 0.70))
    rock = Rock(
        BIG,
        0.0,
        0.0,
        float(terrain.height(0.0, 0.0, ground=True)),
        diameter=width,
        height=width * float(rng.uniform(0.4, 0.7)),
        yaw=float(rng.uniform(0, math.tau)),
        elongation=float(rng.uniform(0.6, 1.0)),
        burial=0.2,
        seed=seed % 100_000,
    )
    apart = tuple(
        r for r in terrain.rocks if math.hypot(r.x, r.y) > 0.5 * (width + r.diameter) and _off_path(r)
    )
    terrain = replace(terrain, rocks=(rock, *apart))
    scene = scene_from_terrain(terrain, (0.0, 0.0), radius_m=14.0, far_m=60.0, seed=seed)
    azimuth = math.radians(270.0 + rng.uniform(-100, 100))
    sun = Sun.from_angles(azimuth, math.radians(float(rng.uniform(25, 60))))
    return World(terrain, Renderer(scene), rock, CameraRig(load_cameras("k9"), PIVOT), sun)


def _off_path(rock: Rock) -> bool:
    """Return whether the rover, coming from the west, would not have to climb a rock."""
    return not (rock.diameter > 0.3 and -12.0 < rock.x < -0.8 and abs(rock.y) < 0.35 * abs(rock.x) + 0.8)


def kept_run(domain: str, seed: int, purpose: Purpose, imagery: Path, folder: Path, fault: Fault = "") -> Run:
    """Return an approach, rendered now or kept in `folder` from an earlier study."""
    kept = folder / f"{domain}_{purpose}_{seed}_{fault or 'nominal'}.pickle"
    if kept.is_file():
        with kept.open("rb") as stream:
            found: Run = pickle.load(stream)
        return found
    made = make_run(domain, seed, purpose, imagery, fault)
    folder.mkdir(parents=True, exist_ok=True)
    with kept.open("wb") as stream:
        pickle.dump(made, stream)
    return made


def make_run(domain: str, seed: int, purpose: Purpose, imagery: Path, fault: Fault = "") -> Run:
    """Return one approach of 6 to 10 m to 1.7 m in steps of a tenth of what remains."""
    world = world_of(seed)
    sensor = world.rig.mounted("navcam_left").sensor
    middle = np.array([0.0, 0.0, world.rock.z])
    paint = painter(domain, world.renderer, sensor, purpose, imagery, seed, middle)
    try:
        return _approach(domain, seed, fault, world, paint)
    finally:
        paint.close()


def _approach(domain: str, seed: int, fault: Fault, world: World, paint: Painter) -> Run:
    rng = np.random.default_rng([seed, 0xA99, FAULTS.index(fault) + 1 if fault else 0])
    look = np.array([0.0, 0.0, world.rock.z + 0.4 * world.rock.height])
    bend = math.radians(float(rng.uniform(-30, 30)))
    first_m = float(rng.uniform(6.0, 10.0))
    at = int(rng.integers(3, 9))
    believed, halts, remaining, travelled = Believed(), [], first_m, 0.0
    azimuth = math.atan2(world.sun.direction[0], world.sun.direction[1])
    elevation = math.asin(world.sun.direction[2])
    while True:
        number = len(halts)
        bearing = math.pi + bend * (remaining - LAST_M) / (first_m - LAST_M)
        heading = math.remainder(bearing + math.pi + rng.normal(0, 0.04), math.tau)
        x = remaining * math.cos(bearing) - PIVOT[0] * math.cos(heading)
        y = remaining * math.sin(bearing) - PIVOT[0] * math.sin(heading)
        tilt = [math.radians(rng.normal(0, sd)) for sd in (1.0, 2.0)]
        pose = Pose(x, y, float(world.terrain.height_at(x, y)), heading, *tilt)
        if fault == "jump" and number == at:
            believed.error = _turned(believed.error, pose, JUMP_RAD * rng.choice((-1.0, 1.0)))
        told = believed.of(pose, rng)
        sun = Sun.from_angles(azimuth + math.radians(0.8) * number, elevation)
        if fault == "light" and number >= at:
            sun = Sun.from_angles(azimuth + 0.75 * math.pi, math.radians(14.0), strength=0.5)
        # the mast points where the rover believes the target to be: after a jump, where it was before
        if fault == "jump" and number >= at:
            aim = halts[at - 1].told.apply(halts[at - 1].pose.site_from_rover.inverse().apply(look))
        else:
            aim = told.apply(pose.site_from_rover.inverse().apply(look))
        aim = aim + rng.normal(0, 0.02, 3)
        halts.append(Halt(*pair_of(world, paint, pose, told, sun, aim, rng), pose, told, sun, travelled))
        if remaining <= LAST_M + 1e-9:
            break
        moved = min(SHARE * remaining, remaining - LAST_M)
        believed.drift(rng, pose, moved, 0.03, math.radians(0.3))
        remaining -= moved
        travelled += moved
    count = len(halts)
    hit = (
        range(at, count)
        if fault in ("jump", "light")
        else range(at, min(at + 2, count))
        if fault
        else range(0)
    )
    if fault == "board":
        from studies.common.perception_faults import board

        for n in hit:
            away = float(np.linalg.norm(look - halts[n].left.true.C))
            halts[n] = board(halts[n], look, rng, side_m=0.10 * away)
    targets = _targets(world, halts, rng)
    first, kind = halts[0], ("pancam", LARGEST_PX)
    again = np.random.default_rng([seed, 0x9A4])
    narrow = pair_of(
        world,
        paint,
        first.pose,
        first.told,
        first.sun,
        first.told.apply(first.pose.site_from_rover.inverse().apply(look)),
        again,
        *kind,
    )
    return Run(domain, seed, fault, halts, targets, hit, narrow)


def _turned(error: Transform, pose: Pose, angle: float) -> Transform:
    """Return the error of a believed pose after the heading has jumped where the rover stands."""
    turn = Transform.from_rpy(0.0, 0.0, angle)
    here = error.apply((pose.x, pose.y, pose.z))
    return Transform(turn.rotation, here - turn.rotate(here)) * error


def pair_of(
    world: World,
    paint: Painter,
    pose: Pose,
    told: Transform,
    sun: Sun,
    aim: Array,
    rng: np.random.Generator,
    kind: str = "navcam",
    size: tuple[int, int] = SIZE,
) -> tuple[Shot, Shot]:
    """Return the pair of subframes round a point (3,), m, where the rover believes that it is."""
    mast = rng.normal(0, math.radians(0.07), 2)
    pan, tilt = world.rig.point_at(told.inverse().apply(aim), f"{kind}_left")
    shots: list[Shot] = []
    gain = None
    for name in (f"{kind}_left", f"{kind}_right"):
        true_camera = world.rig.camera(name, pan + mast[0], tilt + mast[1]).transformed(pose.site_from_rover)
        told_camera = world.rig.camera(name, pan, tilt).transformed(told)
        middle = told_camera.project(aim)
        left, top = (
            int(np.clip(round(at) - part // 2, 0, whole - part))
            for at, part, whole in zip(middle, size, told_camera.size, strict=True)
        )
        window = (left, top, *size)
        image, truth, gain = paint(true_camera, window, sun, gain, int(rng.integers(1 << 30)))
        on_rock = truth.object_index == (truth.ids.index(BIG) if BIG in truth.ids else -2)
        shot = Shot(
            image,
            true_camera.window(*window),
            told_camera.window(*window),
            truth.range_m,
            truth.lit,
            on_rock,
        )
        shots.append(shot)
    return shots[0], shots[1]


def _targets(world: World, halts: list[Halt], rng: np.random.Generator, count: int = 5) -> list[Target]:
    import cv2

    first = halts[0].left
    inner = cv2.erode(first.on_rock.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    lines, samples = np.nonzero(inner)
    if not len(lines):
        return []
    points = first.points()
    picks = rng.permutation(len(lines))[:count]
    scene = world.renderer.scene
    found = []
    for n in picks:
        point = points[lines[n], samples[n]]
        seen = tuple(
            bool(h.left.true.sees(point, 12.0)) and bool(scene.sees(h.left.true.C, point[None])[0])
            for h in halts
        )
        found.append(Target(point, seen))
    return found
