"""The feature tracker: SIFT points ranged by stereo carry all targets from stop to stop.

Pedersen, Deans, Lees and others 2006 (K9): features of both images of a pair are matched to 3-D points,
those to the points of the last stop, a rigid motion is found by RANSAC (100 draws of three points, Horn's
method, inliers within 3 cm) and refitted until the consensus is stable; each target moves with it. Two
things differ from the publication. An inlier is told in pixels of both images as well as in metres, because
three centimetres mean nothing where stereo errs by ten; and the motion is refined on those pixels, which
also gives its covariance (`method="published"` switches to the metric consensus with bootstrap covariance).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo import triangulate
from rover_iface.errors import TrackerError
from rover_iface.frames import Transform
from rover_iface.vision.tracker import Image, StereoView, TrackState, TrackUpdate


@dataclass(frozen=True, slots=True)
class SiftOptions:
    """Parameters of the feature tracker.

    Attributes
    ----------
    features
        Strongest features kept per image.
    ratio
        Best over second-best descriptor distance.
    row_px
        How far a left-right match may be from its epipolar line.
    gate_px
        How far a feature may be from where the pose estimate puts it.
    tau_m, draws
        Consensus distance and number of RANSAC draws (published: 3 cm, 100).
    inlier_px
        Consensus distance in the images.
    slope, half_count
        a and N of the confidence 1 / (1 + exp(-a (n - N))) (the sign of eq. 7 as printed is wrong).
    least
        Inliers without which the update counts as lost.
    lost_updates
        Updates allowed in LOST (published: 4 to 5).
    sigma_px
        Error of a feature's coordinates.
    """

    method: Literal["pixel", "published"] = "pixel"
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
    sigma_px: float = 0.5
    bootstrap: int = 60

    def __post_init__(self) -> None:
        if self.features < 20 or self.draws < 1 or self.least < 4:
            raise TrackerError(
                f"feature tracker with {self.features} features, {self.draws} draws, {self.least} inliers; "
                "at least 20, 1 and 4 are needed"
            )


@dataclass(frozen=True, eq=False)
class Features:
    """Ranged features of one stop: points (n, 3), pixels in both images (n, 2), descriptors (n, 128)."""

    points: Array
    left_px: Array
    right_px: Array
    descriptors: npt.NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, eq=False)
class Motion:
    """How the rover's idea of the site has moved between two stops.

    Attributes
    ----------
    new_from_old
        Where points believed at the earlier stop are believed now.
    covariance
        (6, 6): turn (3, radians, about `centre`) and shift (3, metres).
    inliers
        How many features agree.
    """

    new_from_old: Transform
    covariance: Array
    centre: Array
    inliers: int


@dataclass(slots=True)
class _Target:
    position: Array
    covariance: Array
    state: TrackState = TrackState.TRACKED
    misses: int = 0


class SiftTracker:
    """Feature tracker (a `Tracker`); targets share the features of each stop.

    Its confidence is 1 / (1 + exp(-a (n - N))) of the number n of features that agree on the motion: 0.5 at
    N = 30. A stop whose features do not match keeps the last good ones, and the target stays where dead
    reckoning has it.
    """

    def __init__(self, options: SiftOptions | None = None) -> None:
        self.options = options or SiftOptions()
        self._targets: dict[str, _Target] = {}
        self._features: Features | None = None
        self._view: StereoView | None = None
        self._motion: Motion | None = None
        self._stop = 0

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
        pixels: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    ) -> TrackUpdate:
        """Begin to follow a point, given as position (3,) or as its pixels in both images."""
        if target in self._targets:
            raise TrackerError(f'target "{target}" is followed already; clear it first')
        if pixels is None:
            if position is None:
                raise TrackerError(f'target "{target}" needs a position or its pixels')
            point = np.asarray(position, dtype=np.float64)
            pair = view.left_camera.project(point), view.right_camera.project(point)
        else:
            pair = np.asarray(pixels[0], dtype=np.float64), np.asarray(pixels[1], dtype=np.float64)
            point = triangulate(view.left_camera, view.right_camera, pair[0][None], pair[1][None])[0][0]
        if not (np.isfinite(pair[0]).all() and np.isfinite(pair[1]).all() and np.isfinite(point).all()):
            raise TrackerError(f'target "{target}" lies behind the cameras')
        if self._view is not view:
            if self._targets:
                raise TrackerError(f'target "{target}" must be started on the view of the last update')
            self._features = self.find(view)
            self._view, self._motion = view, None
        assert self._features is not None
        if len(self._features) < self.options.least:
            raise TrackerError(
                f"only {len(self._features)} features could be ranged; {self.options.least} are needed"
            )
        spread = _unscented(view, pair[0], pair[1], self.options.sigma_px)
        self._targets[target] = _Target(point, spread)
        return self._answer(target, view, len(self._features), ())

    def update(self, target: str, view: StereoView) -> TrackUpdate:
        """Move a target with the motion of the features; the first target of a stop pays for all."""
        track = self._get(target)
        if self._view is not view:
            self._advance(view)
        if track.state is TrackState.FAILED:
            return self._answer(target, view, 0, ("failed earlier; clear it first",))
        count = 0 if self._motion is None else self._motion.inliers
        reasons: tuple[str, ...] = ()
        if self._motion is None or count < self.options.least:
            reasons = (f"{count} features agree on the motion; {self.options.least} are needed",)
        if reasons:
            track.misses += 1
            failed = track.misses > self.options.lost_updates
            track.state = TrackState.FAILED if failed else TrackState.LOST
        else:
            track.misses, track.state = 0, TrackState.TRACKED
        return self._answer(target, view, count, reasons)

    def predicted(self, target: str) -> Array:
        """Return where the target is believed to be."""
        return self._get(target).position

    def clear(self, target: str) -> None:
        """Forget a target."""
        self._get(target)
        del self._targets[target]

    def _advance(self, view: StereoView) -> None:
        """Find the motion to a new stop and move every target that is not failed."""
        assert self._features is not None
        self._stop += 1
        self._view = view
        fresh = self.find(view)
        self._motion = self.motion(self._features, fresh, view, seed=self._stop)
        if self._motion is None:
            return
        motion = self._motion
        for track in self._targets.values():
            if track.state is TrackState.FAILED:
                continue
            moved: Array = np.asarray(motion.new_from_old.apply(track.position))
            arm: Array = np.asarray(moved - motion.centre)
            jacobian: Array = np.hstack((-_cross(arm), np.eye(3)))
            grown = jacobian @ motion.covariance @ jacobian.T
            track.covariance = np.asarray(motion.new_from_old.covariance(track.covariance) + grown)
            track.position = moved
        self._features = fresh

    def _answer(self, target: str, view: StereoView, count: int, reasons: tuple[str, ...]) -> TrackUpdate:
        track = self._targets[target]
        options = self.options
        tracked = track.state is TrackState.TRACKED
        pixel = view.left_camera.project(track.position) if tracked else np.full(2, np.nan)
        return TrackUpdate(
            target=target,
            state=track.state,
            position=track.position,
            covariance=track.covariance,
            confidence=1.0 / (1.0 + math.exp(-options.slope * (count - options.half_count))),
            pixel=pixel,
            reasons=reasons,
            scores={"inliers": float(count)},
        )

    def _get(self, target: str) -> _Target:
        if target not in self._targets:
            known = ", ".join(self._targets) or "none"
            raise TrackerError(f'target "{target}" is not followed; followed: {known}')
        return self._targets[target]

    # ---- features and motion

    def find(self, view: StereoView) -> Features:
        """Return the features of a pair that both images show, as points."""
        left = _detect(view.left, self.options.features)
        right = _detect(view.right, self.options.features)
        none = np.empty((0, 2))
        if len(left[0]) < 2 or len(right[0]) < 2:
            return Features(np.empty((0, 3)), none, none, np.empty((0, 128), np.float32))
        pairs = _mutual(left[1], right[1], self.options.ratio)
        a, b = left[0][pairs[:, 0]], right[0][pairs[:, 1]]
        points, _ = triangulate(view.left_camera, view.right_camera, a, b)
        miss = np.hypot(*(view.left_camera.project(points) - a).T)
        miss += np.hypot(*(view.right_camera.project(points) - b).T)
        with np.errstate(invalid="ignore"):
            near = np.linalg.norm(points - view.left_camera.C, axis=1) < 60.0
            good = np.isfinite(miss) & (miss < self.options.row_px) & near
        return Features(points[good], a[good], b[good], left[1][pairs[good, 0]])

    def motion(self, old: Features, new: Features, view: StereoView, *, seed: int) -> Motion | None:
        """Return the motion that most features agree on, or None when fewer than four do."""
        if len(old) < 4 or len(new) < 4:
            return None
        pairs = _mutual(old.descriptors, new.descriptors, self.options.ratio)
        expected = view.left_camera.project(old.points[pairs[:, 0]])
        with np.errstate(invalid="ignore"):
            close = np.hypot(*(expected - new.left_px[pairs[:, 1]]).T) < self.options.gate_px
        pairs = pairs[close]
        if len(pairs) < 4:
            return None
        p, q = old.points[pairs[:, 0]], new.points[pairs[:, 1]]
        left_px, right_px = new.left_px[pairs[:, 1]], new.right_px[pairs[:, 1]]
        published = self.options.method == "published"

        def agreeing(guess: Transform) -> npt.NDArray[np.bool_]:
            moved = guess.apply(p)
            metric = np.linalg.norm(moved - q, axis=1) < self.options.tau_m
            if published:
                return np.asarray(metric)
            away = np.hypot(*(view.left_camera.project(moved) - left_px).T)
            other = np.hypot(*(view.right_camera.project(moved) - right_px).T)
            with np.errstate(invalid="ignore"):
                return np.asarray((away < self.options.inlier_px) & (other < self.options.inlier_px))

        rng = np.random.default_rng([seed, len(pairs)])
        best = np.zeros(len(pairs), dtype=bool)
        for _ in range(self.options.draws):
            pick = rng.choice(len(pairs), 3, replace=False)
            guess = horn(p[pick], q[pick])
            if guess is None:
                continue
            found = agreeing(guess)
            if found.sum() > best.sum():
                best = found
        if best.sum() < 4:
            return None
        fit: Transform | None = None
        for _ in range(10):
            fit = horn(p[best], q[best])
            if fit is None:
                return None
            if not published:
                fit = _refine(fit, p[best], left_px[best], right_px[best], view)[0]
            again = agreeing(fit)
            if again.sum() < 4 or np.array_equal(again, best):
                break
            best = again
        assert fit is not None
        centre = np.asarray(fit.apply(p[best]).mean(axis=0))
        if published:
            covariance = _bootstrap(p[best], q[best], fit, centre, self.options.bootstrap, rng)
        else:
            fit, covariance = _refine(fit, p[best], left_px[best], right_px[best], view)
        return Motion(fit, covariance, centre, int(best.sum()))


def horn(p: Array, q: Array) -> Transform | None:
    """Return the rigid motion that brings points p (n, 3) nearest to q, or None for degenerate ones.

    Horn 1987 by way of the singular value decomposition.
    """
    a, b = p.mean(axis=0), q.mean(axis=0)
    u, s, vt = np.linalg.svd((p - a).T @ (q - b))
    if s[1] < 1e-12:
        return None
    d = np.sign(np.linalg.det(vt.T @ u.T))
    rotation = vt.T @ np.diag([1.0, 1.0, d]) @ u.T
    return Transform(rotation, b - rotation @ a)


def _refine(
    guess: Transform, p: Array, left_px: Array, right_px: Array, view: StereoView
) -> tuple[Transform, Array]:
    """Return the motion that fits both images best, and its covariance about the points' middle."""
    rotation, translation = guess.rotation, guess.translation
    normal_matrix: Array = np.eye(6)
    variance = 1.0
    for _ in range(6):
        moved = p @ rotation.T + translation
        centre = moved.mean(axis=0)
        blocks, residuals = [], []
        for camera, seen in ((view.left_camera, left_px), (view.right_camera, right_px)):
            slope = camera.jacobian(moved)
            turn = -np.stack([_cross(v) for v in moved - centre])
            blocks.append(np.concatenate((slope @ turn, slope), axis=2))
            residuals.append(seen - camera.project(moved))
        j = np.concatenate(blocks).reshape(-1, 6)
        r = np.concatenate(residuals).ravel()
        good = np.isfinite(r) & np.isfinite(j).all(axis=1)
        j, r = j[good], r[good]
        weight = 1.0 / np.maximum(1.0, np.abs(r) / 0.8)
        normal_matrix = (j * weight[:, None]).T @ j + 1e-9 * np.eye(6)
        step: Array = np.asarray(np.linalg.solve(normal_matrix, (j * weight[:, None]).T @ r))
        variance = float((weight * r * r).sum() / max(1, len(r) - 6))
        small = _rotation(step[:3])
        rotation = small @ rotation
        translation = small @ (translation - centre) + centre + step[3:]
        if np.abs(step).max() < 1e-8:
            break
    u, _, vt = np.linalg.svd(rotation)
    # the old points carry stereo errors of their own: both ends of the motion count
    return Transform(u @ vt, translation), np.asarray(2.0 * variance * np.linalg.inv(normal_matrix))


def _bootstrap(
    p: Array, q: Array, fit: Transform, centre: Array, sets: int, rng: np.random.Generator
) -> Array:
    """Return the covariance of the motion over sets of inliers drawn with replacement (as published)."""
    rows = []
    for _ in range(sets):
        pick = rng.integers(len(p), size=len(p))
        other = horn(p[pick], q[pick])
        if other is None:
            continue
        change = other.rotation @ fit.rotation.T
        turn = 0.5 * np.array(
            [change[2, 1] - change[1, 2], change[0, 2] - change[2, 0], change[1, 0] - change[0, 1]]
        )
        middle = fit.inverse().apply(centre)
        rows.append(np.concatenate((turn, other.apply(middle) - centre)))
    return np.asarray(np.cov(np.array(rows).T)) if len(rows) > 6 else np.eye(6)


def _detect(image: Image, count: int) -> tuple[Array, npt.NDArray[np.float32]]:
    import cv2

    low, high = np.percentile(image, (0.5, 99.5))
    grey = np.clip(255.0 * (image - low) / max(1e-6, float(high - low)), 0, 255).astype(np.uint8)
    found, descriptors = cv2.SIFT.create(nfeatures=count).detectAndCompute(grey, None)
    if descriptors is None or not found:
        return np.empty((0, 2)), np.empty((0, 128), np.float32)
    return np.array([k.pt for k in found], dtype=np.float64), np.asarray(descriptors, dtype=np.float32)


def _mutual(a: npt.NDArray[np.float32], b: npt.NDArray[np.float32], ratio: float) -> npt.NDArray[np.int64]:
    """Return index pairs (n, 2) of descriptors that are each other's nearest and clearly so."""
    if len(a) < 2 or len(b) < 2:
        return np.empty((0, 2), np.int64)
    distance = (a * a).sum(1)[:, None] + (b * b).sum(1)[None] - 2.0 * (a @ b.T)
    first = distance.argmin(axis=1)
    rows = np.arange(len(a))
    best = distance[rows, first]
    second = np.partition(distance, 1, axis=1)[:, 1]
    back = distance.argmin(axis=0)
    keep = (back[first] == rows) & (np.maximum(best, 0) < ratio**2 * second)
    return np.column_stack((rows[keep], first[keep]))


def _unscented(view: StereoView, left_px: Array, right_px: Array, sigma_px: float) -> Array:
    """Return the covariance of a ranged point by the unscented transform of its four coordinates."""
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


def _cross(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _rotation(turn: Array) -> Array:
    angle = float(np.linalg.norm(turn))
    if angle < 1e-12:
        return np.eye(3) + _cross(turn)
    k = _cross(turn / angle)
    return np.asarray(np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * (k @ k))
