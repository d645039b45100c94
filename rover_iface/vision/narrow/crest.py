"""What the error of a pixel leaves open of a target: at a crest, centimetres along the line of sight.

A pair ranges the surface under a pixel to millimetres, whichever pixel that is. On an outline the next one
shows ground that lies far deeper, so a place is known no better along the line of sight than the surface
round its pixel is deep, within what the pixel may be off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.vision.handoff import STEP, Side
from rover_iface.vision.handoff_cascade import ONE_SURFACE_M, RANGE_PX, Answer
from rover_iface.vision.narrow.references import Kept
from rover_iface.vision.shape_draped import surface_under
from rover_iface.vision.tracker import StereoView

LEAST_PX = 0.75 * STEP
"""Least deviation of a pixel over which the depth is weighed: nearer than that a cloud has no two points."""
REACH, LEAST_POINTS = 4.0, 4
"""Deviations of the pixel within which points count, and how many of them tell something."""
ASIDE = 0.5
"""Share of the depth's projection across the line of sight that a target is off: its own patch takes out the
rest. Of 214 answers from within 3.5 m on 18 looked-at days (121977352, 398055031, 473728539; training seeds
117438 to 856123) one lay 3.9 deviations across without it; by likelihood 0.3 to 0.5. Along the line of sight
five lay over three deviations off, 6.1 at most, without the depth; with it none over 1.6."""
EDGE_PX, EDGE_POINTS = 2.5, 2
"""How near to the pixel of a narrow picture nothing may lie that is nearer by more than `ONE_SURFACE_M`, and
how many points of the new pair's cloud say that something does. On 25774355 (looked at) a target began on a
stone before a rock whose face its pixel touched; from the side three answers of 57 to 77 patches and own ones
of 0.61 to 0.66 had it on the rock, 12 cm aside, with 6, 12 and 26 such points. Of 112 other answers of narrow
pairs (14 looked-at days) one had any: one point, of a target that was hidden."""
ROUND = 8
"""Directions in which a kept pixel is moved to see what else it may show."""
SAME_SIGMAS = 3.0
"""Deviations that answers of two pairs may be apart, the better known of which is then taken."""


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """What a kept pair says of a target in a new one.

    Attributes
    ----------
    answer
        Where it has the target.
    eye
        (3,), m, of the new pair's left camera.
    across_m, deep_m
        What it leaves open across the line of sight from there, in each direction, and along it besides: one
        standard deviation, m.
    """

    answer: Answer
    eye: Array
    across_m: float
    deep_m: float

    @classmethod
    def of(cls, answer: Answer, kept: Kept, side: Side, standing: CameraModel) -> Shown:
        """Return what an answer leaves open in a new pair: the error of the kept pixel and its own.

        Within that the surface may lie deeper or nearer, and the kept pair's line of sight meets it elsewhere
        then: beside the target, as far as it differs from the line of sight of the new pair. What is a crest
        for the kept pair, `standing` where it stood, may be a plain face for the new one.
        """
        camera = side.view.left_camera
        away = float(np.linalg.norm(answer.position - camera.C))
        sigma_m = math.hypot(answer.error_px * away / camera.hs, kept.sigma_m)
        deep_m = open_depth_m(side, answer.pixel, away, sigma_m * camera.hs / away)
        turned_rad = kept.turned_rad(camera.C, answer.position)
        along_m = open_along_m(side, standing, kept.pixel, answer.position, kept.sigma_m)
        # A surface that is ranged too far is met too far as well: of 32 pairs tied from over 3.4 m on 20 days
        # (some looked at) the kept lines of sight met it off by 1.2 deviations without that (root mean
        # square), 4.0 at most, by 0.9 and 2.7 with it.
        ranged_m = math.hypot(deep_m, range_error_m(side.view, away))
        aside_m = max(beside_m(ranged_m, turned_rad), along_m * math.sin(turned_rad))
        return cls(answer, camera.C, math.hypot(sigma_m, aside_m), deep_m)

    @property
    def away_m(self) -> float:
        """Return the range of the target from the new pair."""
        return float(np.linalg.norm(self.answer.position - self.eye))

    @property
    def covariance(self) -> Array:
        """Return the covariance (3, 3), m^2, of the target."""
        ray = (self.answer.position - self.eye) / self.away_m
        return np.asarray(self.across_m**2 * np.eye(3) + self.deep_m**2 * np.outer(ray, ray))

    def same_spot(self, other: Shown) -> bool:
        """Return whether two answers have a target at one place."""
        apart_m = float(np.linalg.norm(self.answer.position - other.answer.position))
        return apart_m <= SAME_SIGMAS * math.hypot(self.across_m, self.deep_m, other.across_m, other.deep_m)


def open_depth_m(side: Side, pixel: Array, away_m: float, off_px: float) -> float:
    """Return how far what a pair ranges lies from a range, m, over the pixels that a target may be at.

    One standard deviation, in metres along the line of sight, without what the ranges err by themselves; 0
    where the pair ranges next to nothing there.

    Parameters
    ----------
    pixel
        (2,), where the target is taken to be in the left image.
    away_m
        Its range there from the left camera, metres.
    off_px
        What the pixel may be off in each direction, one standard deviation.
    """
    cloud, camera = side.cloud, side.view.left_camera
    if cloud is None:
        return 0.0
    off_px = max(LEAST_PX, off_px)
    with np.errstate(invalid="ignore"):
        beside = np.hypot(*(np.asarray(camera.project(cloud.points)) - pixel).T) / off_px
        near = beside < REACH
    if np.count_nonzero(near) < LEAST_POINTS:
        return 0.0
    weight = np.exp(-0.5 * beside[near] ** 2)
    deep = np.linalg.norm(cloud.points[near] - camera.C, axis=1) - away_m
    # an answer that took what lies deeper still is refused: the two pairs would have two surfaces
    deep = np.clip(deep, -ONE_SURFACE_M, ONE_SURFACE_M)
    squared = float(weight @ deep**2) / float(weight.sum()) - range_error_m(side.view, away_m) ** 2
    return math.sqrt(max(0.0, squared))


def open_along_m(side: Side, standing: CameraModel, pixel: Array, place: Array, sigma_m: float) -> float:
    """Return how far a kept picture's line of sight leaves open where it meets the surface, m.

    One standard deviation, in metres along that line, of where the error of the kept pixel has it meet the
    surface that a new pair ranges; 0 where that has none.

    Parameters
    ----------
    side
        The new pair, which ranges the surface.
    standing, pixel
        Camera of the kept picture where it stood, and the target's pixel (2,) in it.
    place
        (3,), m, that the answer has it at.
    sigma_m
        What the kept pixel is off across its line of sight in each direction, one standard deviation.
    """
    sight = place - standing.C
    away_m = float(np.linalg.norm(sight))
    # on a circle of so many deviations each direction has a variance of one
    radius_px = math.sqrt(2.0) * sigma_m * standing.hs / away_m
    squared = []
    for angle in np.arange(ROUND) * (math.tau / ROUND):
        beside = pixel + radius_px * np.array([math.cos(angle), math.sin(angle)])
        found = surface_under(side, standing, beside)
        if found is None:
            continue
        along_m = float((found[0] - place) @ sight) / away_m
        # an answer that took what lies farther off still is refused: the two pairs would have two surfaces
        if abs(along_m) <= ONE_SURFACE_M:
            squared.append(along_m**2)
    if not squared:
        return 0.0
    noise_m = range_error_m(side.view, float(np.linalg.norm(place - side.view.left_camera.C)))
    return math.sqrt(max(0.0, sum(squared) / len(squared) - noise_m**2))


def edge_before(side: Side, standing: CameraModel, pixel: Array, place: Array) -> bool:
    """Return whether the line of sight to a place passes so near to something before it that its pixel may be
    of that.

    Parameters
    ----------
    side
        The new pair, whose cloud tells.
    standing, pixel
        Camera of the kept picture where it stood, and the target's pixel (2,) in it.
    place
        (3,), m, that the answer has it at.
    """
    if side.cloud is None:
        return False
    points = side.cloud.points
    with np.errstate(invalid="ignore"):
        beside = np.hypot(*(np.asarray(standing.project(points)) - pixel).T) < EDGE_PX
    before = np.linalg.norm(place - standing.C) - np.linalg.norm(points - standing.C, axis=1) > ONE_SURFACE_M
    return bool(np.count_nonzero(beside & before) >= EDGE_POINTS)


def range_error_m(view: StereoView, away_m: float) -> float:
    """Return what the range of a patch errs in a pair, m, one standard deviation."""
    baseline_m = float(np.linalg.norm(view.right_camera.C - view.left_camera.C))
    return RANGE_PX * away_m**2 / (view.left_camera.hs * baseline_m)


def beside_m(deep_m: float, turned_rad: float) -> float:
    """Return how far beside a target, m, a line of sight that is turned by an angle meets its surface.

    `deep_m` is how far the surface may lie deeper or nearer; all are standard deviations.
    """
    return ASIDE * deep_m * math.sin(turned_rad)
