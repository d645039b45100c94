"""The view in which a target was designated: whether stereo sees it there, and drift measured against it.

Each template comes from the one before, so what one match is off all later ones keep. The first view knows
better: what the rover sees now, warped to how the first camera would have seen it, is aligned there, and
where it comes to lie tells how far the track has drifted from the pixel that was meant. From ten metres a
tenth of a pixel is 1 mm. A chain of matches makes the drift grow; where the first view knows it better, the
track goes on from what that says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo import PointMatch
from rover_iface.errors import TrackerError
from rover_iface.vision.coverage_watch import INSIDE
from rover_iface.vision.template import Template, TemplateMatcher, on_plane, parallax_px
from rover_iface.vision.tracker import Image, StereoView

DISPARITY_PX = 1.0
"""Three sigma of a disparity between designation and start (Kim et al. 2009, eq. 1)."""
MAP_SHARE = 0.02
"""Three sigma of the designated range besides: dead reckoning since (eq. 3)."""
LEAST_SCORE = 0.75
"""Correlation that an alignment in the first view needs; that of the key template."""
MOST_PX = 2.0
"""Farther off in the first view it is another place."""
MOST_UNKNOWN = 0.35
"""Of what the ranges of now show from there: hidden there, or beyond the picture of now."""


@dataclass(frozen=True, eq=False)
class Measured:
    """What the first view tells of a track.

    Attributes
    ----------
    off
        (3,), metres: where the template's spot lies from the designated one, as far as to be taken out.
    drift, parallax
        Of what is left; see `Template`.
    squared
        Squared ratio of what was measured to what was told, two degrees of freedom.
    """

    off: Array
    drift: Array
    parallax: Array
    squared: float


def measured_drift(matcher: TemplateMatcher, first: Template, now: Template) -> Measured | None:
    """Return what the first view tells of the spot under `now.pixel`; None where it does not show it so.

    `now.uncertainty` is what the chain of matches tells of it. What is seen now is taken back to the first
    view over the plane of its face; where that leads nowhere, and `now.relief` is there, by its ranges: from
    near a rock is round and looked down on.
    """
    template = matcher.predict(now, first.camera, first.pixel, first.point)
    told = None if template is None else _compared(matcher, first, now, template)
    if told is not None or now.relief is None:
        return told
    half = matcher.options.context_px // 2
    template = now.relief.seen_by(first.camera, first.point, first.point - now.point, half)
    if template is None:
        return None
    inner = matcher.options.template_px // 2
    core = template[half - inner : half + inner + 1, half - inner : half + inner + 1]
    if np.isnan(core).mean() > MOST_UNKNOWN:
        return None
    return _compared(matcher, first, replace(now, depth_m2=now.ranged_m2), template)


def _compared(matcher: TemplateMatcher, first: Template, now: Template, template: Image) -> Measured | None:
    """Return what the first view tells of a spot, by what it should show of it: `template` [n, n]."""
    spot = first.pixel.copy()
    fitted = matcher.fit(first.image, template, spot, matcher.options.template_px // 2)
    if fitted is None:
        return None
    score, spread = fitted
    gap = spot - first.pixel
    if score < LEAST_SCORE or float(np.hypot(*gap)) > MOST_PX:
        return None
    jacobian = first.camera.jacobian(first.point)
    aside = parallax_px(now, first.camera, first.point)
    noise = spread + aside**2 * np.eye(2)
    told = jacobian @ now.uncertainty @ jacobian.T + 1e-8 * np.eye(2)
    squared = float(gap @ np.linalg.solve(told + noise, gap))
    out = on_plane(first.camera, first.point, first.normal, jacobian)
    # where they contradict each other nothing tells which is right: what is told covers both
    both = np.outer(gap, gap) if squared > INSIDE[2] else np.zeros((2, 2))
    # each look at the first view errs as the one before: the better of both, never their mean
    if np.linalg.det(noise + both) >= np.linalg.det(told + both):
        return Measured(np.zeros(3), np.asarray(now.drift + out @ both @ out.T), now.parallax, squared)
    return Measured(out @ gap, np.asarray(out @ (spread + both) @ out.T), np.asarray(aside * out), squared)


def require_range(target: str, view: StereoView, designated: Array, match: PointMatch) -> None:
    """Refuse a target that stereo ranges elsewhere than designated.

    `designated` [3], m, is in the frame of the view's cameras. A camera model that is off, pictures of two
    times and a patch that repeats itself show here, and nowhere else: what the pair says by itself is
    consistent.

    Raises
    ------
    TrackerError
        If the ranges differ by more than both can be off.
    """
    expected = float(np.linalg.norm(designated - view.left_camera.C))
    measured = float(np.linalg.norm(match.point - view.left_camera.C))
    baseline_m = float(np.linalg.norm(view.right_camera.C - view.left_camera.C))
    one_px_m = expected**2 / (view.left_camera.hs * baseline_m)
    sigma_m = math.sqrt(float(np.trace(match.surface_covariance)))
    # a patch that tells little is not a licence: three sigma count up to the error of a pixel
    limit = DISPARITY_PX * one_px_m + min(3.0 * sigma_m, DISPARITY_PX * one_px_m) + MAP_SHARE * expected
    if abs(measured - expected) > limit:
        raise TrackerError(
            f'target "{target}": stereo ranges it at {measured:.2f} m, it was designated at '
            f"{expected:.2f} m; they may differ by {limit:.2f} m"
        )
