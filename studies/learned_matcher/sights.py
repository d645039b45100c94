"""What the contest is held on: two pictures of one place, their keypoints, and which truly is which.

Rendered: the stops before and after the pose was lost, four hours apart (`Trial`); the keypoints of the first
are those that its pair ranges, as re-acquisition uses them, both at half size. Photographs: the boulder of
Apollo 17, poses by an adjustment that knows nothing of this project (its points were found by SIFT, but they
only say how far away the surface is here). Warped: a real stereo pair's left picture, turned and zoomed by
known geometry and compressed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel
from rover_iface.vision.reacquisition import ROW_PX, ReacquisitionOptions, even
from rover_iface.vision.reacquisition import halved as halved_pair
from rover_iface.vision.sift_features import Descriptors, find_features
from studies.common.domain_split import PAIRS, Purpose
from studies.common.reacquisition_worlds import Trial, view_of
from studies.common.warped import warped_run
from studies.learned_matcher.pairs import half_camera, halved, put
from studies.learned_matcher.patches import Array, Grey, Keys, find_keys
from studies.real_overlaps import LEAST_COMMON, Photograph, face, photographs

FACE_PX, AWAY_PX = 25.0, 12.0
"""How near to a point of the adjustment a photograph's keypoint is, so that the face there says how far away
it is; and how far from there its match may lie along the epipolar line, as a boulder is not flat."""
PHOTOGRAPH_KEYS = 4000
"""Strongest keypoints of a photograph: it has more pixels than a navcam's at half size."""
STEP = 3
"""Sights of a warped picture from one to the next: a zoom by 1.37."""


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """What a pose is worked out from.

    Points (n, 3), m, of the keypoints as ranged, their covariance (n, 3, 3) for a pixel, the new camera as
    believed, and the targets (k, 3), m, with the pixels (k, 2) that are true.
    """

    points: Array
    unit: Array
    believed: CameraModel
    targets: Array
    target_px: Array


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """Keypoints of two pictures, and where those of the first are in the second.

    Attributes
    ----------
    expected
        (n, 2), px; NaN where the second does not show them.
    lines
        (n, 3): epipolar lines, of unit normal, where the place along them is not known well; None elsewhere.
    ground
        None where no pair ranges anything.
    """

    old: Keys
    new: Keys
    expected: Array
    lines: Array | None = None
    ground: Ground | None = None

    def off(self, old: Array, pixels: Array) -> Array:
        """Return how far pixels (k, 2) of the second picture are from where keypoints `old` (k,) are, px.

        With a line that is the distance from it, infinite far from the place and where nothing is shown.
        """
        away = np.hypot(*(pixels - self.expected[old]).T)
        if self.lines is not None:
            a, b, c = self.lines[old].T
            away = np.where(away < AWAY_PX, np.abs(a * pixels[:, 0] + b * pixels[:, 1] + c), np.inf)
        return np.where(np.isfinite(away), away, np.inf)


def rendered_sight(domain: str, seed: int, purpose: Purpose, imagery: Path) -> Iterator[Sight]:
    """Return the stops before and after a pose was lost."""
    trial = Trial(domain, seed, purpose, imagery)
    try:
        before, after = trial.before, trial.pair(0)
        if not len(trial.targets):
            return
        options = ReacquisitionOptions()
        view = halved_pair(view_of(before))
        old, new = (keys_of(halved(pair[0].unit), options.features) for pair in (before, after))
        ranged = find_features(
            view, count=options.features, ratio=options.ratio, row_px=ROW_PX, in_left=(old.pixels, old.sift)
        )
        numbers = numbers_of(ranged.left_px, ranged.descriptors, old)
        expected = put(before[0], ranged.left_px, after[0])[1]
        ground = Ground(
            ranged.points,
            ranged.unit_covariance,
            half_camera(after[0].told),
            trial.targets,
            np.asarray(half_camera(after[0].true).project(trial.targets)),
        )
        yield Sight(old.some(numbers), new, expected, ground=ground)
    finally:
        trial.close()


def numbers_of(pixels: Array, sift: Descriptors, keys: Keys) -> npt.NDArray[np.int64]:
    """Return which keypoints have these pixels (n, 2) and descriptors (n, 128)."""
    known = {
        (*px.tolist(), d.tobytes()): n for n, (px, d) in enumerate(zip(keys.pixels, keys.sift, strict=True))
    }
    told = (known[(*px.tolist(), d.tobytes())] for px, d in zip(pixels, sift, strict=True))
    return np.fromiter(told, np.int64, len(pixels))


def keys_of(image: Grey, most: int) -> Keys:
    """Return the keypoints of an image (rows, columns) as re-acquisition finds them, contrast made even."""
    return find_keys(image, most, even(image))


def photograph_sights(folder: Path) -> Iterator[Sight]:
    """Return the overlapping photographs, both ways."""
    seen, points = photographs(folder)
    keys = {id(one): keys_of(one.image, PHOTOGRAPH_KEYS) for one in seen}
    for one, other in permutations(seen, 2):
        if len(one.pixels.keys() & other.pixels.keys()) >= LEAST_COMMON:
            yield _photographs(one, other, points, keys[id(one)], keys[id(other)])


def _photographs(one: Photograph, other: Photograph, points: Array, old: Keys, new: Keys) -> Sight:
    numbers = np.array(sorted(one.pixels))
    places = np.array([one.pixels[n] for n in numbers.tolist()])
    apart = np.linalg.norm(old.pixels[:, None] - places[None], axis=2)
    near = np.flatnonzero(apart.min(axis=1) < FACE_PX)
    nearest = numbers[apart[near].argmin(axis=1)]
    origin, rays = one.camera.back_project(old.pixels[near])
    normals = {n: face(points, n, one.camera.C) for n in set(nearest.tolist())}
    normal = np.array([normals[n] for n in nearest.tolist()]).reshape(-1, 3)
    away = np.sum((points[nearest] - origin) * normal, axis=1) / np.sum(rays * normal, axis=1)
    expected = np.asarray(other.camera.project(origin + away[:, None] * rays))
    # two points of each sight, either side of the face, span its line in the other picture
    ends = [
        np.asarray(other.camera.project(origin + (share * away)[:, None] * rays)) for share in (0.97, 1.03)
    ]
    across = (ends[1] - ends[0])[:, ::-1] * np.array([1.0, -1.0])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
    lines = np.column_stack((across, -np.sum(across * ends[0], axis=1)))
    columns, rows = other.camera.size
    shown = ((expected > 0) & (expected < (columns, rows))).all(axis=1) & (away > 0)
    expected[~shown] = np.nan
    return Sight(old.some(near), new, expected, lines)


def warped_sights(seed: int, purpose: Purpose, imagery: Path) -> Iterator[Sight]:
    """Return sights of a real picture, turned, zoomed and compressed."""
    for name in PAIRS[purpose]:
        sights = warped_run(name, seed, imagery).sights
        for first, second in zip(sights[::STEP], sights[STEP::STEP], strict=False):
            old, new = (keys_of(s.view.left, ReacquisitionOptions().features) for s in (first, second))
            origin, rays = first.true_left.back_project(old.pixels)
            expected = np.asarray(second.true_left.project(origin + 10.0 * rays))
            columns, rows = second.true_left.size
            expected[~((expected > 0) & (expected < (columns, rows))).all(axis=1)] = np.nan
            yield Sight(old, new, expected)
