"""What the pictures say of one target once the features have told the motion.

The motion of hundreds of features carries a target without looking at it. Two looks take the drift out. Point
stereo at the expected pixel finds the surface that the target lies on, which is sharper with every metre
driven: a position update along the surface's normal. A template of an earlier stop, warped over that surface,
finds the spot itself: an update across the line of sight. Both are weighted by their covariance and passed
over when they disagree with the motion by more than chance allows (something in front, a shadow's edge).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo import PointMatch, PointStereo, point_stereo, triangulate
from rover_iface.vision.template import NccOptions, Template, TemplateMatcher
from rover_iface.vision.tracker import StereoView

KEY_SCALE = 1.5
TEMPLATE_PX = 21


@dataclass(frozen=True, slots=True)
class AnchorOptions:
    """How far the looks at the target itself are believed.

    Attributes
    ----------
    range_px
        Error of a patch's disparity, pixels.
    rough_m
        How far the surface may depart from the plane that stereo fits.
    look_px
        Error of the place of a template.
    bias_px
        What all disparities of a scene are off together. More looks do not shrink it, so it is kept out of
        the weights and added to the covariance that is told; so is what a template was off when cut.
    least_stereo, least_look
        Correlation below which a look says nothing.
    gate_sigma
        Disagreement at which a look is passed over.
    """

    range_px: float = 0.15
    rough_m: float = 0.002
    look_px: float = 0.25
    bias_px: float = 0.09
    least_stereo: float = 0.7
    least_look: float = 0.6
    gate_sigma: float = 3.5


@dataclass(slots=True)
class Anchor:
    """What is remembered of a target's looks: its face and the template of an earlier stop."""

    normal: Array
    key: Template
    scores: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Looks:
    """Takes the looks. Pure but for the `Anchor` that it is given."""

    options: AnchorOptions

    def _stereo(
        self, view: StereoView, pixel: Array, range_m: float | None, spread: float
    ) -> PointMatch | None:
        settings = PointStereo(sigma_px=self.options.range_px / math.sqrt(2.0))
        match = point_stereo(
            view.left,
            view.right,
            view.left_camera,
            view.right_camera,
            pixel,
            options=settings,
            expected_range_m=range_m,
            range_spread=spread,
        )
        return match if match is not None and match.score >= self.options.least_stereo else None

    def begin(
        self, view: StereoView, pixel: Array, expected_m: float | None
    ) -> tuple[Array, Array, Anchor] | None:
        """Return position, covariance and anchor of the surface under a pixel; None where stereo fails."""
        match = self._stereo(view, pixel, expected_m, 0.9)
        if match is None:
            return None
        key = self._template(view, pixel, match.point, match.normal, 0.0)
        covariance = match.covariance + self.options.rough_m**2 * np.eye(3)
        return match.point, covariance, Anchor(match.normal, key)

    def take(
        self, view: StereoView, position: Array, covariance: Array, anchor: Anchor
    ) -> tuple[Array, Array]:
        """Return position and covariance after looking at the target; `anchor` is brought up to date.

        `anchor.scores` tells how it went: `stereo` and `look` are correlations, `range_sigma` and
        `look_sigma` the disagreements in standard deviations, NaN for a look that found nothing.
        """
        scores = dict.fromkeys(("stereo", "range_sigma", "look", "look_sigma"), math.nan)
        anchor.scores = scores
        pixel = view.left_camera.project(position)
        if not _inside(pixel, view, TEMPLATE_PX // 2 + 3):
            return position, covariance
        position, covariance, looked = self._look(view, position, covariance, anchor)
        ranged = self._range(view, position, covariance, anchor)
        if ranged is not None:
            position, covariance, normal = ranged
            if looked:
                self._renew(view, position, normal, anchor)
        return position, covariance

    def told(self, view: StereoView, position: Array, covariance: Array, anchor: Anchor) -> Array:
        """Return the covariance with what looks share, so that repeating them does not shrink it."""
        left, right = view.left_camera.project(position), view.right_camera.project(position)
        if not (np.isfinite(left).all() and np.isfinite(right).all()):
            return covariance
        cameras = view.left_camera, view.right_camera
        shared = triangulate(*cameras, left[None], right[None], sigma_px=self.options.bias_px)[1][0]
        ray = position - view.left_camera.C
        distance = float(np.linalg.norm(ray))
        across = np.eye(3) - np.outer(ray, ray) / distance**2
        drift = anchor.key.drift_px2 * (anchor.key.range_m / view.left_camera.hs) ** 2
        return np.asarray(covariance + np.nan_to_num(shared) + drift * across)

    def _look(
        self, view: StereoView, position: Array, covariance: Array, anchor: Anchor
    ) -> tuple[Array, Array, bool]:
        matcher = TemplateMatcher(NccOptions(template_px=TEMPLATE_PX))
        pixel = np.asarray(view.left_camera.project(position))
        key = replace(anchor.key, normal=anchor.normal)
        template = matcher.predict(key, view.left_camera, pixel, position)
        if template is None:
            return position, covariance, False
        at = pixel.copy()
        score = matcher.align(view.left, template, at, TEMPLATE_PX // 2)
        anchor.scores["look"] = score
        if score < self.options.least_look:
            return position, covariance, False
        jacobian = view.left_camera.jacobian(position)
        growth = key.range_m / float(np.linalg.norm(position - view.left_camera.C))
        noise = (self.options.look_px**2 + key.drift_px2 * growth**2) * np.eye(2)
        gap = at - pixel
        spread = jacobian @ covariance @ jacobian.T + noise
        anchor.scores["look_sigma"] = float(math.sqrt(0.5 * gap @ np.linalg.solve(spread, gap)))
        if anchor.scores["look_sigma"] > self.options.gate_sigma:
            return position, covariance, False
        gain = covariance @ jacobian.T @ np.linalg.inv(spread)
        rest = np.eye(3) - gain @ jacobian
        return position + gain @ gap, rest @ covariance @ rest.T + gain @ noise @ gain.T, True

    def _range(
        self, view: StereoView, position: Array, covariance: Array, anchor: Anchor
    ) -> tuple[Array, Array, Array] | None:
        pixel = np.asarray(view.left_camera.project(position))
        if not np.isfinite(pixel).all():
            return None
        match = self._stereo(view, pixel, float(np.linalg.norm(position - view.left_camera.C)), 0.4)
        if match is None:
            return None
        anchor.scores["stereo"] = match.score
        normal = match.normal
        noise = float(normal @ match.covariance @ normal) + self.options.rough_m**2
        spread = float(normal @ covariance @ normal) + noise
        gap = float(normal @ (match.point - position))
        anchor.scores["range_sigma"] = gap / math.sqrt(spread)
        if abs(gap) > self.options.gate_sigma * math.sqrt(spread):
            return None
        gain = covariance @ normal / spread
        rest = np.eye(3) - np.outer(gain, normal)
        renewed = rest @ covariance @ rest.T + noise * np.outer(gain, gain)
        return position + gain * gap, renewed, normal

    def _renew(self, view: StereoView, position: Array, normal: Array, anchor: Anchor) -> None:
        """Take a new template once the old one has been enlarged too far."""
        distance = float(np.linalg.norm(position - view.left_camera.C))
        growth = anchor.key.range_m / distance
        anchor.normal = normal
        if growth > KEY_SCALE or growth < 1.0 / KEY_SCALE:
            drift = anchor.key.drift_px2 * growth**2 + self.options.look_px**2
            pixel = np.asarray(view.left_camera.project(position))
            anchor.key = self._template(view, pixel, position, normal, drift)

    def _template(
        self, view: StereoView, pixel: Array, point: Array, normal: Array, drift: float
    ) -> Template:
        distance = float(np.linalg.norm(point - view.left_camera.C))
        return Template(view.left, view.left_camera, pixel, point, normal, distance, drift)


def _inside(pixel: Array, view: StereoView, margin: int) -> bool:
    rows, columns = view.left.shape
    return bool(
        np.isfinite(pixel).all()
        and margin <= pixel[0] < columns - margin
        and margin <= pixel[1] < rows - margin
    )
