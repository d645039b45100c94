"""Where a target is after the rover has lost its pose: by a metre, by 15 degrees, hours later.

What is round a target stays: rocks, pebbles and patches of the ground, in any light. So the pair in which
the target was known is the map. Features that it shares with a new picture say where that was taken from,
without any guess (three points and their pixels, as many as agree). Patches of the old pair, draped over the
surface that it ranged and looked for where that has them, make the pose sharp to a fraction of a pixel
(`drape`). What the target itself looks like has no part in it: its face may be dark now; where it is found,
it tells the range on the line on which that moves it. Whether it is seen is asked of the new pair: what
stands at its pixel must be as far away as the pose has it.

The new picture need not show the target. The pose says where to look for it then, and a second one does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from mission.soltime import SOL_S
from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.stereo import PointMatch, point_stereo
from rover_iface.errors import CameraError, RenderError, TrackerError
from rover_iface.frames import Transform
from rover_iface.vision.drape import SIGMA_PX, DrapeOptions, drape, find_draped, on_plane
from rover_iface.vision.handoff import Side
from rover_iface.vision.learned import descriptor
from rover_iface.vision.resection import resect
from rover_iface.vision.sift_features import (
    Descriptors,
    Detector,
    Features,
    detect,
    find_features,
    mutual,
    none,
)
from rover_iface.vision.sift_motion import Mask, Motion, settle
from rover_iface.vision.spot_range import range_spot
from rover_iface.vision.tracker import Image, StereoView

NEAREST_M, ROW_PX = 1.0, 1.5
"""Least depth that stereo looks for, and how far a match may be from its epipolar line."""
SPOT_OFF_PX = 4.0
"""How far the disparity of the target itself may be off the one expected: the trackers' window of 21 px takes
in what is behind an outline and was up to 2.3 px off there."""
SPOT_SCORE = 0.4
"""Of a spot where noise alone keeps its pixels off one surface 0.33 to 1, at a cost of 2 and less; of planes
through nothing that is there 0.08 (four of 840 points, tuning)."""
ABOUT_PX = 4.0
"""How far round the target the dense cloud proposes ranges: half a block of it. Two of 400 points were ranged
28 px of disparity off by the trackers' window."""
LEAST_SCORE = 0.4
"""Correlation of both images that the trackers' window needs: a face in its own shadow is mostly noise. A
chance match that is no better has the expected range once in ten."""
WIDE_SPREAD = 0.5
"""Share of the range within which the trackers' window looks for something else at the target's place."""
OWN_SEARCH_PX, OWN_CONTEXT_PX, OWN_SCORE, OWN_ACROSS_PX = 5, 25, 0.8, 1.0
"""Search for the target's own patch, the window over which its places are compared, the least correlation,
and how far off the line on which its range may move it: what moved with the light mostly does not."""
OWN_PX, OWN_SIGMAS = 0.5, 3.0
"""Error of its place along that line (13 such on tuning seeds 0 to 7 of the draped domain were 0.34 px off,
rms), and the deviations that it may differ from what the ranges say."""
LIGHT_PX, LIGHT_M = 0.25, 0.001
"""What all patches are off in common after four hours, either axis: shades are on the other side of every
grain. On worlds looked at (tuning seeds 1 to 11, 354615664 to 354615675, own renderer) poses were 0.3 px off,
rms, 1.2 mm at 2 m; the scatter of the patches tells 0.05 to 0.3. A quarter of an hour apart it tells enough
(tuning seeds 0 to 5)."""
LEVEL_RATIO, LEVEL_TRIES = 0.92, 3000
"""Best over second-best descriptor distance of features that need agree only two by two, and how many twos
are tried, those that are most alike in length first."""
LEVEL_M, LEVEL_SHARE, LEVEL_APART_M = 0.25, 0.1, 0.4
"""How far two matches may differ in height and, with a share of it, in distance: what stereo at half scale
errs at 8 m, three deviations. And how far apart they must be to tell a turn."""
AROUND_PX, EVEN_SHARE, EVEN_DARK, EVEN_MOST = 8.0, 0.02, 0.004, 3.0
"""Deviation of the window, pixels of half scale, against which features are detected; a contrast that counts
as noise, as a share of the brightness, which is taken as one of 255 steps at least; and the deviations that
are kept. Under one scale for all of a picture a bright sky left dark ground 6 right matches of 351 features
that were in view; by windows of 8, 16 and 32 px they are 87, 70 and 68 (181691933, draped). On tuning seeds
0 to 2 all are alike. Within 24 px of a sky of eight times its brightness ground keeps few features."""
LookAt = Callable[[Array], StereoView]
"""Takes a pair with the mast pointed at a point (3,), m, in the frame in which the rover believes to be."""


@dataclass(frozen=True, slots=True)
class SecondOpinion:
    """Who is asked for features where SIFT's agree on no pose, or on one that is doubtful.

    Attributes
    ----------
    detector
        Finds and describes them.
    features, ratio
        Strongest features of a picture, and the best over the second-best descriptor distance.
    """

    detector: Detector = descriptor.detect
    features: int = 1000
    ratio: float = 0.885


@dataclass(frozen=True, slots=True)
class ReacquisitionOptions:
    """Parameters of re-acquisition.

    Attributes
    ----------
    lost_m, lost_rad
        How far the rover may be from where it believes to be, and turned about the vertical; a pose that is
        farther off is refused.
    tilt_rad
        How far roll and pitch may be off: the inertial unit has them from gravity.
    aside_rad
        How far to either side of the believed direction the mast looks if nothing is recognised in it.
    features, ratio
        Strongest features of a picture, and the best over the second-best descriptor distance.
    reach_px
        Consensus distance of the draws. Points ranged at half scale at 8 m are 6 cm off, a pixel of it after
        a metre to the side.
    least_features, least_level, many_features
        Features that must agree on a pose (a random one has 4 to 7 of 150), on an upright one (a random one:
        2 to 4), and that tell it without patches.
    least_tried, proof
        Features whose pose is tried though they are too few to be believed, and the patches that must agree
        on it then. Of 321 that stayed wrong by 40 px and more none had more than 24, of right ones none fewer
        than 53 (tuning seeds 0 to 10, 181691933).
    drape
        Those of the patches; they lie round the target.
    second
        The second opinion, if there is one. Its poses are doubtful, however many features agree.
    margin_px
        How far inside a picture the target must lie.
    most_error_px
        Largest stated error that is accepted, one standard deviation.
    sigmas, share
        What the range at the target's pixel may differ from that of the pose: deviations of both, and share
        of the range for a window that is wider than the spot.
    """

    lost_m: float = 1.25
    lost_rad: float = math.radians(19.0)
    tilt_rad: float = math.radians(2.0)
    aside_rad: float = math.radians(36.0)
    features: int = 2500
    ratio: float = 0.85
    reach_px: float = 2.5
    least_features: int = 14
    least_level: int = 8
    many_features: int = 40
    least_tried: int = 5
    proof: int = 40
    drape: DrapeOptions = field(
        default_factory=lambda: DrapeOptions(patches=120, reach_m=3.0, least_agree=18)
    )
    second: SecondOpinion | None = field(default_factory=SecondOpinion)
    margin_px: float = 8.0
    most_error_px: float = 1.0
    sigmas: float = 4.0
    share: float = 0.02


class KnownPair:
    """A pair in which targets are known.

    Its features and its surface are worked out when first asked for; a rover has time for that when it takes
    the pair. Targets that are looked for in one picture share its pose.
    """

    def __init__(self, view: StereoView, options: ReacquisitionOptions | None = None) -> None:
        self.side, self.options = Side(view, NEAREST_M), options or ReacquisitionOptions()
        self._posed: tuple[StereoView, Motion | str] | None = None
        self._posed_again: tuple[StereoView, Motion | str] | None = None

    @cached_property
    def features(self) -> Features:
        """Return the features of the pair at half its scale, ranged.

        They are found in a fifth of the time, and change less with the light.
        """
        return self._features(halved(self.side.view))

    def _features(self, view: StereoView, in_left: tuple[Array, Descriptors] | None = None) -> Features:
        options = self.options
        return find_features(
            view, count=options.features, ratio=options.ratio, row_px=ROW_PX, in_left=in_left
        )

    def prepare(self) -> None:
        """Work out what the next call of `reacquire` may need."""
        _ = self.features, self._second_features, self.side.cloud

    def pose(self, view: StereoView) -> Motion | str:
        """Return the motion that most features agree on, from the frame of what is known to that of a new
        pair's cameras; why not, in words. It is doubtful where they are too few to be believed.
        """
        if self._posed is None or self._posed[0] is not view:
            small = halved(view)
            in_left = detect(small.left, self.options.features)
            found = self._agreed(self.features, small, in_left, self.options.ratio)
            if isinstance(found, str) or found.doubtful:
                found = _surer(found, self._level(small, in_left))
            self._posed = view, found
        return self._posed[1]

    def poses(self, view: StereoView, *, again: bool = True) -> Iterator[Motion | str]:
        """Yield `pose` and, where that is none or a doubtful one that did not do, what the second opinion
        has, if `again`: a doubtful pose as well.
        """
        found, second = self.pose(view), self.options.second
        yield found
        if again and second is not None and (isinstance(found, str) or found.doubtful):
            if self._posed_again is None or self._posed_again[0] is not view:
                self._posed_again = view, self._second(halved(view), second)
            yield self._posed_again[1]

    def _level(self, view: StereoView, in_left: tuple[Array, Descriptors]) -> Motion | str:
        """Return the motion that keeps what is upright so, as most features agree that both pairs range."""
        options, old, new = self.options, self.features, self._features(view, in_left)
        pairs = mutual(old.descriptors, new.descriptors, LEVEL_RATIO)
        one, two = pairs[:, 0], pairs[:, 1]
        guess = level_motion(old.points[one], new.points[two], new.left_px[two], view.left_camera, options)
        settled = None
        if guess is not None:
            settled = settle(
                guess[0],
                old.points[one],
                old.unit_covariance[one],
                new.left_px[two],
                (view.left_camera,),
                guess[1],
                inlier_px=options.reach_px,
                sigma_px=SIGMA_PX,
            )
        return self._judged(settled, "an upright pose", options.least_level, view)

    def _judged(
        self, settled: tuple[Motion, Mask] | None, what: str, least: int, view: StereoView
    ) -> Motion | str:
        """Return a motion that so many features agree on, doubtful if too few; why not, in words."""
        options = self.options
        agree = 0 if settled is None else settled[0].inliers
        if settled is None or agree < options.least_tried:
            return f"{agree} features agree on {what}; {least} are needed"
        return _implausible(settled[0], view, options) or replace(settled[0], doubtful=agree < least)

    def _agreed(
        self, old: Features, view: StereoView, in_left: tuple[Array, Descriptors], ratio: float
    ) -> Motion | str:
        options = self.options
        pixels, descriptors = in_left
        if min(len(pixels), len(old)) < options.least_features:
            return f"{len(old)} and {len(pixels)} features are too few; {options.least_features} are needed"
        pairs = mutual(old.descriptors, descriptors, ratio)
        one, two = pairs[:, 0], pairs[:, 1]
        settled = resect(
            old.points[one],
            old.unit_covariance[one],
            pixels[two],
            view.left_camera,
            reach_px=options.reach_px,
            sigma_px=SIGMA_PX,
        )
        return self._judged(settled, "a pose", options.least_features, view)

    @cached_property
    def _second_features(self) -> Features:
        """Return the features of the pair as the second opinion has them, ranged; none if there is none."""
        second, options = self.options.second, self.options
        if second is None:
            return none()
        return find_features(
            halved(self.side.view),
            count=second.features,
            ratio=options.ratio,
            row_px=ROW_PX,
            detector=second.detector,
        )

    def _second(self, view: StereoView, second: SecondOpinion) -> Motion | str:
        """Return the motion that most features of the second opinion agree on: doubtful, as SIFT has none."""
        in_left = second.detector(view.left, second.features)
        found = self._agreed(self._second_features, view, in_left, second.ratio)
        return found if isinstance(found, str) else replace(found, doubtful=True)


def _surer(one: Motion | str, other: Motion | str) -> Motion | str:
    """Return of two poses, the first doubtful or in words why there is none, that which is believed or has
    more features.
    """
    if isinstance(one, str):
        return f"{one}; {other}" if isinstance(other, str) else other
    return one if isinstance(other, str) or (other.doubtful and other.inliers < one.inliers) else other


def level_motion(
    old: Array, new: Array, seen: Array, camera: CameraModel, options: ReacquisitionOptions
) -> tuple[Transform, npt.NDArray[np.bool_]] | None:
    """Return the turn about the vertical and the shift that most matches agree on, and which (n,).

    Every two matches tell one, so that one right match in twenty will do; three and their pixels alone need
    one in seven.

    Parameters
    ----------
    old, new
        (n, 3), m, the points that match, as each pair ranges them in its own frame.
    seen
        (n, 2), px, where the new left image has them.
    """
    a, b = np.triu_indices(len(old), 1)
    before, after = old[b] - old[a], new[b] - new[a]
    yaw = np.arctan2(
        before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before[:, :2] * after[:, :2]).sum(axis=1)
    )
    long, far = (np.linalg.norm(v[:, :2], axis=1) for v in (before, after))
    alike = np.abs(long - far) < LEVEL_SHARE * np.maximum(long, far) + LEVEL_M
    good = alike & (long > LEVEL_APART_M) & (np.abs(yaw) < options.lost_rad)
    good &= np.abs(before[:, 2] - after[:, 2]) < LEVEL_M
    a, b, yaw, apart = a[good], b[good], yaw[good], np.abs(long - far)[good]
    c, s = np.cos(yaw), np.sin(yaw)
    turns = np.stack((c, -s, 0 * c, s, c, 0 * c, 0 * c, 0 * c, 1 + 0 * c), axis=1).reshape(-1, 3, 3)
    middle = 0.5 * (old[a] + old[b])
    shifts = 0.5 * (new[a] + new[b]) - np.einsum("kij,kj->ki", turns, middle)
    # where the eye would be in the frame of what is known, against where it is believed
    lost = np.einsum("kji,kj->ki", turns, camera.C - shifts) - camera.C
    near = np.flatnonzero((np.linalg.norm(lost, axis=1) < options.lost_m) & (np.abs(lost[:, 2]) < LEVEL_M))
    near = near[np.argsort(apart[near], kind="stable")[:LEVEL_TRIES]]
    if not len(near):
        return None
    moved = np.einsum("kij,nj->kni", turns[near], old) + shifts[near][:, None]
    with np.errstate(invalid="ignore"):
        off = np.abs(camera.project(moved.reshape(-1, 3)).reshape(len(near), -1, 2) - seen).max(axis=2)
        agree = off < 2.0 * options.reach_px
    best = int(agree.sum(axis=1).argmax())
    if int(agree[best].sum()) < 4:
        return None
    return Transform(turns[near[best]], shifts[near[best]]), agree[best]


def halved(view: StereoView) -> StereoView:
    """Return a pair at half its scale, its contrast even."""
    import cv2

    sides = []
    for image, camera in ((view.left, view.left_camera), (view.right, view.right_camera)):
        rows, columns = image.shape[0] // 2, image.shape[1] // 2
        small = cv2.resize(
            image[: 2 * rows, : 2 * columns], (columns, rows), interpolation=cv2.INTER_AREA
        ).astype(np.float32)
        sides.append((even(small), camera.window(0, 0, 2 * columns, 2 * rows).scaled(0.5)))
    (left, left_camera), (right, right_camera) = sides
    return StereoView(left, right, left_camera, right_camera, view.t_s, view.travelled_m)


def even(image: Image) -> Image:
    """Return how far each pixel [rows, columns] is from the mean round it, in deviations of what is there."""
    import cv2

    image = np.nan_to_num(image)
    mean = cv2.GaussianBlur(image, (0, 0), AROUND_PX)
    square = cv2.GaussianBlur(image * image, (0, 0), AROUND_PX) - mean * mean
    spread = np.sqrt(np.maximum(square, 0.0)) + EVEN_SHARE * np.maximum(mean, EVEN_DARK)
    return np.asarray(np.clip((image - mean) / spread, -EVEN_MOST, EVEN_MOST), dtype=np.float32)


@dataclass(frozen=True, eq=False)
class Reacquired:
    """A target that was found again, or why not.

    Attributes
    ----------
    pixel
        (2,) in the left image of `view`; NaN when refused.
    position, covariance
        (3,), m, and (3, 3), m^2, in the frame in which the rover believes to be.
    error_px
        What the pose leaves open of the pixel: one standard deviation.
    motion
        From the frame of what is known to that in which the rover believes to be: what it has lost. Also told
        of a target that is hidden; None where no pose was found.
    view
        The pair that shows it.
    features, agreeing
        Features and patches that agree on the pose.
    """

    pixel: Array
    position: Array
    covariance: Array
    error_px: float
    motion: Motion | None
    view: StereoView | None
    features: int
    agreeing: int
    reasons: tuple[str, ...] = ()

    @property
    def accepted(self) -> bool:
        """Return whether the target was found."""
        return not self.reasons


def reacquire(known: KnownPair, point: Array, look: LookAt) -> Reacquired:
    """Return a target in a picture taken from a pose that is not known, or a refusal with its reasons.

    `point` (3,), m, is the target in the frame in which the pair is known. Where the first picture tells the
    pose and does not show the target, another one is taken towards it; where it tells none, to either side.
    """
    search = searched(known, point)
    try:
        asked = next(search)
        while True:
            asked = search.send(_taken(look, asked))
    except StopIteration as stop:
        found: Reacquired = stop.value
        return found


def searched(known: KnownPair, point: Array) -> Generator[Array, StereoView | None, Reacquired]:
    """Do as `reacquire` does, for a rover whose looks take time: yields each point (3,), m, to take a pair
    towards, and is sent that pair, None where there is none.
    """
    first = yield point
    if first is None:
        return _refused("no picture could be taken")
    eye, why = first.left_camera.C, ""
    for aside in (0.0, known.options.aside_rad, -known.options.aside_rad):
        view: StereoView | None = first
        if aside:
            view = yield eye + Transform.from_rpy(0.0, 0.0, aside).rotate(point - eye)
        if view is None:
            continue
        # most of what is known is in the first: a second opinion on each would take a second and more
        for rough in known.poses(view, again=not aside):
            if isinstance(rough, str):
                why = why or rough
                continue
            there, found = np.asarray(rough.new_from_old.apply(point), dtype=np.float64), None
            if _shown(view, there, known.options.margin_px):
                found = found_in(known, point, view, rough)
                if found.accepted:
                    return found
            if rough.doubtful and (found is None or found.motion is None):
                why = why or f"{rough.inliers} features leave the pose doubtful, and no patches prove it"
                continue
            # at an edge little is seen round it
            again = yield there
            if again is not None and again is not view:
                return found_in(known, point, again, rough)
            if found is not None:
                return found
            return _refused("the place where it must be cannot be looked at", rough.inliers)
    return _refused(why)


def _shown(view: StereoView, point: Array, margin_px: float) -> bool:
    """Return whether both images of a pair hold a point (3,), m: a single one gives no range."""
    sides = (view.left, view.left_camera), (view.right, view.right_camera)
    for image, camera in sides:
        x, y = camera.project(point)
        high, wide = image.shape
        if not (margin_px <= x <= wide - 1 - margin_px and margin_px <= y <= high - 1 - margin_px):
            return False
    return True


def _refused(why: str, features: int = 0, agreeing: int = 0, motion: Motion | None = None) -> Reacquired:
    unknown = np.full((3, 3), np.inf)
    nowhere = np.full(2, np.nan), np.full(3, np.nan), unknown, math.inf
    return Reacquired(*nowhere, motion, None, features, agreeing, (why,))


def _taken(look: LookAt, point: Array) -> StereoView | None:
    try:
        return look(point)
    except (CameraError, RenderError, TrackerError):
        return None


def _implausible(motion: Motion, view: StereoView, options: ReacquisitionOptions) -> str | None:
    """Return in words how a pose is farther off than the rover can have lost it; None where it is not."""
    eye, lost = view.left_camera.C, motion.new_from_old.inverse()
    shift_m = float(np.linalg.norm(lost.apply(eye) - eye))
    turn = np.asarray(lost.rotation, dtype=np.float64)
    yaw, tilt = math.atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1]), math.acos(min(1.0, turn[2, 2]))
    if shift_m > options.lost_m or abs(yaw) > options.lost_rad or tilt > options.tilt_rad:
        return (
            f"the pose would be {shift_m:.2f} m, {math.degrees(yaw):.1f} degrees and a tilt of "
            f"{math.degrees(tilt):.1f} degrees from the believed one"
        )
    return None


def sharpened(known: KnownPair, point: Array, view: StereoView, rough: Motion) -> tuple[Motion, int] | str:
    """Return a rough pose made sharp by patches round a point (3,), m, and how many agree; why not, in words.

    Where few patches agree many features will do; a doubtful pose needs many patches. The motion's covariance
    holds what changed light moves.
    """
    options, side = known.options, known.side
    motion, agreeing = rough, 0
    least = options.proof if rough.doubtful else options.drape.least_agree
    if side.cloud is not None:
        guess = rough.new_from_old.inverse()
        draped = drape(view.left, view.left_camera, side, point, guess, options.drape)
        agreeing = 0 if draped is None else draped.motion.inliers
        if draped is not None and agreeing >= least:
            motion = draped.motion
    if motion is rough and (rough.doubtful or rough.inliers < options.many_features):
        needed = (
            f"{least} patches are needed"
            if rough.doubtful
            else f"{options.many_features} or {least} are needed"
        )
        return f"{rough.inliers} features and {agreeing} patches agree; {needed}"
    return _implausible(motion, view, options) or (_in_light(motion, side.view, view), agreeing)


def _in_light(motion: Motion, known: StereoView, view: StereoView) -> Motion:
    """Return a motion that is as sure as the light allows: what moves all patches alike no residual tells.

    It grows with the angle that the sun has turned by (its chord; four hours are one). Pairs of one time are
    taken as four hours apart: they were given none.
    """
    hours = 24.0 * abs(view.t_s - known.t_s) / SOL_S
    chord = 2.0 * math.sin(math.pi * min(hours, 12.0) / 24.0) if hours else 1.0
    away_m = float(np.linalg.norm(motion.centre - view.left_camera.C))
    light_m = chord * math.hypot(LIGHT_M, LIGHT_PX * away_m / view.left_camera.hs)
    covariance = motion.covariance.copy()
    covariance[3:, 3:] += light_m**2 * np.eye(3)
    return replace(motion, covariance=covariance)


def found_in(known: KnownPair, point: Array, view: StereoView, rough: Motion) -> Reacquired:
    """Return a target (3,), m, in a picture by a rough pose, made sharp by patches round it, or a refusal."""
    sharp = sharpened(known, point, view, rough)
    if isinstance(sharp, str):
        return _refused(sharp, rough.inliers)
    motion, agreeing = sharp
    placed = _placed(known, point, view, motion)
    if isinstance(placed, str):
        return _refused(placed, rough.inliers, agreeing, motion)
    return Reacquired(*placed, motion, view, rough.inliers, agreeing)


def _placed(
    known: KnownPair, point: Array, view: StereoView, motion: Motion
) -> tuple[Array, Array, Array, float] | str:
    """Return the target's pixel (2,) and position (3,) in the new frame, its covariance (3, 3) and what is
    open of the pixel; why not, in words.

    Both pairs range it on the ray on which it is known, each where it sees it.
    """
    options, pair, camera = known.options, known.side.view, view.left_camera
    pixel = np.asarray(pair.left_camera.project(point))
    eye, ray = pair.left_camera.back_project(pixel)
    first = range_spot(pair, pixel, [float(np.linalg.norm(point - eye)), *_about(known, point)], SPOT_OFF_PX)
    if first is None:
        return "the pair in which it is known does not range it"
    near_m = float(np.linalg.norm(first.point - eye))
    there = np.asarray(motion.new_from_old.apply(eye + near_m * ray), dtype=np.float64)
    seen = np.asarray(camera.project(there))
    if not (np.isfinite(seen).all() and view.shows(seen, options.margin_px)):
        return "it is outside the picture"
    standing = pair.left_camera.transformed(motion.new_from_old)
    second = _seen(view, seen, there)
    if second is None:
        return "stereo does not range the surface there"
    met = on_plane(standing, pixel, second)
    far_m, old, new = near_m, _along(pair, first), math.inf
    if met is not None:
        far_m, new = float(np.linalg.norm(met - standing.C)), _along(view, second)
    if abs(far_m - near_m) > options.sigmas * math.hypot(old, new) + options.share * near_m:
        return f"what is seen there is {100 * (far_m - near_m):+.0f} cm farther than it should be"
    share, gap_m = 1.0 / (1.0 + (new / old) ** 2), far_m - near_m
    # pairs that disagree by more than they state err by more than they state (Birge 1932)
    apart = max(1.0, abs(gap_m) / math.hypot(old, new))
    range_m, along = near_m + share * gap_m, apart * old * math.sqrt(1.0 - share)
    range_m, along = _by_own_patch(pair, first, view, motion, range_m, along)
    own = eye + range_m * ray
    position, covariance = motion.at(own, along**2 * np.outer(ray, ray))
    jacobian = camera.jacobian(position)
    error_px = math.sqrt(0.5 * float(np.trace(jacobian @ covariance @ jacobian.T)))
    if error_px > options.most_error_px:
        return f"the error may be {error_px:.1f} px; {options.most_error_px} is the limit"
    return np.asarray(camera.project(position)), position, covariance, error_px


def _about(known: KnownPair, point: Array) -> list[float]:
    """Return the least, the middle and the largest range, m, that the dense cloud has round the pixel of a
    point (3,), as many as there are.
    """
    cloud = known.side.cloud
    if cloud is None:
        return []
    near = np.abs(cloud.pixels - cloud.camera.project(point)).max(axis=1) <= ABOUT_PX
    ranges = np.linalg.norm(cloud.points[near] - cloud.camera.C, axis=1)
    return [] if not len(ranges) else [float(v) for v in np.percentile(ranges, (0, 50, 100))]


def _by_own_patch(
    pair: StereoView, first: PointMatch, view: StereoView, motion: Motion, range_m: float, sigma_m: float
) -> tuple[float, float]:
    """Return the target's range in the pair in which it is known, m, and its error, by where its own patch is
    seen as well; as they were where that tells nothing.

    From a metre to the side the range moves the target's pixel along a line. At an edge disparities of a
    narrow window are off by 0.6 px now and then, 10 cm at 6 m, and their parts agree on it.
    """
    known, standing = pair.left_camera, view.left_camera.transformed(motion.new_from_old.inverse())
    eye, ray = known.back_project(first.left_px)
    source_px = np.asarray(standing.project(first.point))
    found = None
    if np.isfinite(source_px).all():
        found = find_draped(view.left, standing, source_px, pair, first, OWN_SEARCH_PX, OWN_CONTEXT_PX)
    shown = None if found is None or found[1] < OWN_SCORE else on_plane(known, found[0], first)
    if shown is None:
        return range_m, sigma_m
    # the new picture has there what is beside the target: that is as far to the other side
    off_px = source_px - np.asarray(standing.project(shown))
    line = standing.jacobian(first.point) @ ray
    px_per_m = float(np.hypot(*line))
    along_px = float(off_px @ line) / px_per_m
    across_px = math.sqrt(max(0.0, float(off_px @ off_px) - along_px**2))
    gap_m = float(np.linalg.norm(first.point - eye)) + along_px / px_per_m - range_m
    open_m = OWN_PX / px_per_m
    if across_px > OWN_ACROSS_PX or abs(gap_m) > OWN_SIGMAS * math.hypot(sigma_m, open_m):
        return range_m, sigma_m
    share = 1.0 / (1.0 + (open_m / sigma_m) ** 2)
    return range_m + share * gap_m, sigma_m * math.sqrt(1.0 - share)


def _seen(view: StereoView, pixel: Array, point: Array) -> PointMatch | None:
    """Return the surface that a pair has at a pixel (2,) where a point (3,) should be; None where it has
    another one, or none that can be told.

    A wide window looks for it from far and near, and what it finds is asked besides what is expected.
    """
    camera, away = view.left_camera, float(np.linalg.norm(point - view.left_camera.C))
    wide = point_stereo(
        view.left,
        view.right,
        camera,
        view.right_camera,
        pixel,
        expected_range_m=away,
        range_spread=WIDE_SPREAD,
    )
    clear = wide is not None and wide.score >= LEAST_SCORE
    beside = [float(np.linalg.norm(wide.point - camera.C))] if wide is not None and clear else []
    found = range_spot(view, pixel, [away, *beside], SPOT_OFF_PX)
    if found is None or not (clear or found.score >= SPOT_SCORE):
        return None
    px_m = camera.hs * float(np.linalg.norm(view.right_camera.C - camera.C))
    off_px = abs(px_m / float(np.linalg.norm(found.point - camera.C)) - px_m / away)
    return found if off_px <= SPOT_OFF_PX else None


def _along(view: StereoView, match: PointMatch) -> float:
    """Return what the range of a match errs, metres."""
    ray = match.point - view.left_camera.C
    return math.sqrt(float(ray @ match.surface_covariance @ ray) / float(ray @ ray))
