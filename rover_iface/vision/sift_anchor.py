"""What the pictures say of one target once the features have told the motion.

The motion of hundreds of features carries a target without looking at it. Two looks take the drift out. Point
stereo at the expected pixel finds the surface that the target lies on, which is sharper with every metre
driven: a position update along the surface's normal. A template of an earlier stop, warped over that surface,
finds the spot itself: an update across the line of sight. Both are weighted by their covariance and passed
over when they disagree with the motion by more than chance allows (something in front, a shadow's edge).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo import PointMatch, point_stereo
from rover_iface.errors import TrackerError
from rover_iface.vision.first_view import require_range
from rover_iface.vision.narrow_range import KnownRange
from rover_iface.vision.template import (
    Found,
    NccOptions,
    Template,
    TemplateMatcher,
    grown_drift,
    parallax_px,
)
from rover_iface.vision.tracker import StereoView

Drift = tuple[Array, Array]
KEY_SCALE = 1.5
TEMPLATE_PX = 21
GATE_SIGMAS, MOST_SEARCH_PX = 3.0, 20
"""How far a template is looked for, of what the position may be off, and at most."""


@dataclass(frozen=True, slots=True)
class AnchorOptions:
    """How far the looks at the target itself are believed.

    Attributes
    ----------
    least_stereo, least_look
        Correlation below which a look says nothing.
    good_look
        Correlation that a template should have; below it another slant is tried, and the place is less sure.
    gate_sigma
        Disagreement at which a look is passed over.
    sharper
        How many times less sure than what is known a range may be and still be weighed. Ranges looked up from
        about one place err alike (what lies behind an edge pulls them all one way), so a blunter one is only
        compared.
    """

    least_stereo: float = 0.7
    least_look: float = 0.6
    good_look: float = 0.9
    gate_sigma: float = 3.5
    sharper: float = 2.0


@dataclass(slots=True)
class Anchor:
    """What is remembered of a target's looks: its face and the template of an earlier stop.

    `shared` (3, 3), m^2, is what the latest looks err by together with those before them: more looks do not
    shrink it, so it is kept out of the weights and added to the covariance that is told.
    """

    normal: Array
    key: Template
    shared: Array
    drift: Drift | None = None
    scores: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Looks:
    """Takes the looks. Pure but for the `Anchor` that it is given."""

    options: AnchorOptions

    def _stereo(
        self, view: StereoView, pixel: Array, range_m: float | None, spread: float
    ) -> PointMatch | None:
        match = point_stereo(
            view.left,
            view.right,
            view.left_camera,
            view.right_camera,
            pixel,
            expected_range_m=range_m,
            range_spread=spread,
        )
        return match if match is not None and match.score >= self.options.least_stereo else None

    def begin(
        self,
        target: str,
        view: StereoView,
        pixel: Array,
        given: Array | None,
        known: KnownRange | None = None,
    ) -> tuple[Array, Array, Anchor]:
        """Return position (3,), m, covariance (3, 3), m^2, and anchor of the surface under a pixel (2,).

        A range that is `known` better from elsewhere moves the position along the line of sight. All in the
        frame of the view's cameras.

        Raises
        ------
        TrackerError
            If its own patch cannot be ranged, or is ranged elsewhere than where the target was designated
            (`given` (3,)): what is not seen by stereo is not tracked.
        """
        expected = None if given is None else float(np.linalg.norm(given - view.left_camera.C))
        match = self._stereo(view, pixel, expected if known is None else known.range_m, 0.9)
        if match is None:
            raise TrackerError(
                f'target "{target}" at pixel ({pixel[0]:.1f}, {pixel[1]:.1f}) could not be ranged'
            )
        if given is not None and known is None:
            require_range(target, view, given, match)
        point, covariance = match.point, match.surface_covariance + _pointing(view, match.point)
        if known is not None:
            ray = point - view.left_camera.C
            away = float(np.linalg.norm(ray))
            point, covariance, _ = _along(
                point, covariance, ray / away, known.range_m - away, known.sigma_m**2
            )
        key = _template(view, pixel, match)
        return point, covariance, Anchor(match.normal, key, np.zeros((3, 3)))

    def take(
        self, view: StereoView, position: Array, covariance: Array, anchor: Anchor
    ) -> tuple[Array, Array]:
        """Return position and covariance after looking at the target; `anchor` is brought up to date.

        Position [3], m, and covariance [3, 3], m^2, are in the frame of the view's cameras. `anchor.scores`
        tells how it went: `stereo` and `look` are correlations, `range_sigma` and `look_sigma` the
        disagreements in standard deviations, NaN for a look that found nothing.
        """
        scores = dict.fromkeys(("stereo", "range_sigma", "look", "look_sigma"), math.nan)
        anchor.scores = scores
        pixel = view.left_camera.project(position)
        if not _inside(pixel, view, TEMPLATE_PX // 2 + 3):
            return position, covariance
        position, covariance, looked = self._look(view, position, covariance, anchor)
        ranged = self._range(view, position, covariance, anchor)
        if ranged is not None:
            position, covariance, match = ranged
            if looked:
                self._renew(view, position, match, anchor)
        return position, covariance

    def told(self, covariance: Array, anchor: Anchor) -> Array:
        """Return the covariance [3, 3], m^2, site frame, with what looks share, so that repeating them does
        not shrink it.
        """
        drift, parallax = anchor.drift or (anchor.key.drift, anchor.key.parallax)
        return np.asarray(covariance + anchor.shared + drift + parallax @ parallax.T)

    def _look(
        self, view: StereoView, position: Array, covariance: Array, anchor: Anchor
    ) -> tuple[Array, Array, bool]:
        pixel = np.asarray(view.left_camera.project(position))
        jacobian = view.left_camera.jacobian(position)
        reach = GATE_SIGMAS * math.sqrt(float(np.trace(jacobian @ covariance @ jacobian.T)))
        found = self._aligned(view, pixel, position, anchor, min(MOST_SEARCH_PX, math.ceil(reach) + 3))
        if found is None:
            return position, covariance, False
        at, score = found.pixel, found.score
        anchor.scores["look"] = score
        if score < self.options.least_look:
            return position, covariance, False
        aside_px = parallax_px(anchor.key, view.left_camera, position)
        own = jacobian @ anchor.key.uncertainty @ jacobian.T
        noise = found.spread + aside_px**2 * np.eye(2) + own
        gap = at - pixel
        spread = jacobian @ covariance @ jacobian.T + noise
        anchor.scores["look_sigma"] = float(math.sqrt(0.5 * gap @ np.linalg.solve(spread, gap)))
        if anchor.scores["look_sigma"] > self.options.gate_sigma:
            return position, covariance, False
        anchor.drift = grown_drift(anchor.key, view.left_camera, position, anchor.normal, found.spread)
        gain = covariance @ jacobian.T @ np.linalg.inv(spread)
        rest = np.eye(3) - gain @ jacobian
        return position + gain @ gap, rest @ covariance @ rest.T + gain @ noise @ gain.T, True

    def _aligned(
        self, view: StereoView, pixel: Array, position: Array, anchor: Anchor, reach_px: int
    ) -> Found | None:
        """Return where the template is found near a pixel; None where it cannot be.

        A normal from afar may be off by tens of degrees. Where the template, warped over it, is not seen as
        it should be, that of the present pair is tried, and a face that looks at the template's camera.
        """
        matcher = TemplateMatcher(NccOptions(template_px=TEMPLATE_PX, search_px=reach_px, coarse=False))
        best: Found | None = None
        for normal in self._normals(view, pixel, position, anchor):
            key = replace(anchor.key, normal=normal)
            template = matcher.predict(key, view.left_camera, pixel, position)
            if template is None:
                continue
            at = pixel.copy()
            score, spread = matcher.align(view.left, template, at, TEMPLATE_PX // 2)
            found: Found | None = Found(at, score, spread)
            if np.array_equal(at, pixel):
                # it wandered off: the prediction is not a measurement of itself
                found = matcher.search(view.left, template, pixel)
            if found is None:
                continue
            if best is None or found.score > best.score:
                best = found
                anchor.normal = normal
            if best.score >= self.options.good_look:
                break
        return best

    def _normals(self, view: StereoView, pixel: Array, position: Array, anchor: Anchor) -> Iterator[Array]:
        yield anchor.normal
        match = self._stereo(view, pixel, float(np.linalg.norm(position - view.left_camera.C)), 0.4)
        if match is not None:
            yield match.normal
        toward = anchor.key.camera.C - anchor.key.point
        yield np.asarray(toward / np.linalg.norm(toward))

    def _range(
        self, view: StereoView, position: Array, covariance: Array, anchor: Anchor
    ) -> tuple[Array, Array, PointMatch] | None:
        pixel = np.asarray(view.left_camera.project(position))
        if not np.isfinite(pixel).all():
            return None
        match = self._stereo(view, pixel, float(np.linalg.norm(position - view.left_camera.C)), 0.4)
        if match is None:
            return None
        anchor.scores["stereo"] = match.score
        normal = match.normal
        before = float(normal @ covariance @ normal)
        noise = float(normal @ match.surface_covariance @ normal)
        gap = float(normal @ (match.point - position))
        weighed = _along(position, covariance, normal, gap, noise)
        anchor.scores["range_sigma"] = weighed[2]
        if abs(weighed[2]) > self.options.gate_sigma:
            return None
        if noise > self.options.sharper**2 * before:
            return position, covariance, match
        anchor.shared = match.surface_covariance
        # its window is narrower on the surface than the template's was, and relief grows with the window
        wider = anchor.key.range_m / float(np.linalg.norm(match.point - view.left_camera.C))
        depth_m2 = wider**2 * float(np.trace(match.surface_covariance))
        anchor.key = replace(anchor.key, depth_m2=min(anchor.key.depth_m2, depth_m2))
        return weighed[0], weighed[1], match

    def _renew(self, view: StereoView, position: Array, match: PointMatch, anchor: Anchor) -> None:
        """Take a new template once the old one has been enlarged too far."""
        distance = float(np.linalg.norm(position - view.left_camera.C))
        growth = anchor.key.range_m / distance
        anchor.normal = match.normal
        if (growth > KEY_SCALE or growth < 1.0 / KEY_SCALE) and anchor.drift is not None:
            pixel = np.asarray(view.left_camera.project(position))
            fresh = _template(view, pixel, match)
            anchor.key = replace(fresh, point=position, drift=anchor.drift[0], parallax=anchor.drift[1])


def _template(view: StereoView, pixel: Array, match: PointMatch) -> Template:
    distance = float(np.linalg.norm(match.point - view.left_camera.C))
    depth_m2 = float(np.trace(match.surface_covariance))
    return Template(
        view.left, view.left_camera, pixel, match.point, match.normal, distance, depth_m2=depth_m2
    )


def _pointing(view: StereoView, point: Array) -> Array:
    """Return the covariance (3, 3), m^2, of a designated point across the line of sight."""
    ray = point - view.left_camera.C
    away = float(np.linalg.norm(ray))
    across = np.eye(3) - np.outer(ray, ray) / away**2
    return np.asarray((NccOptions().least_px * away / view.left_camera.hs) ** 2 * across)


def _along(
    position: Array, covariance: Array, direction: Array, gap: float, noise: float
) -> tuple[Array, Array, float]:
    """Return position and covariance once a place `gap` further along a unit vector (3,) has been measured
    with the variance `noise`, and that gap in standard deviations.
    """
    spread = float(direction @ covariance @ direction) + noise
    gain = covariance @ direction / spread
    rest = np.eye(3) - np.outer(gain, direction)
    renewed = rest @ covariance @ rest.T + noise * np.outer(gain, gain)
    return position + gain * gap, renewed, gap / math.sqrt(spread)


def _inside(pixel: Array, view: StereoView, margin: int) -> bool:
    rows, columns = view.left.shape
    return bool(
        np.isfinite(pixel).all()
        and margin <= pixel[0] < columns - margin
        and margin <= pixel[1] < rows - margin
    )
