"""Patches of the same surface point in two rendered pictures: other place, other sun, exact by geometry.

Worlds, rover, mast and suns are those of re-acquisition (`studies.common.reacquisition_worlds`), drawn by the
own renderer and with the grain of real frames. Three pictures are taken under each of two suns four hours
apart, from places a metre round the one that is believed and turned by up to 15 degrees. Keypoints of one
picture are put into another by its depth; where it sees the same surface a patch is cut there, its size as
the ranges have it, its place, size and upright off as two detections are. Pictures are blurred, made noisy
and compressed at random to 1 to 4 bits a pixel, as flown.
"""

from __future__ import annotations

import math
import time
from itertools import product
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel
from rover_iface.frames import Pose
from rover_iface.simulator.render.renderer import Sun
from rover_iface.vision.learned.descriptor import SIZES, cut
from studies.common.domain_painters import Painter, painter
from studies.common.domain_runs import World, world_of
from studies.common.domain_split import TUNING_SEEDS, Purpose
from studies.common.perception_worlds import Shot
from studies.common.reacquisition_worlds import FARTHEST_M, LOST_M, LOST_RAD, NEAREST_M, WHOLE, suns
from studies.common.tracking_worlds import PIVOT
from studies.common.warped import compressed
from studies.learned_matcher.kept_pairs import STORED, PatchPairs
from studies.learned_matcher.patches import Array, Grey, find_keys, single

TRAINING_SEEDS = range(500, TUNING_SEEDS.stop)
"""Worlds of the training; those of tuning seeds below set ratios, none of either is reported."""
DOMAINS = ("own", "draped")
VIEWS, EACH = 3, 420
"""Pictures under each sun, and patches taken of two pictures at most."""
AIM_RAD = math.radians(8.0)
SAME_SHARE = 0.02
"""What the range at a pixel may be off that of the point put there, else something hides it."""
PLACE, SCALE, TURN_RAD = 0.10, 0.20, math.radians(3.0)
"""How two detections of one thing differ, one deviation: place in diameters of the keypoint, size in
logarithms to base 2, upright by roll of the camera. Chosen, not measured: SIFT's scales are a third of an
octave apart, and it places a feature to a fraction of its scale."""


def halved(image: npt.NDArray[np.uint8] | Grey) -> Grey:
    """Return an image (rows, columns) at half its size."""
    import cv2

    rows, columns = (n // 2 for n in image.shape)
    source = image[: 2 * rows, : 2 * columns].astype(np.float32)
    return np.asarray(cv2.resize(source, (columns, rows), interpolation=cv2.INTER_AREA))


def half_camera(camera: CameraModel) -> CameraModel:
    """Return the camera of an image at half its size."""
    columns, rows = (n // 2 * 2 for n in camera.size)
    return camera.window(0, 0, columns, rows).scaled(0.5)


def put(shot: Shot, pixels: Array, into: Shot) -> tuple[Array, Array, Array]:
    """Return surface points (n, 3), m, under pixels (n, 2) of a picture at half its size, their pixels (n, 2)
    in another such, NaN where that does not show them, and how much larger things are there (n,).
    """
    ranges = _ranges(shot, pixels)
    origin, ray = half_camera(shot.true).back_project(pixels)
    points = np.asarray(origin + ranges[:, None] * ray)
    camera = half_camera(into.true)
    there = np.asarray(camera.project(points))
    away = np.linalg.norm(points - camera.C, axis=1)
    with np.errstate(invalid="ignore"):
        shown = np.abs(_ranges(into, there) - away) < SAME_SHARE * away
        growth = ranges / away * camera.hs / half_camera(shot.true).hs
    there[~shown] = np.nan
    return points, there, growth


def _ranges(shot: Shot, pixels: Array) -> Array:
    """Return the ranges (n,), m, under pixels (n, 2) at half size; NaN beyond the picture."""
    rows, columns = shot.range_m.shape
    with np.errstate(invalid="ignore"):
        full = np.round(2.0 * pixels + 0.5)
        inside = np.all((full >= 0) & (full < (columns, rows)), axis=1)
    at = np.where(inside[:, None], full, 0.0).astype(np.int64)
    return np.where(inside, shot.range_m[at[:, 1], at[:, 0]].astype(np.float64), np.nan)


def rendered(world: World, paint: Painter, sun: Sun, middle: Pose, rng: np.random.Generator) -> Shot:
    """Return a left navcam picture from somewhere within a metre and 15 degrees of a pose."""
    off, way = LOST_M * math.sqrt(float(rng.uniform())), float(rng.uniform(0, math.tau))
    x, y = middle.x + off * math.cos(way), middle.y + off * math.sin(way)
    tilt = [math.radians(rng.normal(0, sd)) for sd in (1.0, 2.0)]
    heading = middle.heading + float(rng.uniform(-LOST_RAD, LOST_RAD))
    pose = Pose(x, y, float(world.terrain.height_at(x, y)), heading, *tilt)
    aim = np.array([0.0, 0.0, world.rock.z + 0.4 * world.rock.height])
    pan, nod = world.rig.point_at(pose.site_from_rover.inverse().apply(aim), "navcam_left")
    pan, nod = pan + rng.normal(0, AIM_RAD), nod + rng.normal(0, 0.4 * AIM_RAD)
    camera = world.rig.camera("navcam_left", pan, nod).transformed(pose.site_from_rover)
    image, truth, _ = paint(camera, (0, 0, *WHOLE), sun, None, int(rng.integers(1 << 30)))
    return Shot(image, camera, camera, truth.range_m, truth.lit, np.zeros(truth.lit.shape, bool))


def flown(image: npt.NDArray[np.uint8], rng: np.random.Generator) -> Grey:
    """Return an image (rows, columns) at half its size, 0..1, blurred and noisy and often compressed."""
    import cv2

    seen = image.astype(np.float32) / np.float32(255.0)
    if rng.uniform() < 0.5:
        seen = cv2.GaussianBlur(seen, (0, 0), float(rng.uniform(0.3, 1.2)))
    seen = seen + rng.normal(0, float(rng.uniform(0, 0.01)), seen.shape).astype(np.float32)
    if rng.uniform() < 0.5:
        kind = ("jpeg", "wavelet")[int(rng.integers(2))]
        seen = compressed(seen, kind, float(rng.uniform(1.0, 4.0)))
    return halved(seen)


def pairs_of(seed: int, domain: str, imagery: Path) -> PatchPairs:
    """Return the patches of one world in one domain.

    Raises
    ------
    ValueError
        If the seed is none of training.
    """
    if seed not in TRAINING_SEEDS:
        raise ValueError(f"seed {seed} is no training seed ({TRAINING_SEEDS})")
    world, rng = world_of(seed), np.random.default_rng([seed, 0x1EA])
    sensor, middle = world.rig.mounted("navcam_left").sensor, np.array([0.0, 0.0, world.rock.z])
    paint = painter(domain, world.renderer, sensor, Purpose.TUNING, imagery, seed, middle, WHOLE)
    away, bearing = float(rng.uniform(NEAREST_M, FARTHEST_M)), math.pi + math.radians(rng.uniform(-30, 30))
    stand = Pose(
        away * math.cos(bearing) - PIVOT[0],
        away * math.sin(bearing),
        0.0,
        math.remainder(bearing + math.pi, math.tau),
    )
    try:
        shots = [rendered(world, paint, sun, stand, rng) for sun in suns(rng) for _ in range(VIEWS)]
    finally:
        paint.close()
    images = [flown(shot.image, rng) for shot in shots]
    early, late = range(VIEWS), range(VIEWS, 2 * VIEWS)
    # pictures under one sun too: a descriptor must not lose what does not change
    chosen = [*product(early, late), (0, 1), (VIEWS + 1, VIEWS)]
    parts = [
        _cut_both(shots[a], images[a], shots[b], images[b], number, rng)
        for number, (a, b) in enumerate(chosen)
    ]
    joined = (np.concatenate([getattr(part, name) for part in parts]) for name in PatchPairs.__slots__)
    return PatchPairs(*joined)


def _cut_both(
    shot: Shot, image: Grey, into: Shot, there: Grey, number: int, rng: np.random.Generator
) -> PatchPairs:
    keys = find_keys(image)
    keys = keys.some(single(keys))
    points, pixels, growth = put(shot, keys.pixels, into)
    rows, columns = there.shape
    with np.errstate(invalid="ignore"):
        held = (pixels > 8).all(axis=1) & (pixels < (columns - 8, rows - 8)).all(axis=1)
    some = rng.permutation(np.flatnonzero(held))[:EACH]
    count, size = len(some), keys.sizes[some]
    other = size * growth[some] * 2.0 ** rng.normal(0, SCALE, count)
    place = pixels[some] + PLACE * other[:, None] * rng.normal(0, 1.0, (count, 2))
    one_cut = cut(image, keys.pixels[some], SIZES * size)
    other_cut = cut(there, place, SIZES * other, rng.normal(0, TURN_RAD, count))
    eye = half_camera(shot.true)
    radius = 0.5 * SIZES * size * np.linalg.norm(points[some] - eye.C, axis=1) / eye.hs
    return PatchPairs(
        _stored(one_cut), _stored(other_cut), points[some], radius, np.full(count, number, np.int64)
    )


def _stored(patches: Grey) -> npt.NDArray[np.uint8]:
    return np.clip(np.round(128.0 + STORED * patches), 0, 255).astype(np.uint8)


def make_pairs(worlds: int, imagery: Path, folder: Path) -> None:
    """Write the patches of training worlds into a folder; what is there is not made again."""
    folder.mkdir(parents=True, exist_ok=True)
    for seed, domain in product(TRAINING_SEEDS[:worlds], DOMAINS):
        path = folder / f"pairs_{domain}_{seed}.npz"
        if path.is_file():
            continue
        started = time.process_time()
        made = pairs_of(seed, domain, imagery)
        made.save(path)
        spent = time.process_time() - started
        print(f"{domain} {seed}: {len(made.one)} pairs of patches, {spent:.1f} s of processor", flush=True)
