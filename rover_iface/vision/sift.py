"""The feature tracker: SIFT points ranged by stereo carry all targets from stop to stop.

Pedersen, Deans, Lees and others 2006, Deans, Kunz, Sargent and others 2005 (K9): features of both images of a
pair are matched to 3-D points, those to the points of the last valid stop, a rigid motion is found by RANSAC
(100 draws of three points, Horn's method, inliers within 3 cm) and refitted until the consensus is stable;
each target moves with it. `SiftOptions(method="published", sigma_px=0.5)` is that tracker.

What ships differs where that gained (docs/results/tracking.md): the motion is found and weighted in
the images (`sift_motion`), each target is looked at (`sift_anchor`), an unmatched stop widens the covariance
by what dead reckoning may be off, and the confidence is the chance that the target is within 5 cm across the
line of sight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo import triangulate
from rover_iface.errors import TrackerError
from rover_iface.vision.coverage_watch import CoverageWatch
from rover_iface.vision.narrow_range import KnownRange
from rover_iface.vision.sift_anchor import Anchor, AnchorOptions, Looks
from rover_iface.vision.sift_features import Features, find_features, match_moved
from rover_iface.vision.sift_motion import Motion, find_motion, find_motion_published, horn
from rover_iface.vision.tracker import StereoView, TrackState, TrackUpdate

__all__ = ["Motion", "SiftOptions", "SiftTracker", "horn"]


@dataclass(frozen=True, slots=True)
class SiftOptions:
    """Parameters of the feature tracker.

    Attributes
    ----------
    method
        `shipped`, or `published` with metric consensus, bootstrap covariance, no looks at the target.
    features
        Strongest features kept per image.
    ratio
        Best over second-best descriptor distance.
    row_px
        How far a left-right match may be from its epipolar line.
    gate_px
        How far a feature may be from where the pose estimate puts it; while fewer than `half_count` agree,
        three times that and then the whole image are tried.
    tau_m, draws
        Consensus distance and number of RANSAC draws (published: 3 cm, 100).
    inlier_px
        Consensus distance in the images.
    slope, half_count
        a and N of 1 / (1 + exp(-a (n - N))) (the sign of eq. 7 as printed is wrong).
    least
        Inliers without which the update counts as lost.
    lost_updates
        Updates allowed in LOST (published: 4 to 5).
    sigma_px
        Error of a feature's coordinates.
    start_sigma_px
        Error of the designated point's coordinates in the published initial covariance.
    odometry_share, heading_rad
        Dead reckoning while coasting: error per metre driven and of the heading per square root of a metre.
    slack_share, slack_m, slack_rad
        What dead reckoning may be off between stops (of the way, and by turning) before a motion is doubted.
    error_m
        The error that the confidence speaks of, across the line of sight.
    """

    method: Literal["shipped", "published"] = "shipped"
    features: int = 1500
    ratio: float = 0.8
    row_px: float = 1.5
    gate_px: float = 60.0
    tau_m: float = 0.03
    draws: int = 100
    inlier_px: float = 1.5
    slope: float = 0.1
    half_count: float = 30.0
    least: int = 8
    lost_updates: int = 4
    sigma_px: float = 0.3
    start_sigma_px: float = 0.5
    bootstrap: int = 60
    odometry_share: float = 0.05
    heading_rad: float = 0.01
    slack_share: float = 0.5
    slack_m: float = 0.03
    slack_rad: float = 0.01
    error_m: float = 0.05
    anchor: AnchorOptions = field(default_factory=AnchorOptions)

    def __post_init__(self) -> None:
        if self.features < 20 or self.draws < 1 or self.least < 4:
            raise TrackerError(
                f"feature tracker with {self.features} features, {self.draws} draws, {self.least} inliers; "
                "at least 20, 1 and 4 are needed"
            )
        if not (self.sigma_px > 0 and self.inlier_px > 0 and self.error_m > 0 and self.lost_updates >= 0):
            raise TrackerError(
                f"feature tracker with sigma {self.sigma_px} px, inliers {self.inlier_px} px, error "
                f"{self.error_m} m, {self.lost_updates} lost updates; the first three must be positive"
            )


@dataclass(slots=True)
class _Chain:
    """Targets that share features: the last valid stop and what came of the present one.

    `recent` are the features of the stop before where that was not valid, `step` is the motion since then: in
    another light nothing is as it was at the last valid stop, and everything as it was a moment ago.
    """

    view: StereoView
    valid_view: StereoView
    features: Features
    motion: Motion | None = None
    stops: int = 0
    coasted_m: float = 0.0
    recent: Features | None = None
    step: Motion | None = None
    moved_m: float = 0.0


@dataclass(slots=True)
class _Target:
    """A track that goes where the features go (method `published`)."""

    chain: _Chain
    position: Array
    covariance: Array
    view: StereoView
    state: TrackState = TrackState.TRACKED
    misses: int = 0
    answer: TrackUpdate | None = None
    carried: tuple[Array, Array] | None = None
    """Where a target that is not seen is believed (3,), m, and the covariance (3, 3), m^2, of that."""

    @property
    def believed(self) -> tuple[Array, Array]:
        """Return where it is believed, and the covariance of that."""
        return (self.position, self.covariance) if self.carried is None else self.carried


@dataclass(slots=True, kw_only=True)
class _Anchored(_Target):
    """A track that is tied to what its own surface was seen to be (method `shipped`)."""

    anchor: Anchor


class SiftTracker:
    """Feature tracker (a `Tracker`); targets started on the same view share the features of each stop.

    A stop whose features do not match keeps the last valid ones: the target stays where dead reckoning has
    it, its covariance grows with the distance driven, and the next stop is matched against the last valid
    one. Where that fails again it goes with the features of the stop before (as shipped). After
    `lost_updates` such stops the target has failed.

    Its confidence, as published, is 1 / (1 + exp(-a (n - N))) of the number n of features that agree on the
    motion: 0.5 at N = 30. As shipped it is the least of that count's (with N at twice the least number of
    features) and the chance that the covariance leaves of an error below `error_m` across the line of sight.
    Below 0.5 the target is lost.
    """

    def __init__(self, options: SiftOptions | None = None) -> None:
        self.options = options or SiftOptions()
        self.looks = Looks(self.options.anchor)
        self.watch = CoverageWatch()
        self._targets: dict[str, _Target] = {}
        self._found: tuple[StereoView, Features] | None = None

    @property
    def targets(self) -> tuple[str, ...]:
        """Return what is followed."""
        return tuple(self._targets)

    @property
    def shipped(self) -> bool:
        """Return whether this is the shipped method, not the published one."""
        return self.options.method == "shipped"

    def start(
        self,
        target: str,
        position: npt.ArrayLike | None,
        view: StereoView,
        *,
        pixel: npt.ArrayLike | None = None,
        pixels: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
        known: KnownRange | None = None,
    ) -> TrackUpdate:
        """Begin to follow a surface point, given as position (3,) or as pixel (2,) of the left image.

        `pixels` gives the point in both images where stereo has been done already. `known` is its distance
        from the left camera where something ranges better than the pair (method `shipped`).

        Position in the frame of the view's cameras, m; pixels as (sample, line).
        """
        if target in self._targets:
            raise TrackerError(f'target "{target}" is followed already; clear it first')
        given = None if position is None else np.asarray(position, dtype=np.float64)
        pair = _designated(target, given, view, pixel, pixels)
        chain = next((t.chain for t in self._targets.values() if t.chain.valid_view is view), None)
        if chain is None:
            chain = _Chain(view, view, self.find(view))
        if len(chain.features) < self.options.least:
            raise TrackerError(
                f"only {len(chain.features)} features could be ranged; {self.options.least} are needed"
            )
        anchored = None
        if self.shipped:
            anchored = point, spread, _ = self.looks.begin(target, view, pair[0], given, known)
        else:
            if pixel is not None:
                point = self.looks.begin(target, view, pair[0], given, known)[0]
                pair = pair[0], np.asarray(view.right_camera.project(point))
            point, spread = self._triangulated(target, pair, view)
        track = (
            _Target(chain, point, spread, view)
            if anchored is None
            else _Anchored(chain, point, spread, view, anchor=anchored[2])
        )
        self._targets[target] = track
        track.answer = self._answer(target, view, spread, len(chain.features), ())
        return track.answer

    def update(self, target: str, view: StereoView) -> TrackUpdate:
        """Move a target with the motion of the features; the first target of a stop pays for all.

        A second update on the same view gives the same answer.
        """
        track = self._get(target)
        if track.view is view and track.answer is not None:
            return track.answer
        track.view = view
        chain = track.chain
        if chain.view is not view:
            self._advance(chain, view)
        if track.state is TrackState.FAILED or chain.motion is None:
            track.answer = self._coast(target, track, view)
            return track.answer
        track.carried = None
        track.position, track.covariance = chain.motion.at(track.position, track.covariance)
        if isinstance(track, _Anchored):
            track.anchor.normal = np.asarray(chain.motion.new_from_old.rotate(track.anchor.normal))
            _move_key(track.anchor, chain.motion)
            track.position, track.covariance = self.looks.take(
                view, track.position, track.covariance, track.anchor
            )
            self.watch.see(track.anchor.scores["range_sigma"] ** 2, 1)
            self.watch.see(2.0 * track.anchor.scores["look_sigma"] ** 2, 2)
        confidence = self._confidence(track, view, chain.motion)
        if self.shipped and confidence < 0.5:
            # one that the features carry is known poorly, but not missed
            track.misses += self._count(chain.motion.inliers) < 0.5
            track.state = TrackState.FAILED if track.misses > self.options.lost_updates else TrackState.LOST
            why = (f"confidence {confidence:.2f} is below 0.50: {self._weakest(track, view, chain.motion)}",)
            track.answer = self._answer(target, view, track.covariance, chain.motion.inliers, why, confidence)
            return track.answer
        track.misses, track.state = 0, TrackState.TRACKED
        track.answer = self._answer(target, view, track.covariance, chain.motion.inliers, (), confidence)
        return track.answer

    def restart(
        self, target: str, view: StereoView, pixel: Array, position: Array, error_px: float
    ) -> TrackUpdate:
        """Go on from where something else, sure to `error_px`, has found the target in a view: `pixel` [2] of
        its left image, `position` [3] in the frame of its cameras, m.

        Raises
        ------
        TrackerError
            If the target is not followed, or cannot be followed from there: then it is as before.
        """
        before = self._get(target)
        del self._targets[target]
        try:
            self.start(target, position, view, pixel=pixel)
        except TrackerError:
            self._targets[target] = before
            raise
        track = self._get(target)
        ray = track.position - view.left_camera.C
        away = float(np.linalg.norm(ray))
        across = np.eye(3) - np.outer(ray, ray) / away**2
        track.covariance = track.covariance + (error_px * away / view.left_camera.hs) ** 2 * across
        if isinstance(track, _Anchored):
            off = (error_px * away / view.left_camera.hs) ** 2 * across
            track.anchor.key = replace(track.anchor.key, drift=off)
        track.answer = self._answer(target, view, track.covariance, len(track.chain.features), ())
        return track.answer

    def predicted(self, target: str) -> Array:
        """Return where the target is believed to be."""
        return self._get(target).believed[0]

    def clear(self, target: str) -> None:
        """Forget a target."""
        self._get(target)
        del self._targets[target]

    def find(self, view: StereoView) -> Features:
        """Return the ranged features of a pair; those of the last pair asked for are kept."""
        if self._found is None or self._found[0] is not view:
            options = self.options
            found = find_features(view, count=options.features, ratio=options.ratio, row_px=options.row_px)
            self._found = (view, found)
        return self._found[1]

    def motion(
        self, old: Features, new: Features, view: StereoView, *, seed: int, driven_m: float = math.inf
    ) -> Motion | None:
        """Return the motion that most features agree on, or None when fewer than `least` do.

        `driven_m` is how far the rover believes to have come since the old features: without a better motion
        up to half of that, with an allowance for the heading, is taken first.
        """
        options = self.options
        if len(old) < 4 or len(new) < 4:
            return None
        away = float(np.percentile(np.linalg.norm(old.points - view.left_camera.C, axis=1), 25))
        limit_m = options.slack_share * driven_m + options.slack_m + options.slack_rad * away
        expected = np.asarray(view.left_camera.project(old.points))
        best: Motion | None = None
        for gate_px, draws in ((1.0, 1), (3.0, 3), (math.inf, 3)):
            pairs = match_moved(old, new, expected, ratio=options.ratio, gate_px=gate_px * options.gate_px)
            rng = np.random.default_rng([seed, len(pairs)])
            if self.shipped:
                found = find_motion(
                    old,
                    new,
                    pairs,
                    view,
                    draws=draws * options.draws,
                    inlier_px=options.inlier_px,
                    sigma_px=options.sigma_px,
                    limit_m=limit_m,
                    least=options.least,
                    rng=rng,
                )
            else:
                found = find_motion_published(
                    old, new, pairs, draws=options.draws, tau_m=options.tau_m, sets=options.bootstrap, rng=rng
                )
            if found is not None and (best is None or found.inliers > best.inliers):
                best = found
            if best is not None and best.inliers >= options.half_count:
                break
        return best if best is not None and best.inliers >= options.least else None

    # ---- steps of an update

    def _triangulated(self, target: str, pair: tuple[Array, Array], view: StereoView) -> tuple[Array, Array]:
        """Return position and covariance by the pixels of both images (eq. 4)."""
        point = triangulate(view.left_camera, view.right_camera, pair[0][None], pair[1][None])[0][0]
        if not np.isfinite(point).all():
            raise TrackerError(f'target "{target}" lies behind the cameras')
        return point, _unscented(view, pair[0], pair[1], self.options.start_sigma_px)

    def _advance(self, chain: _Chain, view: StereoView) -> None:
        """Find the motion to a new stop; without one the last valid stop stays the one to match."""
        chain.stops += 1
        chain.moved_m = float(np.linalg.norm(view.left_camera.C - chain.view.left_camera.C))
        chain.coasted_m += chain.moved_m
        chain.view = view
        fresh = self.find(view)
        motion = self.motion(chain.features, fresh, view, seed=chain.stops, driven_m=chain.coasted_m)
        if motion is not None and motion.doubtful and not self._confirmed(chain, motion, view):
            motion = None
        recent, chain.step, chain.recent = chain.recent, motion, fresh
        if motion is None and recent is not None and self.shipped:
            found = self.motion(recent, fresh, view, seed=chain.stops, driven_m=chain.moved_m)
            chain.step = None if found is None or found.doubtful else found
        chain.motion = motion
        if motion is not None:
            # a stop that shows little moves the features it has: they may be needed for the next; so does one
            # whose few matches lead no target to where it is seen
            poor = self.shipped and motion.inliers < self.options.half_count
            poor = poor and (2 * len(fresh) < len(chain.features) or not self._confirmed(chain, motion, view))
            chain.features = chain.features.moved(motion.new_from_old) if poor else fresh
            chain.valid_view, chain.coasted_m = view, 0.0

    def _confirmed(self, chain: _Chain, motion: Motion, view: StereoView) -> bool:
        """Return whether a doubtful motion leads at least one target to where it is seen again."""
        for track in self._targets.values():
            if track.chain is not chain or track.state is TrackState.FAILED:
                continue
            if not isinstance(track, _Anchored):
                continue
            anchor = replace(
                track.anchor, normal=np.asarray(motion.new_from_old.rotate(track.anchor.normal)), scores={}
            )
            _move_key(anchor, motion)
            self.looks.take(view, *motion.at(track.position, track.covariance), anchor)
            gate = self.options.anchor.gate_sigma
            if anchor.scores["look_sigma"] < gate and abs(anchor.scores["range_sigma"]) < gate:
                return True
        return False

    def _coast(self, target: str, track: _Target, view: StereoView) -> TrackUpdate:
        """Answer about a target that is not seen.

        It goes with the features of the stop before, or stays where dead reckoning has it, with a covariance
        that is widened by what that may be off.
        """
        options, chain = self.options, track.chain
        why = f"fewer than {options.least} features agree on the motion"
        if track.state is TrackState.FAILED:
            why = "failed earlier; clear it first"
        else:
            track.misses += 1
            track.state = TrackState.FAILED if track.misses > options.lost_updates else TrackState.LOST
        place, spread = track.believed
        if chain.step is not None:
            place, spread = chain.step.at(place, spread)
        elif self.shipped:
            lever = float(np.linalg.norm(place - view.left_camera.C))
            turned2 = options.heading_rad**2 * chain.moved_m * lever**2
            spread = spread + ((options.odometry_share * chain.moved_m) ** 2 + turned2) * np.eye(3)
        track.carried = place, spread
        # half of what no feature allows, times the chance that it is where it is believed
        confidence = 0.5 * self._count(0) * _within(spread, view, place, options.error_m)
        return self._answer(target, view, spread, 0, (why,), confidence if self.shipped else None)

    def _count(self, inliers: int) -> float:
        options = self.options
        half = 2.0 * options.least if self.shipped else options.half_count
        return 1.0 / (1.0 + math.exp(-options.slope * (inliers - half)))

    def _grounds(self, track: _Target, view: StereoView, motion: Motion) -> dict[str, float]:
        options = self.options
        grounds = {f"{motion.inliers} features agree": self._count(motion.inliers)}
        if isinstance(track, _Anchored):
            told = self.watch.factor * self.looks.told(track.covariance, track.anchor)
            chance = _within(told, view, track.position, options.error_m)
            grounds[f"the chance of {100 * options.error_m:.0f} cm is {chance:.2f}"] = chance
        return grounds

    def _confidence(self, track: _Target, view: StereoView, motion: Motion) -> float:
        return min(self._grounds(track, view, motion).values())

    def _weakest(self, track: _Target, view: StereoView, motion: Motion) -> str:
        grounds = self._grounds(track, view, motion)
        return min(grounds, key=lambda name: grounds[name])

    def _answer(
        self,
        target: str,
        view: StereoView,
        spread: Array,
        count: int,
        reasons: tuple[str, ...],
        confidence: float | None = None,
    ) -> TrackUpdate:
        track = self._targets[target]
        tracked = track.state is TrackState.TRACKED
        scores = {"inliers": float(count)}
        if track.chain.motion is not None:
            scores["matches"] = float(track.chain.motion.matches)
            scores["residual"] = track.chain.motion.residual_px
        if isinstance(track, _Anchored):
            scores |= track.anchor.scores
            scores |= {"watched": self.watch.coverage, "widened": self.watch.factor}
            spread = self.watch.factor * self.looks.told(spread, track.anchor)
        return TrackUpdate(
            target=target,
            state=track.state,
            position=track.believed[0],
            covariance=spread,
            confidence=self._count(count) if confidence is None else confidence,
            pixel=view.left_camera.project(track.believed[0]) if tracked else np.full(2, np.nan),
            reasons=reasons,
            scores=scores,
        )

    def _get(self, target: str) -> _Target:
        if target not in self._targets:
            known = ", ".join(self._targets) or "none"
            raise TrackerError(f'target "{target}" is not followed; followed: {known}')
        return self._targets[target]


def _designated(
    target: str,
    given: Array | None,
    view: StereoView,
    pixel: npt.ArrayLike | None,
    pixels: tuple[npt.ArrayLike, npt.ArrayLike] | None,
) -> tuple[Array, Array]:
    """Return the pixels of a designated point in both images; NaN in the right one where that is not known.

    Raises
    ------
    TrackerError
        If nothing says where the target is, or it lies behind the cameras.
    """
    if pixels is not None:
        pair = np.asarray(pixels[0], dtype=np.float64), np.asarray(pixels[1], dtype=np.float64)
    elif pixel is not None:
        pair = np.asarray(pixel, dtype=np.float64), np.full(2, np.nan)
    elif given is not None:
        pair = view.left_camera.project(given), view.right_camera.project(given)
    else:
        raise TrackerError(f'target "{target}" needs a position or its pixel')
    if not np.isfinite(pair[0]).all():
        raise TrackerError(f'target "{target}" lies behind the cameras')
    return pair


def _move_key(anchor: Anchor, motion: Motion) -> None:
    """Carry the template's camera and point into the frame as it is believed now."""
    key = anchor.key
    if anchor.drift is not None:
        drift, parallax = anchor.drift
        turn = motion.new_from_old
        anchor.drift = np.asarray(turn.covariance(drift)), np.asarray(turn.rotation @ parallax)
    anchor.key = type(key)(
        key.image,
        key.camera.transformed(motion.new_from_old),
        key.pixel,
        np.asarray(motion.new_from_old.apply(key.point)),
        np.asarray(motion.new_from_old.rotate(key.normal)),
        key.range_m,
        np.asarray(motion.new_from_old.covariance(key.drift)),
        np.asarray(motion.new_from_old.rotation @ key.parallax),
        key.depth_m2,
    )


def _within(covariance: Array, view: StereoView, position: Array, error_m: float) -> float:
    """Return the chance of an error below `error_m` across the line of sight (round: its mean variance)."""
    ray = position - view.left_camera.C
    ray = ray / np.linalg.norm(ray)
    across = np.eye(3) - np.outer(ray, ray)
    variance = 0.5 * float(np.trace(across @ covariance @ across))
    return 1.0 - math.exp(-0.5 * error_m**2 / max(variance, 1e-12))


def _unscented(view: StereoView, left_px: Array, right_px: Array, sigma_px: float) -> Array:
    """Return the covariance of a ranged point by the unscented transform of its four coordinates (eq. 4)."""
    spread = math.sqrt(4.0) * sigma_px
    offsets = np.vstack((np.zeros((1, 4)), spread * np.eye(4), -spread * np.eye(4)))
    points = triangulate(
        view.left_camera, view.right_camera, left_px + offsets[:, :2], right_px + offsets[:, 2:]
    )[0]
    weights = np.array([0.0, *([1.0 / 8.0] * 8)])
    good = np.isfinite(points).all(axis=1)
    if not good.all():
        return np.asarray(
            triangulate(view.left_camera, view.right_camera, left_px[None], right_px[None])[1][0]
        )
    mean = weights @ points
    return np.asarray((weights[:, None] * (points - mean)).T @ (points - mean))
