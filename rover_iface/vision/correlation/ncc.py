"""The correlation tracker that was flown on Opportunity, and what makes it better.

Kim et al. 2009, section 4: the template of the last stop is magnified and rolled by what the pose estimate
says, correlated with the new left image, the match is ranged by point stereo, four criteria tell a loss,
and the template is replaced. `NccOptions.as_flown()` is that tracker. The default goes further in four
ways, each of which can be switched off: the template is warped through the camera models over the plane
that stereo found (`warp="plane"`, of which scale and roll are special cases); the match is aligned to a
fraction of a pixel; an earlier view takes the drift out; the best few peaks are compared over a wider patch
before one is believed. A target that is not found so is looked for by what lies round it, which needs no
guess of the pose (`reacquisition`). The gain of each is in `docs/results/tracking.md`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.stereo import PointMatch, point_stereo
from rover_iface.errors import TrackerError
from rover_iface.vision.correlation.carried import Carried
from rover_iface.vision.correlation.gallery import Gallery
from rover_iface.vision.correlation.judging import Followed, Judgement, MatchJudge, depth_m2, pointing
from rover_iface.vision.correlation.lost import (
    BELIEVED_M,
    LEAST_ALIKE,
    LOST,
    chance_believed,
    surface_agrees,
)
from rover_iface.vision.coverage_watch import CoverageWatch
from rover_iface.vision.first_view import measured_drift, require_range
from rover_iface.vision.narrow_range import KnownRange
from rover_iface.vision.reacquisition import KnownPair, found_in
from rover_iface.vision.seen_relief import SeenRelief
from rover_iface.vision.template import (
    UNKNOWN_SHARE,
    WEIGHT_SHARE,
    Found,
    NccOptions,
    Template,
    TemplateMatcher,
    grown_drift,
    template_roll,
    template_scale,
)
from rover_iface.vision.tracker import Image, StereoView, TrackState, TrackUpdate

Drift = tuple[Array, Array]
"""Covariance (3, 3), m^2, and parallax (3, 2), metres: see `Template`."""
NOWHERE = np.full(2, np.nan)
FOUND_AGAIN = 0.75
"""Most confidence in a target that is found again, until a view in which it was designated shows it: a wrong
spot is followed as well as the right one. One 7.5 cm beside was told with 0.97 to 1.00 (day 72607405)."""
LEAST_SURE, AGAIN_SURE = 0.5, 0.75
"""Chance of lying within `BELIEVED_M` of a match, across the line of sight, that a target must have to be
followed, and to be taken up again once it was lost: at 0.5 one in two is wrong. One that the sun's other side
shows was taken up 9 cm off, told with 0.55, and followed for eleven stops (tuning seed 3 of the draped
domain)."""
KEYS = 3
"""Earlier views that are tried at a stop, the best first."""
KNOWN_SHARE, KNOWN_SCORE = 0.03, 0.5
"""Where another look tells the range: share of it that stereo looks round it (5 cm at 1.6 m), and the score
that is enough there, as no other range can be mistaken for it: one that 139 patches had to 0.8 cm was lost at
its goal for its score (749793022)."""

CONTRADICTS = 3.0
"""Deviations of both by which a window's range contradicts a known one."""


class NccTracker:
    """Normalised cross-correlation with templates predicted from the pose estimate (a `Tracker`).

    Its confidence in a target that it finds is the least of its margins (correlation, stereo score, range
    correction, agreement forwards and backwards and more), each scaled to be 0 at the limit where the target
    counts as lost and 1 at perfect, passed through a logistic curve: 0.5 is the limit, 0.98 and more a clear
    match. In a lost one it is below that: it falls with what dead reckoning errs, and where another range is
    seen at its place.
    """

    looks_twice: ClassVar[bool] = True
    """Whether what is not found over the plane of its face is looked for by the ranges of its last view."""
    looks_round: ClassVar[bool] = True
    """Whether what is not found so either is looked for by what lies round it, and carried along by that."""

    def __init__(self, options: NccOptions | None = None) -> None:
        self.options = options or NccOptions()
        self.matcher = TemplateMatcher(self.options)
        self.judge = MatchJudge(self.options, self.matcher)
        self.watch = CoverageWatch()
        self._targets: dict[str, Followed] = {}
        self._pairs: list[KnownPair] = []
        self._reliefs: list[SeenRelief] = []

    @property
    def targets(self) -> tuple[str, ...]:
        """Return what is followed."""
        return tuple(self._targets)

    def start(
        self,
        target: str,
        position: npt.ArrayLike | None,
        view: StereoView,
        *,
        pixel: npt.ArrayLike | None = None,
        known: KnownRange | None = None,
    ) -> TrackUpdate:
        """Begin to follow a surface point, given as position (3,) or as pixel (2,) of the left image.

        Position in the frame of the view's cameras, m; pixels as (sample, line). `known` is its distance as a
        better pair has it: a window over the crest of a rock is ranged with the ground behind.
        """
        if target in self._targets:
            raise TrackerError(f'target "{target}" is followed already; clear it first')
        if pixel is None:
            if position is None:
                raise TrackerError(f'target "{target}" needs a position or a pixel')
            at = view.left_camera.project(np.asarray(position, dtype=np.float64))
        else:
            at = np.asarray(pixel, dtype=np.float64)
        if not np.isfinite(at).all():
            raise TrackerError(f'target "{target}" lies behind the camera')
        half = self.options.template_px // 2
        if not view.shows(at, half + 2):
            raise TrackerError(
                f'target "{target}" is at pixel ({at[0]:.1f}, {at[1]:.1f}), not {half + 2} px inside'
            )
        expected = None
        if position is not None:
            expected = float(np.linalg.norm(np.asarray(position) - view.left_camera.C))
        match = self._stereo(view, at, expected, spread=0.9)
        if match is None or match.score < self.options.stereo_limit:
            found = "nothing" if match is None else f"a score of {match.score:.2f}"
            raise TrackerError(
                f'target "{target}": stereo found {found}; {self.options.stereo_limit} is needed'
            )
        if position is not None:
            require_range(target, view, np.asarray(position, dtype=np.float64), match)
        if known is not None:
            match = _ranged(view, at, match, known)
        distance = float(np.linalg.norm(match.point - view.left_camera.C))
        view_template = Template(
            view.left,
            view.left_camera,
            at,
            match.point,
            match.normal,
            distance,
            depth_m2=depth_m2(match) + self._bulge_m2(view, distance),
            relief=self._relief(view, distance),
        )
        judged = Judgement(margins=[(match.score - self.options.stereo_limit) / 0.3])
        update = TrackUpdate(
            target=target,
            state=TrackState.TRACKED,
            position=match.point,
            covariance=match.surface_covariance + pointing(self.options, view, match),
            confidence=judged.confidence,
            pixel=at,
            scores={
                "ncc": 1.0,
                "stereo": match.score,
                "range_m": distance,
                "scale": 1.0,
                "roll_rad": 0.0,
                "template_px": float(self.options.template_px),
            },
        )
        self._targets[target] = Followed(
            view_template,
            view_template,
            Gallery(view_template, view.travelled_m),
            update,
            match.point,
            distance,
            depth_m2(match),
            view.travelled_m,
            view.travelled_m,
            normal_weight=distance**-4,
        )
        return update

    @property
    def _looks_round(self) -> bool:
        return self.looks_round and self.options.surroundings_px > 0

    def predicted(self, target: str) -> Array:
        """Return where the target is believed to be: the last valid position, or where it is expected."""
        track = self._get(target)
        return track.believed if track.misses else track.update.position

    def expect(self, target: str, position: Array, covariance: Array) -> None:
        """See `Expects`."""
        self._get(target).expected = (position, covariance)

    def clear(self, target: str) -> None:
        """Forget a target."""
        self._get(target)
        del self._targets[target]

    def last(self, target: str) -> TrackUpdate:
        """Return the last answer again."""
        return self._get(target).update

    def template(self, target: str) -> Template:
        """Return the view that a target was last found in."""
        return self._get(target).last

    def put(
        self,
        target: str,
        view: StereoView,
        pixel: Array,
        drift: Drift,
        away_m: float,
        *,
        known: KnownRange | None = None,
    ) -> bool:
        """Go on from where another look has the target in this view; False where stereo does not range it.

        `pixel` (2,) is that of the left image, `drift` what that look leaves open, `away_m` the range there.
        Where that is `known` better than a window of this view has it, it is the track's. A track that was
        lost, even failed, is taken up again so.
        """
        track = self._get(target)
        limit = self.options.stereo_limit
        match = self._stereo(view, pixel, away_m, spread=0.35)
        if match is None or match.score < limit or _off(view, match, away_m) > KNOWN_SHARE * away_m:
            limit = min(limit, KNOWN_SCORE)
            match = self._stereo(view, pixel, away_m, spread=KNOWN_SHARE)
        if match is None or match.score < limit:
            return False
        if known is not None:
            match = _ranged(view, pixel, match, known)
        judged = Judgement(scores={"range_m": float(np.linalg.norm(match.point - view.left_camera.C))})
        judged.scores["template_px"] = float(self.options.template_px)
        track.update = self._accept(target, track, view, pixel, match, drift, judged)
        track.put = True
        return True

    def recognised(self, target: str) -> None:
        """Take that a picture in which the target was designated shows it where it is followed."""
        self._get(target).doubted = False

    def take_back(
        self, target: str, view: StereoView, position: Array, covariance: Array
    ) -> TrackUpdate | None:
        """See `TakesBack`."""
        pixel = np.asarray(view.left_camera.project(position))
        away = float(np.linalg.norm(position - view.left_camera.C))
        drift = covariance, np.zeros((3, 2))
        ray = (position - view.left_camera.C) / away
        known = self._weighed(view, pixel, KnownRange(away, math.sqrt(float(ray @ covariance @ ray))))
        return self.last(target) if self.put(target, view, pixel, drift, away, known=known) else None

    def update(self, target: str, view: StereoView) -> TrackUpdate:
        """Find the target again after a move; see the module for the steps."""
        track = self._get(target)
        if track.update.state is TrackState.FAILED:
            return self._unseen(track, view, track.update.reasons, track.update.scores)
        judged = self._find(target, track, view)
        if isinstance(judged, TrackUpdate):
            track.update = judged
            return judged
        again = self._again(target, track, view) if self._looks_round else None
        if again is not None:
            track.update = again
            return again
        track.misses += 1
        return self._unseen(track, view, tuple(judged.reasons), judged.scores)

    def _unseen(
        self, track: Followed, view: StereoView, reasons: tuple[str, ...], scores: Mapping[str, float]
    ) -> TrackUpdate:
        """Return the answer about a target that is not found: where it is believed, ever less surely."""
        moved = max(0.0, view.travelled_m - track.travelled_m)
        unbroken = False
        if track.expected is not None:
            covariance = track.expected[1]
        elif self._looks_round:
            track.carried = self._carried(track, view, moved)
            covariance, unbroken = track.carried.covariance, track.carried.unbroken
        else:
            covariance = track.update.covariance + (self.options.odometry_share / 3.0 * moved) ** 2 * np.eye(
                3
            )
        ray = track.believed - view.left_camera.C
        if unbroken:
            track.alike = 1.0
        elif track.misses <= self.options.lost_updates:
            away = float(np.linalg.norm(ray))
            ranged = (self.judge.range_error(view, away) / 3.0) ** 2
            relief = self._relief(view, away)
            along = np.outer(ray, ray) / float(ray @ ray)
            track.alike = 1.0 if surface_agrees(track, relief, covariance + ranged * along) else LEAST_ALIKE
        track.update = replace(
            track.update,
            state=TrackState.FAILED if track.misses > self.options.lost_updates else TrackState.LOST,
            position=track.believed,
            covariance=covariance,
            confidence=LOST * track.alike * chance_believed(covariance, ray),
            pixel=NOWHERE.copy(),
            reasons=reasons,
            scores=scores,
        )
        track.travelled_m = view.travelled_m
        return track.update

    # ---- one update

    def _find(self, target: str, track: Followed, view: StereoView) -> TrackUpdate | Judgement:
        """Return the target's new place, or why no match is believed.

        Where the plane of its face leads nowhere, its last view is looked at through its ranges.
        """
        first = self._try(target, track, view, by_ranges=False)
        if isinstance(first, TrackUpdate) or not self.looks_twice or not self.options.surroundings_px:
            return first
        second = self._try(target, track, view, by_ranges=True)
        return second if isinstance(second, TrackUpdate) else first

    def _carried(self, track: Followed, view: StereoView, moved_m: float) -> Carried:
        """Return a lost target as what lay round it at the last stop has it now."""
        before, last, share = track.carried, track.last, self.options.odometry_share / 3.0
        if before is None:
            assert last.relief is not None  # every template that is taken has one
            before = Carried(self._known_pair(last.relief.view), last.point, track.update.covariance, True)
        return before.to(self._known_pair(view), view, moved_m, share)

    def _again(self, target: str, track: Followed, view: StereoView) -> TrackUpdate | None:
        """Return a target as what lies round it has it (`reacquisition`); None where that tells nothing."""
        last = track.last
        if last.relief is None:
            return None
        known = self._known_pair(last.relief.view)
        rough = known.pose(view)
        if isinstance(rough, str):
            return None
        found = found_in(known, last.point, view, rough)
        if not found.accepted:
            return None
        away = float(np.linalg.norm(found.position - view.left_camera.C))
        match = self._stereo(view, found.pixel, away, spread=0.35)
        if match is None or match.score < self.options.stereo_limit:
            return None
        apart_m = abs(float(np.linalg.norm(match.point - view.left_camera.C)) - away)
        if apart_m > self.judge.range_error(view, away):
            return None
        open_m2 = (found.error_px * away / view.left_camera.hs) ** 2
        drift = last.drift + open_m2 * np.eye(3), last.parallax
        judged = Judgement(scores={"range_m": away, "features": float(found.features)})
        judged.scores["patches"] = float(found.agreeing)
        self.judge.expected(track, view, match, judged)
        if judged.reasons:
            return None
        track.misses += 1  # it was lost, if only for a moment
        if self._is_sure(track, view, found.pixel, match, drift, judged):
            return self._accept(target, track, view, found.pixel, match, drift, judged)
        track.misses -= 1
        return None

    def _known_pair(self, view: StereoView) -> KnownPair:
        """Return what is known of the surroundings in a pair: targets last seen in the same one share it."""
        known = next((pair for pair in self._pairs if pair.side.view is view), None)
        if known is None:
            known = KnownPair(view)
            self._pairs = [known, *self._pairs[:3]]
        return known

    def _relief(self, view: StereoView, range_m: float) -> SeenRelief:
        """Return what the pair of a view ranges for a target at a range, m; one stop asks for it up to four
        times.
        """
        known = next((one for one in self._reliefs if one.view is view and one.range_m == range_m), None)
        if known is None:
            known = SeenRelief(view, range_m)
            self._reliefs = [known, *self._reliefs[:3]]
        return known

    def _try(
        self, target: str, track: Followed, view: StereoView, *, by_ranges: bool
    ) -> TrackUpdate | Judgement:
        judged = Judgement()
        found = self._match(track, view, judged, by_ranges=by_ranges)
        if found is None:
            return judged
        at, drift = found
        distance = float(np.linalg.norm(track.believed - view.left_camera.C))
        match = self._stereo(view, at, distance, spread=0.35)
        if match is None:
            judged.limit(-1.0, "stereo finds no partner")
            return judged
        self.judge.position(track, view, match, distance, judged)
        if self.options.surroundings_px:
            self.judge.surroundings(track, view, match, judged)
            self.judge.identity(track, view, match, judged)
            self.judge.where_expected(track, view, match, judged)
        if judged.reasons:
            return judged
        at, match, drift = self._against_first(track, view, at, match, drift, judged)
        if not self._is_sure(track, view, at, match, drift, judged):
            return judged
        return self._accept(target, track, view, at, match, drift, judged)

    def _is_sure(
        self, track: Followed, view: StereoView, at: Array, match: PointMatch, drift: Drift, judged: Judgement
    ) -> bool:
        """Return whether a match is known well enough to be followed, or to be taken up again."""
        now = Template(
            view.left, view.left_camera, at, match.point, match.normal, judged.scores["range_m"], *drift
        )
        sure = chance_believed(self._covariance(view, match, now), match.point - view.left_camera.C)
        needed = AGAIN_SURE if track.misses else LEAST_SURE
        if sure >= needed:
            return True
        reason = f"it lies within {BELIEVED_M} m of there with a chance of {sure:.2f}"
        judged.limit(-1.0, f"{reason}; {needed} is needed")
        return False

    def _against_first(
        self,
        track: Followed,
        view: StereoView,
        at: Array,
        match: PointMatch,
        drift: Drift,
        judged: Judgement,
    ) -> tuple[Array, PointMatch, Drift]:
        """Return the match corrected by what the first view tells of its drift, and what drift is left."""
        if not self.options.key_template or track.last is track.first or track.put:
            return at, match, drift
        camera, away = view.left_camera, judged.scores["range_m"]
        spread_m2 = depth_m2(match)
        first_m2 = spread_m2 + self._bulge_m2(view, track.first.range_m)
        ranged_m2 = spread_m2 + self._bulge_m2(view, away)
        relief = self._relief(view, away)
        now = Template(
            view.left, camera, at, match.point, match.normal, away, *drift, first_m2, ranged_m2, relief
        )
        found = measured_drift(self.matcher, track.first, now)
        if found is None:
            return at, match, drift
        track.doubted = False
        self._watch(track, view, found.squared)
        moved = camera.project(match.point - found.off)
        again = self._stereo(view, moved, away, spread=0.35) if np.isfinite(moved).all() else None
        if again is None or again.score < self.options.stereo_limit:
            return at, match, drift
        judged.scores["drift_m"] = float(np.linalg.norm(found.off))
        judged.scores["range_m"] = float(np.linalg.norm(again.point - camera.C))
        return moved, again, (found.drift, found.parallax)

    def _match(
        self, track: Followed, view: StereoView, judged: Judgement, *, by_ranges: bool = False
    ) -> tuple[Array, Drift] | None:
        """Return the pixel of the best match and what it has drifted; None when there is no match.

        With `by_ranges` the template is what the last view shows from here by its own ranges: what stands out
        from the target's face, and what shows beside it, is not part of the face's plane.
        """
        options, last, camera = self.options, track.last, view.left_camera
        believed = track.believed
        prediction = camera.project(believed)
        judged.scores["template_px"] = float(options.template_px)
        if not np.isfinite(prediction).all():
            judged.limit(-1.0, "target is behind the camera")
            return None
        if not view.shows(prediction, options.template_px // 2):
            judged.limit(-1.0, "target is outside the image")
            return None
        distance = float(np.linalg.norm(believed - camera.C))
        scores = judged.scores
        scores["scale"] = template_scale(last.range_m, distance)
        scores["roll_rad"] = template_roll(last.camera, camera, believed, options.adjacent_m)
        template = self._predicted(last, camera, prediction, believed, by_ranges=by_ranges)
        if template is None:
            judged.limit(-1.0, "the template lies outside the earlier image")
            return None
        found = self.matcher.search(view.left, template, prediction)
        if found is None:
            judged.limit(-1.0, "no contrast to correlate")
            return None
        at, score = found.pixel, found.score
        drift = grown_drift(last, camera, last.point, last.normal, found.spread)
        if options.key_template:
            better = self._with_key(track, view, prediction, found)
            if better is not None:
                at, scores["key"], drift = better
        scores["ncc"] = score
        scores["correction_px"] = float(np.hypot(*(at - prediction)))
        judged.alike = (score - options.score_limit) / (1.0 - options.score_limit)
        judged.limit(
            judged.alike,
            f"correlation {score:.2f} is below {options.score_limit}",
        )
        if math.isfinite(options.back_check_px):
            eye, ray = camera.back_project(at)
            place, relief = eye + distance * ray, self._relief(view, distance) if by_ranges else None
            now = Template(view.left, camera, at, place, last.normal, distance, relief=relief)
            back = scores["back_px"] = self.matcher.back_error(now, last)
            judged.limit(
                1.0 - back / options.back_check_px,
                f"matching back ends {back:.1f} px away, over {options.back_check_px}",
            )
        return at, drift

    def _predicted(
        self, last: Template, camera: CameraModel, prediction: Array, believed: Array, *, by_ranges: bool
    ) -> Image | None:
        """Return what the template should look like now: over the plane of its face, or by its own ranges."""
        if not by_ranges or last.relief is None:
            return self.matcher.predict(last, camera, prediction, believed)
        half, inner = self.options.context_px // 2, self.options.template_px // 2
        out = last.relief.seen_by(camera, believed, believed - last.point, half)
        if out is None:
            return None
        core = out[half - inner : half + inner + 1, half - inner : half + inner + 1]
        return None if np.isnan(core).mean() > UNKNOWN_SHARE else out

    def _accept(
        self,
        target: str,
        track: Followed,
        view: StereoView,
        at: Array,
        match: PointMatch,
        drift: Drift,
        judged: Judgement,
    ) -> TrackUpdate:
        """Replace the template by what is seen now, and return the answer."""
        camera, measured = view.left_camera, judged.scores["range_m"]
        normal = self._blend_normal(track, match, measured)
        track.doubted = track.doubted or track.misses > 0
        track.misses, track.carried = 0, None
        track.travelled_m = view.travelled_m
        relief = self._relief(view, measured)
        deep_m2 = depth_m2(match) + self._bulge_m2(view, measured)
        track.last = Template(
            view.left, camera, at, match.point, normal, measured, *drift, deep_m2, deep_m2, relief
        )
        track.gallery.add(track.last, view.travelled_m)
        covariance = self._covariance(view, match, track.last)
        sure = min(judged.confidence, chance_believed(covariance, match.point - camera.C))
        return TrackUpdate(
            target=target,
            state=TrackState.TRACKED,
            position=match.point,
            covariance=covariance,
            confidence=min(sure, FOUND_AGAIN) if track.doubted else sure,
            pixel=at,
            scores=judged.scores | {"watched": self.watch.coverage, "widened": self.watch.factor},
        )

    def _with_key(
        self, track: Followed, view: StereoView, prediction: Array, found: Found
    ) -> tuple[Array, float, Drift] | None:
        """Return the match of an earlier view beside `found`, its score and drift; None if none is better.

        It must agree with what the last view says. Whether they agree as well as both are told to is what the
        tracker's coverage is watched by.
        """
        last, camera = track.last, view.left_camera
        half = min(self.options.context_px // 2, self.options.template_px // 2 + 4)
        other = grown_drift(last, camera, last.point, last.normal, found.spread)
        for kept in track.gallery.best(camera, last.point, last.normal)[:KEYS]:
            key = kept.template
            template = None if key is last else self.matcher.predict(key, camera, prediction, last.point)
            if template is None:
                continue
            spot = found.pixel.copy()
            fitted = self.matcher.fit(view.left, template, spot, half)
            if fitted is None or fitted[0] < 0.75:
                continue
            drift = grown_drift(key, camera, last.point, last.normal, fitted[1])
            gap = spot - found.pixel
            self._watch_gap(track, view, gap, (drift, other), key)
            if float(np.hypot(*gap)) <= 2.0 and _total(drift) < _total(other):
                return spot, fitted[0], drift
        return None

    def _watch(self, track: Followed, view: StereoView, squared: float) -> None:
        """Take the first check of a picture: all others of the same match share its error."""
        if track.watched is not view:
            track.watched = view
            self.watch.see(squared, 2)

    def _watch_gap(
        self, track: Followed, view: StereoView, gap: Array, told: tuple[Drift, Drift], key: Template
    ) -> None:
        """Hold the gap (2,), px, between two matches of one picture against what both are told to be off."""
        # the last template comes from the key one: what that had drifted is common to both
        apart = sum((d + q @ q.T for d, q in told), -2.0 * key.uncertainty)
        jacobian = view.left_camera.jacobian(track.last.point)
        noise = jacobian @ apart @ jacobian.T + self.options.least_px**2 * np.eye(2)
        # below that it does not: what both have in common is not known
        if float(np.linalg.eigvalsh(noise)[0]) >= self.options.least_px**2:
            self._watch(track, view, float(gap @ np.linalg.solve(noise, gap)))

    def _bulge_m2(self, view: StereoView, range_m: float) -> float:
        """Return the variance of a spot's depth against the window round it, by the relief of rock.

        Stereo from afar does not see it: 1 cm at 6 m is 0.06 px of disparity.
        """
        window_m = WEIGHT_SHARE * (self.options.template_px // 2) * range_m / view.left_camera.hs
        return (self.options.relief_slope * window_m) ** 2

    def _covariance(self, view: StereoView, match: PointMatch, now: Template) -> Array:
        """Return the covariance (3, 3), m^2, that is told of a place, widened as the checks so far ask."""
        found = match.surface_covariance + self._astray(view, now) + pointing(self.options, view, match)
        return np.asarray(self.watch.factor * found)

    def _astray(self, view: StereoView, now: Template) -> Array:
        """Return the covariance (3, 3), m^2, of a place by how far its spot lies from the designated one.

        Beside the plane of the face, where it leads, the surface lies deeper or higher by its relief.
        """
        ray = (now.point - view.left_camera.C) / now.range_m
        along = np.outer(ray, ray)
        across = np.eye(3) - along
        aside = across @ now.uncertainty @ across
        by_relief_m2 = 0.5 * self.options.relief_slope**2 * float(np.trace(aside))
        deep_m2 = float(ray @ now.uncertainty @ ray) + by_relief_m2
        return np.asarray(aside + deep_m2 * along)

    def _stereo(
        self, view: StereoView, at: Array, distance: float | None, *, spread: float
    ) -> PointMatch | None:
        return point_stereo(
            view.left,
            view.right,
            view.left_camera,
            view.right_camera,
            at,
            options=self.options.stereo,
            expected_range_m=distance,
            range_spread=spread,
        )

    def _weighed(self, view: StereoView, at: Array, known: KnownRange) -> KnownRange:
        """Return the range of a left pixel (2,) by what is `known` and by a window of this view, each by its
        variance; the known one where the window contradicts it, as it may hold what lies behind an edge.
        """
        match = self._stereo(view, at, known.range_m, spread=0.35)
        if match is None:
            return known
        ranged_m, known_m2 = float(np.linalg.norm(match.point - view.left_camera.C)), known.sigma_m**2
        window_m2 = depth_m2(match) + self._bulge_m2(view, ranged_m)
        if (ranged_m - known.range_m) ** 2 > CONTRADICTS**2 * (window_m2 + known_m2):
            return known
        share = known_m2 / (window_m2 + known_m2)
        return KnownRange(known.range_m + share * (ranged_m - known.range_m), math.sqrt(share * window_m2))

    def _blend_normal(self, track: Followed, match: PointMatch, range_m: float) -> Array:
        """Return the plane's normal: stereo slant is good to the fourth power of nearness, so weigh by it."""
        weight = range_m**-4
        total = track.normal_weight + weight
        normal = (track.normal_weight * track.last.normal + weight * match.normal) / total
        track.normal_weight = total
        length = float(np.linalg.norm(normal))
        return match.normal if length < 0.2 else np.asarray(normal / length)

    def _get(self, target: str) -> Followed:
        if target not in self._targets:
            known = ", ".join(self._targets) or "none"
            raise TrackerError(f'target "{target}" is not followed; followed: {known}')
        return self._targets[target]


def _ranged(view: StereoView, at: Array, match: PointMatch, known: KnownRange) -> PointMatch:
    """Return a match brought to a known range on the ray of its left pixel (2,)."""
    eye, ray = view.left_camera.back_project(at)
    covariance = known.sigma_m**2 * np.outer(ray, ray)
    return replace(match, point=eye + known.range_m * ray, surface_covariance=covariance)


def _off(view: StereoView, match: PointMatch, away_m: float) -> float:
    """Return by how much the range of a match differs from another, metres."""
    return abs(float(np.linalg.norm(match.point - view.left_camera.C)) - away_m)


def _total(drift: Drift) -> float:
    """Return the whole variance of a drift, m^2."""
    return float(np.trace(drift[0] + drift[1] @ drift[1].T))
