"""Where one view stood relative to another: guesses from features and surfaces, made sharp by draped patches.

Registration of surfaces alone is biased where two pairs see different sides of a rock and range it with
different noise: from the mast to the hazcams by up to two centimetres. Their pictures tell the rest, to a
fraction of a pixel (`drape`). Where they share too little, the surfaces must do (`shape.register`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.stereo import PointMatch
from rover_iface.frames import Transform
from rover_iface.vision.drape import (
    SIGMA_PX,
    Draped,
    DrapeOptions,
    drape,
    from_features,
    on_plane,
    range_pixel,
)
from rover_iface.vision.handoff import Side
from rover_iface.vision.shape import Registration, register
from rover_iface.vision.sift_motion import Motion, settle
from rover_iface.vision.surface import ShapeOptions
from rover_iface.vision.tracker import StereoView

BOTH_PX = 2.5
"""Consensus distance of patches in both images of a pair, in units of their expected error of a pixel."""
REGISTRATION = DrapeOptions(patches=40, context_px=15)
RIGHT_SPREAD = 0.08
"""Share of its range within which a pair that ranges rightly has a patch whose place is known."""


def lay(side: Side, scene: Side, pixel: Array, options: DrapeOptions) -> Draped | None:
    """Return the pose of a side's left camera in the frame of `scene`, by patches round what a pixel [2] of
    the side shows.

    Guesses are tried, likeliest first, until enough patches agree on one; None where never four do.
    """
    view = side.view
    if scene.cloud is None:
        return None
    match = side.point(pixel)
    best: Draped | None = None
    for guess in _guesses(side, scene, match, options):
        under = surface_under(scene, view.left_camera.transformed(guess), pixel)
        if under is not None:
            middle = under[0]
        elif match is not None:
            # round a target that the pair does not range there may be patches that it does
            middle = np.asarray(guess.apply(match.point))
        else:
            continue
        if best is not None and _leads_to(best, guess, view.left_camera, options.search_px[-1]):
            continue
        found = drape(view.left, view.left_camera, scene, middle, guess, options)
        if found is not None and (best is None or found.motion.inliers > best.motion.inliers):
            best = found
        if best is not None and best.motion.inliers >= options.enough:
            break
    return best


def _leads_to(found: Draped, guess: Transform, camera: CameraModel, search_px: float) -> bool:
    """Return whether a guess has the patches that agree on a pose where these were found: from there, by the
    same patches, it comes to the same pose.

    `camera` is the side's, as believed; within `search_px` the last pass looks for a patch.
    """
    seen = camera.transformed(guess).project(found.points)
    return bool(np.abs(seen - found.source_px).max() < search_px)


def _guesses(side: Side, scene: Side, match: PointMatch | None, options: DrapeOptions) -> Iterator[Transform]:
    """Yield motions that may put the side right, likeliest first, each worked out when asked for."""

    def features() -> Transform | None:
        return from_features(
            side.picture_features, side.view.left_camera, scene.features, options.least_features
        )

    def surfaces() -> Transform | None:
        if match is None or side.surface is None or scene.surface is None:
            return None
        found = register(side.surface, scene.surface, Transform.identity(), match.point)
        return found.scene_from_model if found.accepted else None

    order: list[Callable[[], Transform | None]] = [surfaces, features]
    if match is not None:
        one, two = (s.view.left_camera for s in (side, scene))
        ray, other = match.point - one.C, match.point - two.C
        away, beyond = float(np.linalg.norm(ray)), float(np.linalg.norm(other))
        finer = (one.hs / away) / (two.hs / beyond)
        along = min(1.0, float(ray @ other) / (away * beyond))
        if math.acos(along) < options.alike_rad and 0.5 < finer < 2.0:
            order.reverse()
    believed: list[Callable[[], Transform | None]] = [Transform.identity]
    for make in believed + order if options.believed_first else order + believed:
        found = make()
        if found is not None:
            yield found


def surface_under(scene: Side, camera: CameraModel, pixel: Array) -> tuple[Array, PointMatch] | None:
    """Return where (3,), m, the ray of a camera's pixel (2,) meets the surface that a pair ranges, and the
    patch there.

    The dense cloud says where to look, point stereo makes it sharp. None where the cloud has a hole or stereo
    does not find the patch again.
    """
    cloud, view = scene.cloud, scene.view
    if cloud is None:
        return None
    with np.errstate(invalid="ignore"):
        off = np.linalg.norm(camera.project(cloud.points) - pixel, axis=1)
    nearest = np.argpartition(off, 12)[:12]
    # the cloud's points are this far apart in the picture
    reach = 3.0 * float(np.median(off[nearest]))
    if not np.isfinite(reach) or reach > 60.0:
        return None
    away = np.linalg.norm(cloud.points[nearest] - camera.C, axis=1)
    front = nearest[away < away.min() + 0.05]
    return surface_at(view, camera, pixel, cloud.points[front[int(np.argmin(off[front]))]])


def surface_at(
    scene: StereoView, camera: CameraModel, pixel: Array, place: Array
) -> tuple[Array, PointMatch] | None:
    """Return where (3,), m, the ray of a camera's pixel (2,) meets the surface that a pair ranges near a
    place (3,), m, and the patch there; None where stereo does not find it again.
    """
    found: PointMatch | None = None
    for _ in range(3):
        at = np.asarray(scene.left_camera.project(place))
        if not np.isfinite(at).all():
            return None
        if found is not None and float(np.hypot(*(at - found.left_px))) < 1.0:
            break
        found = range_pixel(scene, at, float(np.linalg.norm(place - scene.left_camera.C)))
        meets = None if found is None else on_plane(camera, pixel, found)
        if found is None or meets is None:
            return None
        place = meets
    return None if found is None else (place, found)


def ranged_by(side: Side, found: Draped, spread: float = 0.25) -> tuple[npt.NDArray[np.int64], Array]:
    """Return which patches a side's pair ranges too (k,), and where its right image shows those (k, 2).

    They are looked for within a share `spread` of the range that they have.
    """
    kept, right = [], []
    for n, place in enumerate(found.motion.points):
        away = float(np.linalg.norm(place - side.view.left_camera.C))
        match = side.point(found.source_px[n], away, spread)
        if match is not None and match.score > 0.8:
            kept.append(n)
            right.append(match.right_px)
    return np.array(kept, dtype=np.int64), np.array(right).reshape(-1, 2)


def register_views(
    model: Side,
    scene: Side,
    guess: Transform,
    target: npt.ArrayLike,
    shape: ShapeOptions | None = None,
    options: DrapeOptions | None = None,
) -> Registration:
    """Return how `model` lies on `scene`, from a first guess, by patches round `target` (3,), m, of the
    model.

    Both pairs must range rightly: the patches are seen in all four images. Where fewer than `least_agree` of
    them agree the surfaces alone tell, with their tests. In a registration by patches `overlap` is the share
    of them that agree and `spread_m` what they leave open at the target.
    """
    options = options or REGISTRATION
    at = np.asarray(target, dtype=np.float64)
    pixel = np.asarray(model.view.left_camera.project(at))
    side = model.moved(guess)
    found = lay(side, scene, pixel, options) if np.isfinite(pixel).all() else None
    motion = None if found is None else _both(side, found, options)
    if motion is not None and motion.inliers >= options.least_agree:
        total = motion.new_from_old.inverse() * guess
        _, spread = motion.at(np.asarray(total.apply(at)), np.zeros((3, 3)))
        open_m = math.sqrt(float(np.trace(spread)) / 3.0)
        return Registration(total, motion.inliers / motion.matches, 0.0, open_m, 0.0, ())
    if model.surface is None or scene.surface is None:
        return Registration(guess, 0.0, math.inf, math.inf, 1.0, ("one of the pairs gives no surface",))
    return register(model.surface, scene.surface, guess, target, shape)


def _both(side: Side, found: Draped, options: DrapeOptions) -> Motion | None:
    """Return the motion that the patches tell in both images of a side."""
    index, right = ranged_by(side, found, RIGHT_SPREAD)
    if len(index) < options.least_agree:
        return None
    settled = settle(
        found.motion.new_from_old,
        found.points[index],
        found.unit[index],
        np.hstack((found.source_px[index], right)),
        (side.view.left_camera, side.view.right_camera),
        np.ones(len(index), bool),
        inlier_px=BOTH_PX,
        sigma_px=SIGMA_PX,
    )
    return None if settled is None else settled[0]
