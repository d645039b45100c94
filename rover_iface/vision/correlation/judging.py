"""What speaks for and against a match: its range, its texture, its surroundings, its place.

Each figure is checked against a limit, and has a margin to it: the tracker believes a match that
passes them all, and is as sure of it as the least margin allows. Kim et al. 2009, section 4.5, have four
criteria (correlation, stereo score, range, position); surroundings, identity and the place where a target is
expected are ours, and tell one stone from another.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo import PointMatch
from rover_iface.vision.correlation.carried import Carried
from rover_iface.vision.correlation.gallery import Gallery
from rover_iface.vision.template import AS_GOOD, NccOptions, Template, TemplateMatcher
from rover_iface.vision.tracker import StereoView, TrackUpdate

ROUGHEST = 3.0
"""Range errors up to which the parts of a match may disagree and still widen its tolerance. By hand: parts on
one face agree within its slant, and half a template across an edge is not a place to trust."""
ASTRAY = 16.27
"""Squared distance, in deviations, of a match from where its target was expected, over which it is another
spot: 99.9 % of chi square with three degrees of freedom."""
NEAR_PX = 12
"""How near to where it is expected a target lies: two deviations of what the mast and dead reckoning err
over a step (3 % of 0.8 m and 0.3 degrees of heading at 8 m)."""
SAME_PX = 4.0
"""Matches nearer to each other than this are of one place: what the search keeps peaks apart by."""
TAILS = 2.0
"""Times its usual error that a place may be expected beside: a rover that climbs slips by a third of its
way."""


@dataclass(slots=True)
class Followed:
    """What is remembered of a target: its views, its last answer, where it was designated."""

    first: Template
    last: Template
    gallery: Gallery
    update: TrackUpdate
    start_point: Array
    start_range_m: float
    start_depth_m2: float
    start_travel_m: float
    travelled_m: float
    normal_weight: float
    misses: int = 0
    watched: StereoView | None = None  # the last view whose errors were checked
    put: bool = False  # another look has told since where it is, better than the first view does
    doubted: bool = False  # it was lost, and none of the views in which it was designated has shown it since
    expected: tuple[Array, Array] | None = None  # where the next look should have it, and its covariance
    alike: float = 1.0  # how well what is ranged at its place agreed with it when that was last asked
    carried: Carried | None = None  # where a lost one is by what lies round it

    @property
    def believed(self) -> Array:
        """Where the target is believed to be (3,): once it is lost, as the rover was told, or by what lies
        round it.
        """
        if not self.misses:
            return self.last.point
        if self.expected is not None:
            return self.expected[0]
        return self.last.point if self.carried is None else self.carried.point


@dataclass(slots=True)
class Judgement:
    """What speaks for and against a match: figures, margins to the limits, the limits that were passed.

    `alike` is the margin by which its texture is that of the target.
    """

    scores: dict[str, float] = field(default_factory=dict)
    margins: list[float] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    alike: float = 0.0

    def limit(self, margin: float, reason: str) -> None:
        """Take a margin, 1 at perfect; below 0 the match is not believed for the reason given."""
        self.margins.append(margin)
        if margin < 0.0:
            self.reasons.append(reason)

    @property
    def confidence(self) -> float:
        """Return the least margin through a logistic curve: 0.5 at a limit."""
        least = max(-2.0, min(1.0, *self.margins, 1.0))
        return 1.0 / (1.0 + math.exp(-6.0 * least))


class MatchJudge:
    """Holds the matches of targets that are followed against their limits."""

    def __init__(self, options: NccOptions, matcher: TemplateMatcher) -> None:
        self.options, self.matcher = options, matcher
        self._near = TemplateMatcher(replace(options, search_px=min(NEAR_PX, options.search_px)))

    def surroundings(self, track: Followed, view: StereoView, match: PointMatch, judged: Judgement) -> None:
        """Hold what lies round the match against what lay round the target: the neighbours tell stones apart.

        A target that was lost must agree with both templates that are left of it.
        """
        sources = [track.last]
        if track.misses:
            best = track.gallery.best(view.left_camera, match.point, match.normal)
            sources += [kept.template for kept in best if kept.template is not track.last][:1]
        seen = [self.matcher.surroundings(source, view, match.left_px, match.point) for source in sources]
        known = [score for score in seen if score is not None]
        if not known:
            if track.misses:
                judged.limit(-1.0, "its surroundings are out of the picture: no telling which stone it is")
            return
        score = judged.scores["surroundings"] = min(known)
        limit = self.options.surroundings_limit
        judged.limit((score - limit) / (1.0 - limit), f"its surroundings agree by {score:.2f}, below {limit}")

    def where_expected(self, track: Followed, view: StereoView, match: PointMatch, judged: Judgement) -> None:
        """Ask whether the place where a target is expected looks more like it than a match farther off.

        In another light a target may correlate just below the limit at its own place, and the best match of
        a wide search then lies on another spot of the rock.
        """
        camera, last = view.left_camera, track.last
        prediction = camera.project(track.believed)
        if float(np.hypot(*(match.left_px - prediction))) <= self._near.options.search_px:
            return
        template = self._near.predict(last, camera, prediction, track.believed)
        found = None if template is None else self._near.search(view.left, template, prediction)
        if found is None or float(np.hypot(*(found.pixel - match.left_px))) < SAME_PX:
            return
        eye, ray = camera.back_project(found.pixel)
        place = eye + float(np.linalg.norm(track.believed - camera.C)) * ray
        round_it = self.matcher.surroundings(last, view, found.pixel, np.asarray(place))
        if round_it is None or not {"ncc", "surroundings"} <= judged.scores.keys():
            return
        there, here = found.score + round_it, judged.scores["ncc"] + judged.scores["surroundings"]
        judged.scores["where_expected"] = there
        judged.limit(
            here - there - 2.0 * AS_GOOD,
            f"where it is expected correlation and surroundings are {there:.2f} in all, here {here:.2f}",
        )

    def identity(self, track: Followed, view: StereoView, match: PointMatch, judged: Judgement) -> None:
        """Hold texture, surroundings, range and place together: another stone may pass each by a hair."""
        options, scores = self.options, judged.scores
        near = 1.0 - abs(scores["range_correction_m"]) / scores["range_tolerance_m"]
        # three deviations off is where the margin ends; a rover may be turned farther than it knows
        off_px = float(np.hypot(*(match.left_px - view.left_camera.project(track.believed))))
        aside = max(-1.0, 1.0 - off_px / (1.5 * NEAR_PX))
        limit = options.surroundings_limit
        round_it = (scores.get("surroundings", limit) - limit) / (1.0 - limit)
        identity = scores["identity"] = (near + aside + judged.alike + round_it) / 4.0
        judged.limit(
            (identity - options.identity_limit) / (1.0 - options.identity_limit),
            f"texture, surroundings, range and place give {identity:.2f}, below {options.identity_limit}",
        )

    def position(
        self, track: Followed, view: StereoView, match: PointMatch, distance: float, judged: Judgement
    ) -> None:
        """Hold stereo score, range and position against their limits (second to fourth criterion)."""
        options, scores = self.options, judged.scores
        scores["stereo"] = match.score
        judged.limit(
            (match.score - options.stereo_limit) / (1.0 - options.stereo_limit),
            f"stereo score {match.score:.2f} is below {options.stereo_limit}",
        )
        measured = float(np.linalg.norm(match.point - view.left_camera.C))
        moved = abs(view.travelled_m - track.travelled_m) or abs(track.last.range_m - distance)
        tolerance = (
            math.hypot(
                self.range_error(view, track.last.range_m),
                self.range_error(view, distance),
                self._roughness(view, distance, track.last.depth_m2 + depth_m2(match)),
            )
            + options.odometry_share * moved
            + 0.01
        )
        correction = measured - distance
        scores["range_m"] = measured
        scores["range_correction_m"] = correction
        scores["range_tolerance_m"] = tolerance
        judged.limit(
            1.0 - abs(correction) / tolerance,
            f"range corrected by {correction:+.2f} m, over {tolerance:.2f} m",
        )
        total = float(np.linalg.norm(match.point - track.start_point))
        allowed = (
            math.hypot(
                self.range_error(view, track.start_range_m),
                self._roughness(view, track.start_range_m, track.start_depth_m2 + depth_m2(match)),
            )
            + options.odometry_share * abs(view.travelled_m - track.start_travel_m)
            + 0.05
        )
        self.expected(track, view, match, judged)
        scores["total_correction_m"] = total
        scores["total_tolerance_m"] = allowed
        judged.limit(
            1.0 - total / allowed, f"position corrected by {total:.2f} m in all, over {allowed:.2f} m"
        )

    def expected(self, track: Followed, view: StereoView, match: PointMatch, judged: Judgement) -> None:
        """Judge a match by where the drive and the other targets have this one, if that was told."""
        if track.expected is None:
            return
        expected, covariance = track.expected
        ray = match.point - view.left_camera.C
        away = float(np.linalg.norm(ray))
        sigma_m = self.range_error(view, away) / 3.0
        ranged = match.surface_covariance + (sigma_m / away) ** 2 * np.outer(ray, ray)
        gap = match.point - expected
        total = TAILS**2 * covariance + ranged + pointing(self.options, view, match)
        squared = float(gap @ np.linalg.solve(total, gap))
        judged.scores["expected_squared"] = squared
        judged.limit(
            1.0 - squared / ASTRAY,
            f"{float(np.linalg.norm(gap)):.2f} m from where the drive and the other targets have it",
        )

    def range_error(self, view: StereoView, range_m: float) -> float:
        """Return the 3-sigma range error. Kim et al. 2009, eq. 1."""
        baseline = float(np.linalg.norm(view.right_camera.C - view.left_camera.C))
        return range_m**2 / (view.left_camera.hs * baseline) * self.options.disparity_error_px

    def _roughness(self, view: StereoView, range_m: float, depth_m2: float) -> float:
        """Return the 3-sigma error of a depth that its parts disagree by, within what they may.

        A match so noisy that it widened its own tolerance without end would confirm any range.
        """
        return min(3.0 * math.sqrt(depth_m2), ROUGHEST * self.range_error(view, range_m))


def pointing(options: NccOptions, view: StereoView, match: PointMatch) -> Array:
    """Return the covariance (3, 3), m^2, of a place across the line of sight that no pixel tells."""
    ray = match.point - view.left_camera.C
    away = float(np.linalg.norm(ray))
    across = np.eye(3) - np.outer(ray, ray) / away**2
    return np.asarray((options.least_px * away / view.left_camera.hs) ** 2 * across)


def depth_m2(match: PointMatch) -> float:
    """Return the variance of a point's depth against its surroundings: what its parts disagree by."""
    return float(np.trace(match.surface_covariance))
