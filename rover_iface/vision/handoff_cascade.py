"""The hand-off that tests itself: prior, registration, draped patches, consensus, agreement.

None of the published methods knows when it is wrong. Here the kinematic prior is corrected by registration
(if that is accepted); then dozens of patches round the target are warped from the navcam into the hazcam
image over their own planes and found there; the rigid motion that most of them agree on says where the target
must be, without having looked at it. The target's own patch says the same, or the hand-off is refused. The
patches that agree also tell what the mast and the calibration of its pair are off (`mast_error`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo import PointMatch, PointStereo, point_stereo, triangulate
from rover_iface.frames import Transform
from rover_iface.vision.handoff import Handoff, Side
from rover_iface.vision.shape import ShapeOptions, register
from rover_iface.vision.sift_features import Features
from rover_iface.vision.sift_motion import Motion, find_motion, small_rotation
from rover_iface.vision.template import NccOptions, Template, TemplateMatcher

SIGMA_PX = 0.3


@dataclass(frozen=True, slots=True)
class CascadeOptions:
    """Parameters of the cascade.

    Attributes
    ----------
    patches
        How many patches round the target are looked for.
    reach_m
        How far from the target.
    search_px
        Search round the prediction in the hazcam image: first pass, second pass, the target's own patch.
    least_score
        Correlation below which a patch has not been found.
    least_agree
        Patches without whose agreement nothing is believed.
    many_agree, blind_px, surface_m
        Where the target's own patch is not recognised: patches that must agree, what they may leave open, and
        how far the surface found there may be from where they put it.
    agree_px
        How far consensus and the target's own patch may be apart.
    most_error_px
        Largest stated error that is accepted.
    """

    patches: int = 60
    reach_m: float = 0.35
    search_px: tuple[int, int, int] = (14, 5, 5)
    least_score: float = 0.6
    least_agree: int = 8
    many_agree: int = 10
    blind_px: float = 0.7
    surface_m: float = 0.02
    agree_px: float = 1.5
    most_error_px: float = 2.0


@dataclass(frozen=True, eq=False)
class Answer:
    """A target handed off, or the reasons why not.

    Attributes
    ----------
    pixel
        (2,), in the left hazcam image; NaN when refused.
    position
        (3,), frame of the hazcams.
    error_px
        What the cascade says it may be off: one standard deviation.
    motion
        What the navcams were believed to be off: hazcam frame from navcam frame.
    agreeing, score
        Patches that agree on it, and the correlation of the target's own.
    left_px, right_px, seen
        Those patches: (n, 2) in both navcam images, (n, 4) in both hazcam images.
    """

    pixel: Array
    position: Array
    error_px: float
    motion: Transform
    agreeing: int
    score: float
    left_px: Array
    right_px: Array
    seen: Array
    reasons: tuple[str, ...] = ()

    @property
    def accepted(self) -> bool:
        """Return whether the cascade believes its answer."""
        return not self.reasons


def cascade(given: Handoff, which: str, options: CascadeOptions | None = None) -> Answer:
    """Return the target in the hazcam image from the near or far navcams, or a refusal with its reasons."""
    options = options or CascadeOptions()
    side, pixel = given.source(which)
    match = side.point(pixel)
    if match is None:
        return _refused(Transform.identity(), "the navcam pair does not range the target")
    motion = _registered(side, given.hazcam, match)
    patches = _patches(side, pixel, match, options)
    consensus: Motion | None = None
    pairs: tuple[Features, Features] | None = None
    for search_px in options.search_px[:2]:
        found = _find_all(side, given.hazcam, patches, motion, search_px, options)
        if found is None:
            break
        consensus, *features = found
        pairs = features[0], features[1]
        motion = consensus.new_from_old
    if pairs is None or consensus is None or consensus.inliers < options.least_agree:
        count = 0 if consensus is None else consensus.inliers
        return _refused(motion, f"{count} patches agree; {options.least_agree} are needed")
    return _tested(side, given.hazcam, match, consensus, pairs, options)


@dataclass(frozen=True, slots=True)
class MastError:
    """What the mast and its pair were believed wrongly.

    Attributes
    ----------
    tilt_rad, pan_rad
        Turns about the tilt axis and about the vertical that lead from belief to truth.
    disparity_px
        What all disparities of the pair are off.
    """

    tilt_rad: float
    pan_rad: float
    disparity_px: float


def mast_error(
    side: Side, hazcam: Side, answer: Answer, pivot: npt.ArrayLike, axis: npt.ArrayLike, up: npt.ArrayLike
) -> MastError | None:
    """Return tilt, pan and disparity error of the near navcams that the patches of a hand-off tell.

    Turns about `axis` and `up` (3,) through `pivot` (3,), frame of the cameras. The disparity error is part
    of the fit because a pair that ranges too short looks like a mast that points too low. None without ten
    patches.
    """
    if len(answer.seen) < 10:
        return None
    centre, about = np.asarray(pivot, dtype=np.float64), (np.asarray(axis), np.asarray(up))
    navcam, view = side.view, hazcam.view

    def residual(p: Array) -> Array:
        right = answer.right_px - np.array([p[2], 0.0])
        points = triangulate(navcam.left_camera, navcam.right_camera, answer.left_px, right)[0]
        turn = small_rotation(p[0] * about[0] + p[1] * about[1])
        moved = (points - centre) @ turn.T + centre
        shown = np.hstack((view.left_camera.project(moved), view.right_camera.project(moved)))
        return np.asarray((answer.seen - shown).ravel())

    p, size = np.zeros(3), np.array([1e-4, 1e-4, 0.02])
    for _ in range(12):
        r = residual(p)
        j = np.column_stack([(residual(p + step) - r) / step.sum() for step in np.diag(size)])
        good = np.isfinite(r) & np.isfinite(j).all(axis=1)
        if good.sum() < 12:
            return None
        weight = 1.0 / np.maximum(1.0, np.abs(r[good]) / (1.5 * max(0.2, float(np.median(np.abs(r[good]))))))
        jw = j[good] * weight[:, None]
        step = np.linalg.solve(jw.T @ j[good], -(jw.T @ r[good]))
        p = p + step
        if np.abs(step / size).max() < 0.1:
            break
    return MastError(float(p[0]), float(p[1]), float(p[2]))


def _refused(motion: Transform, *reasons: str) -> Answer:
    nowhere = np.full(2, np.nan)
    none = np.empty((0, 2))
    return Answer(
        nowhere, np.full(3, np.nan), math.inf, motion, 0, 0.0, none, none, np.empty((0, 4)), reasons
    )


def _registered(side: Side, hazcam: Side, match: PointMatch) -> Transform:
    """Return the motion of an accepted registration, or that dead reckoning was right."""
    if side.surface is None or hazcam.surface is None:
        return Transform.identity()
    found = register(side.surface, hazcam.surface, Transform.identity(), match.point, ShapeOptions())
    return found.scene_from_model if found.accepted else Transform.identity()


def _patches(side: Side, pixel: Array, match: PointMatch, options: CascadeOptions) -> list[PointMatch]:
    """Return ranged patches round the target, corners first, the target's own left out."""
    import cv2

    view = side.view
    away = float(np.linalg.norm(match.point - view.left_camera.C))
    reach = options.reach_m * view.left_camera.hs / away
    mask = np.zeros(view.left.shape, np.uint8)
    x0, y0 = pixel
    rows, columns = view.left.shape
    top, left = max(25, int(y0 - reach)), max(25, int(x0 - reach))
    bottom, right = min(rows - 25, int(y0 + reach)), min(columns - 25, int(x0 + reach))
    mask[top:bottom, left:right] = 255
    mask[max(0, int(y0) - 12) : int(y0) + 13, max(0, int(x0) - 12) : int(x0) + 13] = 0
    spacing = max(8.0, 1.1 * reach / math.sqrt(options.patches))
    smooth = cv2.GaussianBlur(view.left, (0, 0), 1.5)
    corners = cv2.goodFeaturesToTrack(smooth, options.patches, 0.005, spacing, mask=mask)
    out = []
    for corner in [] if corners is None else corners.reshape(-1, 2).astype(np.float64):
        found = point_stereo(
            view.left,
            view.right,
            view.left_camera,
            view.right_camera,
            corner,
            expected_range_m=away,
            range_spread=0.35,
        )
        if found is not None and found.score > 0.8:
            out.append(found)
    return out


def _find(
    side: Side, hazcam: Side, patch: PointMatch, motion: Transform, search_px: int
) -> tuple[Array, float] | None:
    """Return where the left hazcam image shows a patch, and its correlation."""
    camera, haz = side.view.left_camera.transformed(motion), hazcam.view.left_camera
    point = np.asarray(motion.apply(patch.point), dtype=np.float64)
    normal = np.asarray(motion.rotate(patch.normal), dtype=np.float64)
    away = float(np.linalg.norm(point - camera.C))
    source = Template(side.view.left, camera, patch.left_px, point, normal, away, 0.0)
    expected = np.asarray(haz.project(point))
    if not np.isfinite(expected).all() or normal @ (haz.C - point) <= 0.2 * np.linalg.norm(haz.C - point):
        return None
    matcher = TemplateMatcher(NccOptions(search_px=search_px, template_px=15, context_px=25, coarse=False))
    template = matcher.predict(source, haz, expected, point)
    if template is None:
        return None
    found = matcher.search(hazcam.view.left, template, expected)
    if found is None or np.abs(found[0] - expected).max() > search_px + 1.0:
        return None
    return found


def _ranged(hazcam: Side, pixel: Array, expected_m: float) -> PointMatch | None:
    view = hazcam.view
    settings = PointStereo(template_px=15, plane_px=19)
    found = point_stereo(
        view.left,
        view.right,
        view.left_camera,
        view.right_camera,
        pixel,
        options=settings,
        expected_range_m=expected_m,
        range_spread=0.3,
    )
    return found if found is not None and found.score > 0.6 else None


def _find_all(
    side: Side,
    hazcam: Side,
    patches: list[PointMatch],
    motion: Transform,
    search_px: int,
    options: CascadeOptions,
) -> tuple[Motion, Features, Features] | None:
    """Return the motion that most patches agree on in both hazcam images, and the patches there and here."""
    here = hazcam.view.left_camera.C
    old, new = [], []
    for patch in patches:
        found = _find(side, hazcam, patch, motion, search_px)
        if found is None or found[1] < options.least_score:
            continue
        expected_m = float(np.linalg.norm(np.asarray(motion.apply(patch.point)) - here))
        ranged = _ranged(hazcam, found[0], expected_m)
        if ranged is not None:
            old.append(patch)
            new.append(ranged)
    if len(old) < 4:
        return None
    there, seen = _features(side, old), _features(hazcam, new)
    motion_found = find_motion(
        there,
        seen,
        np.column_stack((np.arange(len(old)),) * 2).astype(np.int64),
        hazcam.view,
        draws=300,
        inlier_px=1.2,
        sigma_px=SIGMA_PX,
        limit_m=math.inf,
        least=options.least_agree,
        rng=np.random.default_rng(len(old)),
    )
    return None if motion_found is None else (motion_found, there, seen)


def _features(side: Side, matches: list[PointMatch]) -> Features:
    left, right = np.array([m.left_px for m in matches]), np.array([m.right_px for m in matches])
    points, unit = triangulate(side.view.left_camera, side.view.right_camera, left, right, sigma_px=1.0)
    return Features(points, unit, left, right, np.empty((len(left), 0), np.float32))


def _tested(
    side: Side,
    hazcam: Side,
    match: PointMatch,
    consensus: Motion,
    pairs: tuple[Features, Features],
    options: CascadeOptions,
) -> Answer:
    """Return the answer of consensus and own patch together, refused where they disagree."""
    motion, camera = consensus.new_from_old, hazcam.view.left_camera
    unit = triangulate(
        side.view.left_camera, side.view.right_camera, match.left_px[None], match.right_px[None], sigma_px=1.0
    )[1][0]
    place, spread = consensus.at(match.point, SIGMA_PX**2 * unit)
    expected = np.asarray(camera.project(place))
    jacobian = camera.jacobian(place)
    blind = math.sqrt(0.5 * float(np.trace(jacobian @ spread @ jacobian.T)))
    away = float(np.linalg.norm(place - camera.C))
    own = _find(side, hazcam, match, motion, options.search_px[2])
    score = 0.0 if own is None else own[1]
    if own is not None and score >= options.least_score:
        gap = float(np.hypot(*(own[0] - expected)))
        if gap > options.agree_px + 2.0 * blind:
            return _refused(motion, f"consensus and the target's own patch are {gap:.1f} px apart")
        weight = 1.0 / (1.0 + (SIGMA_PX / max(blind, 1e-6)) ** 2)
        pixel = weight * own[0] + (1.0 - weight) * expected
        error = math.hypot(0.5 * gap, math.sqrt(weight) * SIGMA_PX)
        ranged = _ranged(hazcam, pixel, away)
    else:
        # seen too much aslant to be recognised: the surface must be where the consensus has it
        pixel, error, ranged = expected, 1.5 * blind, _ranged(hazcam, expected, away)
        why = f"the target's own patch scores {score:.2f} of {options.least_score}"
        if consensus.inliers < options.many_agree or blind > options.blind_px:
            agree_on = f"{consensus.inliers} patches leave {blind:.1f} px"
            return _refused(motion, f"{why}, and {agree_on} ({options.many_agree}, {options.blind_px} px)")
        off = math.inf if ranged is None else float(np.linalg.norm(ranged.point - place))
        if off > options.surface_m:
            found = "no surface is found" if ranged is None else f"the surface is {100 * off:.1f} cm off"
            return _refused(motion, f"{why}, and {found} at the place")
    if error > options.most_error_px:
        return _refused(motion, f"the error may be {error:.1f} px; {options.most_error_px} is the limit")
    position = place if ranged is None else ranged.point
    there, seen = pairs
    agree = (seen.left_px[:, None] == consensus.pixels[None]).all(axis=2).any(axis=1)
    both = np.hstack((seen.left_px, seen.right_px))[agree]
    return Answer(
        pixel,
        position,
        error,
        motion,
        consensus.inliers,
        score,
        there.left_px[agree],
        there.right_px[agree],
        both,
    )
