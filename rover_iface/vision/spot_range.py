"""How far away exactly one spot of a picture is, beside an outline as well.

A window over an outline holds two surfaces, and correlation over it the range of neither: its contrast is
that of the outline. The pixels that lie on the spot's own surface agree with one plane through it to within
noise, the others with none. So planes are tried that windows to either side of the spot propose, each is
fitted to the pixels that agree with it (Geman and McClure 1987), and the one counts that explains most of
what lies near the spot. Kanade and Okutomi 1994 and Fusiello and others 1997 choose among whole windows;
here as in the former the window grows where it tells little.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rover_iface.cameras import stereo_kernels, triangulation_kernels
from rover_iface.cameras.model import Array
from rover_iface.cameras.stereo import PointMatch, triangulate
from rover_iface.vision import spot_range_kernels
from rover_iface.vision.tracker import StereoView

SIDES = np.array(
    [(0, 0), (-4, 0), (4, 0), (0, -4), (0, 4), (-3, -3), (3, -3), (-3, 3), (3, 3)], dtype=np.float64
)
"""Where the windows lie that propose, px from the spot: as far as half of one."""
PROPOSING_HALF, ALIKE_PX = 4, 0.4
"""Half of such a window, px, and how near to each other two proposals are one: the fit moves farther."""
STEPS = 8
"""Steps of Gauss and Newton; the fourth moves the disparity by less than 0.01 px."""
LEAST_INVERSE = 1e-3
"""Of a range, 1/m: a kilometre."""
FEWEST = 0.6
"""Share of the window that both images must show."""


@dataclass(frozen=True, slots=True)
class SpotOptions:
    """Parameters of the ranging of one spot; set on tuning seeds 0 to 11 of `studies.reacquisition`, where
    880 points of rocks were 0.17 px of disparity off in 90 % and 0.42 in 98 %, with a window of
    correlation 0.25 and 0.75 (600 of them). Where the window grows was set on worlds 467843826 to 467843839
    that were looked at (1,198 points).

    Attributes
    ----------
    half_px, reach_px
        Half of the window, and how fast the pixels in it lose weight from the spot outwards.
    slant
        Prior of the surface's slant, tangent.
    noise, blur_px
        What brightness is off of 1, and how far a pixel may lie beside its place: where brightness changes
        from pixel to pixel an image between pixels is not exact.
    least_px
        What a disparity is never better than: relief within the window.
    poor_px, wider
        Stated error from which a wider window is asked too, and how many times as wide: in a shadow and where
        the sun bleaches a face a small one holds little but noise.
    """

    half_px: int = 7
    reach_px: float = 2.5
    slant: float = 2.0
    noise: float = 0.004
    blur_px: float = 0.1
    least_px: float = 0.1
    poor_px: float = 0.3
    wider: int = 2


def range_spot(
    view: StereoView,
    pixel: Array,
    expected_m: Sequence[float],
    off_px: float,
    options: SpotOptions | None = None,
) -> PointMatch | None:
    """Return the surface under a pixel (2,) of the left image, whose disparity is within `off_px` of that of
    one of the expected ranges, m; None where none is found.
    """
    options = options or SpotOptions()
    left, right = view.left_camera, view.right_camera
    at = np.asarray(pixel, dtype=np.float64)
    unit = left.hs * float(np.linalg.norm(right.C - left.C))
    proposed = _proposed(view, at, expected_m, off_px / unit)
    best = _best(view, at, proposed, expected_m, off_px / unit, options)
    if best is None:
        return None
    if best[1] > options.poor_px**2:
        grown = options.wider * options.half_px, options.wider * options.reach_px
        relief_px = options.wider * options.least_px
        wide = replace(options, half_px=grown[0], reach_px=grown[1], least_px=relief_px)
        other = _best(view, at, proposed, expected_m, off_px / unit, wide)
        if other is not None and other[1] < best[1]:
            best = other
    return _match(view, at, *best)


def _best(
    view: StereoView,
    at: Array,
    proposed: Sequence[float],
    expected_m: Sequence[float],
    off: float,
    options: SpotOptions,
) -> tuple[float, float, Array] | None:
    """Return the cost, the variance, px^2, and the plane (6,) that explains most of a window, of those fitted
    from proposed inverse ranges, 1/m, that are within `off`, 1/m, of an expected one, m.
    """
    best: tuple[float, float, Array] | None = None
    for inverse in proposed:
        fitted = _fitted(view, at, inverse, options)
        if fitted is None or min(abs(fitted[2][0] - 1.0 / m) for m in expected_m) > off:
            continue
        if best is None or fitted[0] < best[0]:
            best = fitted
    return best


def _proposed(view: StereoView, at: Array, expected_m: Sequence[float], off: float) -> list[float]:
    """Return inverse ranges, 1/m: those that are expected, and others within `off` of one that differ."""
    left, right = view.left_camera, view.right_camera
    alike = ALIKE_PX / (left.hs * float(np.linalg.norm(right.C - left.C)))
    found = [1.0 / expected for expected in expected_m]
    for expected in expected_m:
        far, near = max(1.0 / expected - off, LEAST_INVERSE), 1.0 / expected + off
        for side in SIDES:
            inverse, _, score = stereo_kernels.search_epipolar(
                view.left, view.right, left.packed, right.packed, at + side, PROPOSING_HALF, 1.0, far, near
            )
            if score > -1.0 and all(abs(inverse - other) > alike for other in found):
                found.append(inverse)
    return found


def _fitted(
    view: StereoView, at: Array, inverse: float, options: SpotOptions
) -> tuple[float, float, Array] | None:
    """Return what a plane costs that was fitted from an inverse range on, the variance of its disparity,
    px^2, and the plane (6,); None where the pictures do not hold the window.
    """
    left, right = view.left_camera, view.right_camera
    whole = (2 * options.half_px + 1) ** 2
    window = np.empty((whole, 9))
    count = spot_range_kernels.lay_out(
        view.left,
        left.packed,
        right.packed,
        at,
        options.half_px,
        options.reach_px,
        options.blur_px,
        options.noise,
        inverse,
        window,
    )
    if count < FEWEST * whole:
        return None
    ray = left.back_project(at)[1]
    point = left.C + ray / inverse
    # pixels of disparity for each 1/m
    unit = float(np.linalg.norm(right.jacobian(point) @ ray)) / inverse**2
    plane = np.array([inverse, 0.0, 0.0, 0.0, 1.0, 0.0])
    slant_px = options.slant * inverse * unit / left.hs
    cost, variance = spot_range_kernels.fit_surface(
        view.right, window, options.half_px, inverse, unit, slant_px, STEPS, plane
    )
    if not (math.isfinite(cost) and math.isfinite(variance)):
        return None
    # two parts make up the cost, each 1 where nothing is off but by noise (Birge 1932)
    return cost, max(1.0, 0.5 * cost) * (max(0.0, variance) + options.least_px**2), plane


def _match(view: StereoView, at: Array, cost: float, variance: float, plane: Array) -> PointMatch | None:
    """Return a fitted plane (6,) as a match; its score tells how little the pixels are off."""
    left, right = view.left_camera, view.right_camera
    origin, ray = left.back_project(at)
    point = origin + ray / plane[0]
    beside = np.asarray(right.project(point)) + np.array([0.0, plane[3]])
    _, covariances = triangulate(left, right, at[None], beside[None], sigma_px=math.sqrt(0.5 * variance))
    if not (np.isfinite(beside).all() and np.isfinite(covariances).all()):
        return None
    normal = np.empty(3)
    triangulation_kernels.plane_normal(left.packed, float(at[0]), float(at[1]), plane[:3], normal)
    per_m = float(np.linalg.norm(right.jacobian(point) @ ray))
    along = np.outer(ray, ray) * variance / max(per_m, 1e-9) ** 2
    score = 1.0 / (1.0 + cost)
    return PointMatch(at, beside, score, point, covariances[0], normal, variance, along)
