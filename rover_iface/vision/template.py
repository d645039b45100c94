"""Templates: cut from one view, warped to what another should show, and found there.

Kim et al. 2009, section 4.3. Used by the correlation tracker and wherever a point is carried from one
camera to another.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, CameraModel
from rover_iface.cameras.stereo import PointStereo
from rover_iface.errors import TrackerError
from rover_iface.vision.seen_relief import SeenRelief
from rover_iface.vision.tracker import Image, StereoView

Warp = Literal["none", "scale", "similarity", "plane"]
WHOLE_PX2 = 1.0 / 12.0
"""Variance of a place that is told to the whole pixel."""
NARROWER = 0.6
"""Of a window: what is compared with the whole."""
BACK_SEARCH_PX = 12
"""How far a match is followed back to either side."""
WEIGHT_SHARE = 0.30
"""Spread of an alignment's weights, of its half window: `patch.WEIGHT`, which numba is not loaded for."""
UNKNOWN_SHARE = 0.15
"""Of a template, that may lie outside the picture it is cut from."""
AS_GOOD = 0.02
"""Correlation that tells two places apart: noise of 2 grey levels on a patch of contrast 20 costs 0.01."""
CLEAR = 0.75
"""Surroundings that agree so well need no second look by their ranges."""


@dataclass(frozen=True, slots=True)
class NccOptions:
    """Parameters of the tracker.

    Attributes
    ----------
    template_px, search_px
        Window (21) and search to either side of the prediction (61).
    warp
        What is done to the template: nothing, scale (eq. 6), scale and roll (eqs. 6 to 10), plane.
    score_limit, stereo_limit
        First and second criterion of loss.
    disparity_error_px
        3-sigma stereo error of the range tolerance (third criterion, eq. 1).
    odometry_share
        What the pose estimate may be off, share of the distance (third and fourth criterion).
    lost_updates
        N: updates allowed in LOST before FAILED.
    adjacent_m
        k of eq. 10.
    context_px
        Window over which the best peaks are compared.
    surroundings_px, surroundings_limit
        Window whose content tells one stone from another, 0 for no such test, and the correlation that it
        needs. On tuning seeds (`studies.domains`) 99 % of the right matches over two or three stops have 0.61
        and more; what was locked on falsely had 0.34 at most.
    identity_limit
        Mean of the margins of correlation, surroundings and range below which it is another stone. On tuning
        seeds 1,081 right matches have 0.57 and more, the one false lock 0.07.
    relief_slope
        Of a rock against the plane of its face, tangent: so much deeper or higher than told a place lies for
        each metre that it lies astray, and a spot against the window round it. On tuning seeds 0 to 7 of
        `studies.domains` 0.5 lets the 95 % ellipsoid hold 97.4 and 96.3 % of the errors, 0.9 98 and 99 %.
    shape_sd
        What the shape of a template may be off, by a slant that stereo tells badly (tangent times the turn).
    most_px
        How far an alignment may move.
    least_px
        What a place is never better than: bias of interpolation between pixels.
    """

    template_px: int = 21
    search_px: int = 61
    warp: Warp = "plane"
    coarse: bool = True
    subpixel: bool = True
    key_template: bool = True
    rerank: bool = True
    back_check_px: float = 2.5
    score_limit: float = 0.7
    stereo_limit: float = 0.7
    disparity_error_px: float = 1.0
    odometry_share: float = 0.15
    lost_updates: int = 2
    adjacent_m: float = 0.05
    context_px: int = 41
    shape_sd: float = 0.10
    most_px: float = 2.5
    least_px: float = 0.05
    surroundings_px: int = 61
    surroundings_limit: float = 0.5
    identity_limit: float = 0.35
    relief_slope: float = 0.5
    stereo: PointStereo = field(default_factory=PointStereo)

    def __post_init__(self) -> None:
        if self.template_px < 7 or self.template_px % 2 == 0 or self.context_px % 2 == 0:
            raise TrackerError(
                f"template is {self.template_px} px, its context {self.context_px} px; odd, from 7, is needed"
            )
        if self.context_px < self.template_px:
            raise TrackerError(
                f"context of {self.context_px} px is less than the template of {self.template_px}"
            )
        if not (self.search_px >= 3 and self.lost_updates >= 0):
            raise TrackerError(f"search is {self.search_px} px, N is {self.lost_updates}; at least 3 and 0")

    @classmethod
    def as_flown(cls, warp: Warp = "similarity") -> NccOptions:
        """Return the published tracker: whole pixels, template of the last stop, best peak believed."""
        return cls(
            warp=warp,
            subpixel=False,
            key_template=False,
            rerank=False,
            back_check_px=math.inf,
            surroundings_px=0,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Template:
    """A view of the target that templates are cut from.

    Attributes
    ----------
    point, normal
        (3,), of the surface under `pixel`, frame of the camera.
    drift
        (3, 3), m^2, covariance of how far that spot lies from the one that was designated, by matches that
        err independently.
    parallax
        (3, 2), metres, one standard deviation, by image axis, of what it lies off besides, by the depth
        of the spot against its surroundings: a rock bulges one way, so the templates of a chain err together.
    depth_m2
        Variance of the depth of that spot against what surrounds it, along the line of sight.
    ranged_m2
        Variance of that depth where the surroundings are taken by what stereo ranges, not as a plane.
    relief
        What the stereo pair of that view ranges, if it is kept.
    """

    image: Image
    camera: CameraModel
    pixel: Array
    point: Array
    normal: Array
    range_m: float
    drift: Array = field(default_factory=lambda: np.zeros((3, 3)))
    parallax: Array = field(default_factory=lambda: np.zeros((3, 2)))
    depth_m2: float = 0.0
    ranged_m2: float = 0.0
    relief: SeenRelief | None = None

    @property
    def uncertainty(self) -> Array:
        """Return the covariance (3, 3), m^2, of the spot against the designated one, all told."""
        return np.asarray(self.drift + self.parallax @ self.parallax.T)


def template_scale(range_old_m: float, range_new_m: float) -> float:
    """Return the factor by which the template must be enlarged after a rover move.

    Parameters
    ----------
    range_old_m, range_new_m
        Distance from the left camera's centre to the target before and after the move, metres, both positive.
        The factor exceeds 1 on approach.

    Raises
    ------
    TrackerError
        If either range is not positive.

    Notes
    -----
    Kim et al. 2009, eq. 6.
    """
    if not (range_old_m > 0 and range_new_m > 0):
        raise TrackerError(f"ranges {range_old_m} m and {range_new_m} m must be positive")
    return range_old_m / range_new_m


def template_roll(
    old: CameraModel, new: CameraModel, point: npt.ArrayLike, adjacent_m: float = 0.05
) -> float:
    """Return the angle by which the template must be turned, radians, clockwise positive (y points down).

    Parameters
    ----------
    old, new
        Cameras before and after the move, in one frame.
    point
        (3,), m, the target in that frame.

    Raises
    ------
    TrackerError
        If the target is not in front of the new camera.

    Notes
    -----
    Kim et al. 2009, eqs. 7 to 10: a point beside the target, along the rows of the old camera, is projected
    by the new one. The old camera is used as if its axis pointed at the target, as the mast makes it do.
    """
    target = np.asarray(point, dtype=np.float64)
    beside = target + adjacent_m * old.horizontal  # eq. 10, with eq. 9
    pixels = new.project(np.stack((target, beside)))
    if not np.isfinite(pixels).all():
        raise TrackerError("target is behind the camera: no roll can be told")
    before = old.project(np.stack((target, beside)))
    turn = pixels[1] - pixels[0]
    start = before[1] - before[0]
    if not np.isfinite(start).all():
        return math.atan2(turn[1], turn[0])
    return math.atan2(turn[1], turn[0]) - math.atan2(start[1], start[0])


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Where a template has been found: pixel (2,), correlation, covariance (2, 2), px^2, of the place."""

    pixel: Array
    score: float
    spread: Array


@dataclass(frozen=True, slots=True)
class TemplateMatcher:
    """Predicts how a template looks from elsewhere and finds it there. Pure."""

    options: NccOptions

    def predict(self, source: Template, camera: CameraModel, center: Array, point: Array) -> Image | None:
        """Return what the target should look like round `center` [2], px, context included; None when
        unknown.

        The image is [context_px, context_px], in brightness of the source; `point` [3] is the target in the
        frame of `camera`, m.
        """
        from rover_iface.vision import patch

        options = self.options
        half = options.context_px // 2
        out = np.empty((options.context_px, options.context_px), np.float32)
        distance = float(np.linalg.norm(point - camera.C))
        scale = template_scale(source.range_m, distance) * camera.hs / source.camera.hs
        warp = options.warp
        if warp == "plane":
            toward = (camera.C - point) / distance
            toward_old = (source.camera.C - source.point) / source.range_m
            if min(toward @ source.normal, toward_old @ source.normal) < 0.15:
                warp = "similarity"
        if warp == "plane":
            samples = 1 if scale > 0.8 else 2 if scale > 0.4 else 3
            patch.plane_template(
                source.image,
                source.camera.packed,
                source.pixel,
                camera.packed,
                center,
                point,
                source.normal,
                source.point,
                half,
                samples,
                out,
            )
        else:
            roll = 0.0
            if warp == "similarity":
                roll = template_roll(source.camera, camera, point, options.adjacent_m)
            patch.similarity_template(
                source.image, source.pixel, 1.0 if warp == "none" else scale, roll, half, out
            )
        inner = options.template_px // 2
        core = out[half - inner : half + inner + 1, half - inner : half + inner + 1]
        return None if np.isnan(core).mean() > UNKNOWN_SHARE else out

    def search(self, image: Image, template: Image, prediction: Array) -> Found | None:
        """Return the best match within the search window round `prediction` [2], px; None where there is
        none.

        `image` is [rows, columns], `template` [context_px, context_px], as `predict` returns it.
        """
        from rover_iface.vision import patch

        options = self.options
        half, middle = options.template_px // 2, options.context_px // 2
        cut = self._cut(image, template, prediction, options.search_px)
        if cut is None:
            return None
        core, region, left, top = cut
        peaks = _coarse_to_fine(region, core) if options.coarse else _peaks(region, core)
        if not peaks:
            return None
        best: tuple[float, Array] | None = None
        for x, y, score in peaks if options.rerank else peaks[:1]:
            at = np.array([x + left + half, y + top + half], dtype=np.float64)
            rank = score
            if options.rerank:
                wide = patch.correlation(image, template, at[0], at[1], middle)
                if wide > -1.5:
                    rank = 0.5 * score + 0.5 * wide
                away = float(np.hypot(*(at - prediction))) / 61.0
                rank -= 0.05 * away
            if best is None or rank > best[0]:
                best = (rank, at)
        assert best is not None
        at = best[1]
        if options.subpixel:
            score, spread = self.align(image, template, at, half)
        else:
            score = float(patch.correlation(image, template, at[0], at[1], half))
            spread = WHOLE_PX2 * np.eye(2)
        return Found(at, score, spread)

    def align(self, image: Image, template: Image, at: Array, half: int) -> tuple[float, Array]:
        """Move `at` to the best place within a few pixels; return the score and the covariance (2, 2), px^2.

        Where no place fits, `at` stays, and the covariance is that of the window.

        `image` and `template` are [rows, columns]; `at` (2,) is a pixel of the image, `half` that of the
        window, px.
        """
        from rover_iface.vision import patch

        fitted = self.fit(image, template, at, half)
        if fitted is not None:
            return fitted
        score = patch.correlation(image, template, float(at[0]), float(at[1]), half)
        return float(score), float(half**2) * np.eye(2)

    def fit(self, image: Image, template: Image, at: Array, half: int) -> tuple[float, Array] | None:
        """Do what `align` does; None, and `at` [2] stays, where no place fits: that measures nothing.

        Images are [rows, columns].
        """
        from rover_iface.vision import patch

        spread = np.empty((2, 2))
        options = self.options
        score = patch.align_shape(image, template, at, half, options.shape_sd, options.most_px, spread)
        if score < -1.0 or not np.isfinite(spread).all():
            return None
        # what surrounds the spot leads a wide window: a narrower one tells by how much
        inner, narrow = at.copy(), np.empty((2, 2))
        less = max(4, round(NARROWER * half))
        if patch.align_shape(image, template, inner, less, options.shape_sd, options.most_px, narrow) > -1.0:
            spread += 0.5 * float((inner - at) @ (inner - at)) * np.eye(2)
        return float(score), spread + options.least_px**2 * np.eye(2)

    def surroundings(self, source: Template, view: StereoView, at: Array, point: Array) -> float | None:
        """Return how alike the wide surroundings of a match and of a template's spot are, -1 to 1.

        `at` (2,), px, and `point` (3,), m, frame of the cameras, are the pixel and the surface point of the
        match. Scale and roll alone are taken out at first: the ground round a rock does not lie in the plane
        of its face. Where that leaves a doubt, the template's view is seen through its own ranges from where
        the rover is now, and the better of both counts. None where either reaches too far out of its picture.
        """
        from rover_iface.vision import patch

        half = self.options.surroundings_px // 2
        camera = view.left_camera
        distance = float(np.linalg.norm(source.point - camera.C))
        scale = template_scale(source.range_m, distance) * camera.hs / source.camera.hs
        roll = template_roll(source.camera, camera, source.point, self.options.adjacent_m)
        out = np.empty((2 * half + 1, 2 * half + 1), np.float32)
        patch.similarity_template(source.image, source.pixel, scale, roll, half, out)
        score = float(patch.correlation(view.left, out, float(at[0]), float(at[1]), half))
        if score < CLEAR and source.relief is not None:
            seen = source.relief.seen_by(camera, point, point - source.point, half)
            if seen is not None:
                score = max(
                    score, float(patch.correlation(view.left, seen, float(at[0]), float(at[1]), half))
                )
        return None if score < -1.0 else score

    def back_error(self, now: Template, before: Template) -> float:
        """Return how far the patch of `now`, searched in the old image, ends from its place, px.

        0 where that cannot be told: a patch that does not fit into the old image speaks against nothing. A
        better place elsewhere counts only if the patch, its shape left free as in the search forwards, does
        not fit as well at its own: a slant that is off by some degrees moves the peak of whole pixels.
        """
        template = self._seen_before(now, before)
        if template is None:
            return 0.0
        found = self._nearby(before.image, template, before.pixel)
        away = 0.0 if found is None else float(np.hypot(*(found - before.pixel)))
        if found is None or away <= self.options.back_check_px or not self.options.subpixel:
            return away
        half = self.options.template_px // 2
        own, other = before.pixel.copy(), found
        own_score, _ = self.align(before.image, template, own, half)
        other_score, _ = self.align(before.image, template, other, half)
        return float(np.hypot(*(own - before.pixel))) if own_score >= other_score - AS_GOOD else away

    def _seen_before(self, now: Template, before: Template) -> Image | None:
        """Return what the old view should show of `now`: by its ranges, if any, else over its plane."""
        if now.relief is not None:
            half, inner = self.options.context_px // 2, self.options.template_px // 2
            seen = now.relief.seen_by(before.camera, before.point, before.point - now.point, half)
            middle = slice(half - inner, half + inner + 1)
            if seen is not None and np.isnan(seen[middle, middle]).mean() <= UNKNOWN_SHARE:
                return seen
        return self.predict(now, before.camera, before.pixel, before.point)

    def _nearby(self, image: Image, template: Image, at: Array) -> Array | None:
        import cv2

        cut = self._cut(image, template, at, BACK_SEARCH_PX)
        if cut is None:
            return None
        core, region, left, top = cut
        half = self.options.template_px // 2
        _, _, _, place = cv2.minMaxLoc(cv2.matchTemplate(region, core, cv2.TM_CCOEFF_NORMED))
        return np.array([place[0] + left + half, place[1] + top + half], dtype=np.float64)

    def _cut(
        self, image: Image, template: Image, at: Array, reach_px: int
    ) -> tuple[Image, Image, int, int] | None:
        """Return the middle of a template, what of the image it is compared with, and where that begins.

        None without contrast, or when the template does not fit into the image there.
        """
        half, middle = self.options.template_px // 2, self.options.context_px // 2
        core = template[middle - half : middle + half + 1, middle - half : middle + half + 1]
        core = np.where(np.isnan(core), np.nanmean(core), core).astype(np.float32)
        x, y, far = round(at[0]), round(at[1]), reach_px + half
        left, top = max(0, x - far), max(0, y - far)
        region = image[top : max(0, y + far + 1), left : max(0, x + far + 1)]
        if min(region.shape) < self.options.template_px or float(core.std()) < 1e-4:
            return None
        return core, region, left, top


def _peaks(region: Image, core: Image, count: int = 8) -> list[tuple[int, int, float]]:
    """Return the best places (upper left corner, x, y) and scores, at least 4 px apart."""
    import cv2

    score = cv2.matchTemplate(region, core, cv2.TM_CCOEFF_NORMED)
    found: list[tuple[int, int, float]] = []
    for _ in range(count):
        _, value, _, (x, y) = cv2.minMaxLoc(score)
        if not value > -0.99 or (found and value < found[0][2] - 0.35):
            break
        found.append((int(x), int(y), float(value)))
        score[max(0, y - 4) : y + 5, max(0, x - 4) : x + 5] = -1.0
    return found


def _coarse_to_fine(region: Image, core: Image, count: int = 8) -> list[tuple[int, int, float]]:
    """Return what `_peaks` does, from a search at half resolution first. Kim et al. 2009, section 4.3.2."""
    import cv2

    rows, columns = region.shape
    even = region[: rows // 2 * 2, : columns // 2 * 2]
    small = cv2.resize(even, (columns // 2, rows // 2), interpolation=cv2.INTER_AREA)
    side = core.shape[0] // 2 * 2
    small_core = cv2.resize(core[:side, :side], (side // 2, side // 2), interpolation=cv2.INTER_AREA)
    if small.shape[0] < small_core.shape[0] or small.shape[1] < small_core.shape[1]:
        return _peaks(region, core, count)
    found: list[tuple[int, int, float]] = []
    for x, y, _ in _peaks(small, small_core, count + 4):
        left, top = max(0, 2 * x - 3), max(0, 2 * y - 3)
        part = region[top : 2 * y + 4 + core.shape[0], left : 2 * x + 4 + core.shape[1]]
        if part.shape[0] < core.shape[0] or part.shape[1] < core.shape[1]:
            continue
        _, value, _, (i, j) = cv2.minMaxLoc(cv2.matchTemplate(part, core, cv2.TM_CCOEFF_NORMED))
        place = (left + int(i), top + int(j), float(value))
        if all(abs(place[0] - p[0]) + abs(place[1] - p[1]) > 2 for p in found):
            found.append(place)
    found.sort(key=lambda p: -p[2])
    return found[:count]


def grown_drift(
    source: Template, camera: CameraModel, point: Array, normal: Array, spread_px2: Array
) -> tuple[Array, Array]:
    """Return drift (3, 3), m^2, and parallax (3, 2), m, of the point (3,) that a template of `source` was
    matched with.

    All in the frame of the cameras. What the source had drifted, the covariance (2, 2), px^2, of the match
    itself, and parallax: what surrounds the spot led the match, and as the line of sight turns it moves
    against the spot by the depth between them.
    """
    jacobian = camera.jacobian(point)
    out = on_plane(camera, point, normal, jacobian)
    aside = parallax_px(source, camera, point)
    return np.asarray(source.drift + out @ spread_px2 @ out.T), np.asarray(source.parallax + aside * out)


def parallax_px(source: Template, camera: CameraModel, point: Array) -> float:
    """Return what a match is off by the depth of a spot against its surroundings, pixels, either axis.

    `point` [3] is the spot in the frame of `camera`, m.
    """
    ray = source.point - source.camera.C
    aside = camera.jacobian(point) @ (ray / np.linalg.norm(ray))
    return math.sqrt(0.5 * source.depth_m2) * float(np.linalg.norm(aside))


def on_plane(camera: CameraModel, point: Array, normal: Array, jacobian: Array) -> Array:
    """Return how a point on a plane (facing the camera, if it is too steep) moves (3, 2) with its pixel.

    In m/px; `point` and the unit `normal` (3,) are in the frame of `camera`, `jacobian` (2, 3) is that of
    `point`, px/m.
    """
    toward = camera.C - point
    toward = toward / np.linalg.norm(toward)
    if toward @ normal < 0.3:
        normal = toward
    helper = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    first = np.cross(normal, helper)
    first /= np.linalg.norm(first)
    along = np.stack((first, np.cross(normal, first)), axis=1)
    return np.asarray(along @ np.linalg.inv(jacobian @ along))
