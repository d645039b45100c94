"""The hand-off that tests itself: guess, draped patches, consensus, agreement.

None of the published methods knows when it is wrong. Here a guess of where the navcam stood (features that
both pictures share; registration, if that is accepted; the kinematic prior) is made sharp by dozens of
patches round the target: the navcam's picture, draped over the surface that the hazcams range, is found in
the hazcam image, and the pose that most of them agree on says where the target must be, without having looked
at it. The target's own patch says the same, or the hand-off is refused. The navcam pair may range wrongly:
its left picture finds the pose, and what its disparities are off is told by the patches before its stereo is
believed. They also tell what the mast is off (`studies.common.mast_error`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.stereo import PointMatch, triangulate
from rover_iface.frames import Transform
from rover_iface.vision.drape import SIGMA_PX, Draped, DrapeOptions, find_draped, on_plane, range_pixel
from rover_iface.vision.handoff import Handoff, Side
from rover_iface.vision.shape_draped import lay, ranged_by, surface_at, surface_under
from rover_iface.vision.tracker import StereoView

RANGE_PX = 0.15
"""Error of a patch's disparity in the hazcams."""
ONE_RANGE = 3.0
"""Errors of a range up to which two looks have a surface at one range, besides what pairs may disagree by."""
ONE_SURFACE_M = 0.04
"""How far apart the two pairs may have the target's surface besides by what they err: beside an outline the
stereo of one pair has the rock and its picture the ground behind. On a day looked at (72607405) that was 6.8
cm deeper, by 132 patches and the target's own; right answers of days looked at (211, 72607405, 72607406) were
up to 2.8 cm apart. Their windows hold 3 cm, so that a face at 45 degrees is as deep."""

OWN_SPREADS = 4.0
"""Times what its alignment tells that the target's own patch is taken to be off: of 16 that were recognised
and aligned on 968124549 (looked at) nine lay farther from consensus than that, along their worse direction.
One in the shade was found 2.9 px along an outline, told as 0.6, and outweighed consensus, 0.2 px off."""
WHOLE_PX = 0.5
"""Error of an own patch that was found to a whole pixel and could not be aligned."""


@dataclass(frozen=True, slots=True)
class CascadeOptions:
    """Parameters of the cascade.

    Attributes
    ----------
    drape
        Those of the patches.
    many_agree, blind_px, surface_m
        Where the target's own patch is not recognised: patches that must agree, what they may leave open, and
        how far off the navcams' own stereo, freed of what its disparities are off, may have the surface.
    own_score
        Correlation below which the target's own patch is not recognised.
    agree_px
        How far consensus and the target's own patch may be apart.
    overrule
        Patches that overrule the target's own where it is found elsewhere, as the border of a shadow is that
        has moved since; None if such a target is refused.
    most_error_px
        Largest stated error that is accepted.
    """

    drape: DrapeOptions = field(default_factory=DrapeOptions)
    many_agree: int = 10
    blind_px: float = 0.7
    surface_m: float = 0.02
    own_score: float = 0.45
    agree_px: float = 1.5
    overrule: int | None = None
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
        Those patches that the navcam pair ranges too: (n, 2) in both navcam images, (n, 4) in both hazcam
        images.
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
    best = lay(side, given.hazcam, pixel, options.drape)
    if best is None or best.motion.inliers < options.drape.least_agree:
        count = 0 if best is None else best.motion.inliers
        why = f"{count} patches agree; {options.drape.least_agree} are needed"
        if surface_under(given.hazcam, side.view.left_camera, pixel) is None:
            why = "missing stereo: the hazcams do not range the surface where the target should be"
        return _refused(Transform.identity(), why)
    return _tested(side, given.hazcam, pixel, best, options)


def _refused(motion: Transform, *reasons: str) -> Answer:
    nowhere = np.full(2, np.nan)
    none = np.empty((0, 2))
    return Answer(
        nowhere, np.full(3, np.nan), math.inf, motion, 0, 0.0, none, none, np.empty((0, 4)), reasons
    )


def _tested(side: Side, hazcam: Side, pixel: Array, found: Draped, options: CascadeOptions) -> Answer:
    """Return the answer of consensus and own patch together, refused where they disagree."""
    motion, scene = found.scene_from_source, hazcam.view
    standing, camera = side.view.left_camera.transformed(motion), scene.left_camera
    index, right = ranged_by(side, found)
    told = _told(side, standing, pixel, found, index, right)
    under = _under(hazcam, standing, pixel, told)
    if under is None:
        return _refused(motion, "missing stereo: the hazcams do not range the surface there")
    place = _placed(standing, pixel, under, scene, found, told)
    expected = np.asarray(camera.project(place.point))
    patch = replace(under[1], point=place.point, left_px=expected)
    blind = place.open_px(camera)
    own = find_draped(
        side.view.left, standing, pixel, scene, patch, options.drape.search_px[-1], options.drape.context_px
    )
    score = 0.0 if own is None else own[1]
    why = f"the target's own patch scores {score:.2f} of {options.own_score}"
    gap = 0.0 if own is None else float(np.hypot(*(own[0] - expected)))
    recognised = own is not None and score >= options.own_score
    if recognised and gap > options.agree_px + 2.0 * blind:
        why = f"consensus and the target's own patch are {gap:.1f} px apart"
        if options.overrule is None or found.motion.inliers < options.overrule:
            return _refused(motion, why)
        recognised = False
    if own is not None and recognised:
        at, left_px = _joined(expected, place.seen(camera), own)
        error = math.hypot(0.5 * gap, left_px)
    else:
        # not to be recognised: both pairs must see the surface, and have it in one place
        at, error = expected, 1.5 * blind
        if own is None:
            return _refused(motion, f"{why}: one of the pictures sees its surface too flat, or not at all")
        if found.motion.inliers < options.many_agree or blind > options.blind_px:
            agree_on = f"{found.motion.inliers} patches leave {blind:.1f} px"
            return _refused(motion, f"{why}, and {agree_on} ({options.many_agree}, {options.blind_px} px)")
        if not place.gap_m <= options.surface_m:
            has = f"has it {100 * place.gap_m:.1f} cm away" if told is not None else "does not tell"
            return _refused(motion, f"{why}, and the navcams' stereo {has}")
    if place.two_surfaces:
        return _refused(motion, f"the two pairs have its surface {100 * place.gap_m:.1f} cm apart")
    if error > options.most_error_px:
        return _refused(motion, f"the error may be {error:.1f} px; {options.most_error_px} is the limit")
    away = float(np.linalg.norm(place.point - camera.C))
    again = range_pixel(scene, at, away)
    position = place.point if again is None else again.point
    apart_m = abs(float(np.linalg.norm(position - camera.C)) - away)
    if apart_m > options.surface_m + ONE_RANGE * float(
        np.linalg.norm(_lifted(patch, scene).point - patch.point)
    ):
        # what it is asked for is one pixel beside what it found: an edge, or a pattern that repeats itself
        return _refused(motion, f"the hazcams have its surface at two ranges, {100 * apart_m:.1f} cm apart")
    return Answer(
        at,
        position,
        error,
        motion,
        found.motion.inliers,
        score,
        found.source_px[index],
        right,
        found.seen[index],
    )


def _joined(expected: Array, consensus: Array, own: tuple[Array, float, Array]) -> tuple[Array, float]:
    """Return the pixel (2,) that consensus and the target's own patch have together, and what they leave
    open, px: each counts in each direction by what it knows.

    Along one border, of a shadow or an outline, the own patch is found anywhere; there consensus has it.
    """
    pixel, _, spread = own
    aligned = bool(np.isfinite(spread).all())
    known = SIGMA_PX**2 * np.eye(2) + OWN_SPREADS**2 * spread if aligned else WHOLE_PX**2 * np.eye(2)
    share = np.linalg.solve(consensus + known, consensus).T
    return expected + share @ (pixel - expected), math.sqrt(0.5 * float(np.trace(share @ known)))


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """Where the target is on its ray (3,), m, the covariance of that (3, 3), m^2, how far apart the two pairs
    have it, and how far they do by chance: both are infinite where only one of them tells.
    """

    point: Array
    covariance: Array
    gap_m: float
    chance_m: float

    @property
    def two_surfaces(self) -> bool:
        """Return whether the pairs tell of two surfaces: nobody knows which of them is meant."""
        return self.gap_m > math.hypot(ONE_SURFACE_M, self.chance_m)

    def open_px(self, camera: CameraModel) -> float:
        """Return what the covariance leaves open of the target in a camera's picture, pixels."""
        return math.sqrt(0.5 * float(np.trace(self.seen(camera))))

    def seen(self, camera: CameraModel) -> Array:
        """Return the covariance (2, 2), px^2, of the target in a camera's picture."""
        there = camera.jacobian(self.point)
        return np.asarray(there @ self.covariance @ there.T)


@dataclass(frozen=True, slots=True, eq=False)
class _Told:
    """Where the navcams' own stereo has the target (3,), m, frame of the hazcams, and its error along the
    ray, m.
    """

    point: Array
    sigma_m: float


def _told(
    side: Side,
    standing: CameraModel,
    pixel: Array,
    found: Draped,
    index: npt.NDArray[np.int64],
    right: Array,
) -> _Told | None:
    """Return the target by the navcams' stereo; what their disparities are off is taken from the agreeing
    patches first. None where it is not found or too few tell.
    """
    own = side.point(pixel)
    if own is None or len(index) < 6:
        return None
    other = side.view.right_camera.transformed(found.scene_from_source)
    wrong = np.median(right - other.project(found.points[index]), axis=0)
    point = triangulate(standing, other, pixel[None], (own.right_px - wrong)[None])[0][0]
    away = float(np.linalg.norm(point - standing.C))
    return _Told(point, RANGE_PX * away**2 / (standing.hs * float(np.linalg.norm(other.C - standing.C))))


def _under(
    hazcam: Side, standing: CameraModel, pixel: Array, told: _Told | None
) -> tuple[Array, PointMatch] | None:
    """Return the surface under a pixel as the hazcams range it: along a ray that passes an edge there are two
    that it may meet, and the navcams' stereo says which.
    """
    first = surface_under(hazcam, standing, pixel)
    if told is None:
        return first
    second = surface_at(hazcam.view, standing, pixel, told.point)
    both = [found for found in (first, second) if found is not None]
    return min(both, key=lambda found: float(np.linalg.norm(found[0] - told.point)), default=None)


def _placed(
    standing: CameraModel,
    pixel: Array,
    under: tuple[Array, PointMatch],
    scene: StereoView,
    found: Draped,
    told: _Told | None,
) -> _Place:
    """Return the target's place by the hazcams' surface and the navcams' stereo, by what each can know.

    Where the two contradict each other by more than chance allows the hazcams are believed.
    """
    place, patch = under
    origin, ray = standing.back_project(pixel)
    met = on_plane(standing, pixel, _lifted(patch, scene))
    assert met is not None  # the ray met a plane of the same slope
    lift = float(np.linalg.norm(met - place))
    # a pose that is off by d moves the place along the ray by tilt @ d: more than itself on a slant
    tilt = patch.normal / float(patch.normal @ ray)
    turn = found.scene_from_source.rotation
    pose = turn @ found.motion.at(place, np.zeros((3, 3)))[1] @ turn.T

    def spread(share: float, noise: float) -> Array:
        """Return the covariance of a place a share of the distance nearer to that of the navcams' stereo."""
        moved = np.eye(3) - (1.0 - share) * np.outer(ray, tilt)
        along2 = (share * noise) ** 2 + ((1.0 - share) * lift) ** 2
        return np.asarray(moved @ pose @ moved.T + along2 * np.outer(ray, ray))

    if told is None:
        return _Place(place, spread(0.0, 0.0), math.inf, math.inf)
    gap, noise = float((told.point - place) @ ray), told.sigma_m
    chance = ONE_RANGE * math.sqrt(lift**2 + noise**2 + float(tilt @ pose @ tilt))
    if not abs(gap) < chance:
        return _Place(place, spread(0.0, 0.0), abs(gap), chance)
    # a pose that is off along the ray does not move where that meets the surface
    surface2 = lift**2 + float((tilt - ray) @ pose @ (tilt - ray))
    share = surface2 / (surface2 + noise**2 + float(ray @ pose @ ray))
    along = float((place - origin) @ ray) + share * gap
    return _Place(np.asarray(origin + along * ray), spread(share, noise), abs(gap), chance)


def _lifted(patch: PointMatch, scene: StereoView) -> PointMatch:
    """Return a patch brought nearer to the pair by what its stereo may be off."""
    camera = scene.left_camera
    ray = patch.point - camera.C
    away = float(np.linalg.norm(ray))
    baseline = float(np.linalg.norm(scene.right_camera.C - camera.C))
    return replace(patch, point=patch.point - RANGE_PX * away / (camera.hs * baseline) * ray)
