"""Förstner points of a stereo pair, matched by correlation and checked for consistent parallax.

Förstner and Gülch 1987: corners and circular spots are where the gradient's normal matrix has a large smaller
eigenvalue (weight w = det / trace) and is round (q = 4 det / trace^2). Li et al. 2007, section II.A match
them by cross-correlation and drop those whose parallax does not fit that of their neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.stereo import Cloud
from rover_iface.errors import LocalizationError

Array = npt.NDArray[np.float64]
Image = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class InterestOptions:
    """Parameters.

    Attributes
    ----------
    window_px
        Side of the window of the normal matrix; of the correlation, 2 window + 1.
    least_roundness
        q from here on is a point and no edge (published by Förstner: 0.5 to 0.75).
    least_weight
        w from this multiple of its mean on.
    count, apart_px
        Strongest points kept, and how far they are apart.
    least_score
        Correlation of a match.
    parallax_px
        How far a parallax may differ from the median of its 8 neighbours, and from their spread.
    """

    window_px: int = 7
    least_roundness: float = 0.6
    least_weight: float = 0.5
    count: int = 600
    apart_px: int = 8
    least_score: float = 0.75
    parallax_px: float = 1.5

    def __post_init__(self) -> None:
        if self.window_px < 3 or self.window_px % 2 == 0:
            raise LocalizationError(f"interest window is {self.window_px} px; odd and at least 3 is needed")
        if not 0 < self.least_roundness < 1 or self.count < 20:
            raise LocalizationError(
                f"interest operator with roundness {self.least_roundness} and {self.count} points; "
                "0 to 1 and at least 20 are needed"
            )


def interest_points(image: Image, options: InterestOptions | None = None) -> Array:
    """Return pixels [n, 2] (sample, line) of an image's [rows, columns] strongest Förstner points (Förstner
    and Gülch 1987), the strongest first.
    """
    import cv2

    options = options or InterestOptions()
    grey = cv2.GaussianBlur(np.asarray(image, dtype=np.float32), (0, 0), 0.8)
    gx, gy = cv2.Scharr(grey, cv2.CV_32F, 1, 0), cv2.Scharr(grey, cv2.CV_32F, 0, 1)
    size = (options.window_px, options.window_px)
    xx, yy, xy = (cv2.boxFilter(product, -1, size) for product in (gx * gx, gy * gy, gx * gy))
    trace, det = xx + yy, xx * yy - xy * xy
    weight = det / np.maximum(trace, 1e-12)
    roundness = 4.0 * det / np.maximum(trace * trace, 1e-12)
    margin = 2 * options.window_px
    weight[:margin], weight[-margin:] = 0.0, 0.0
    weight[:, :margin], weight[:, -margin:] = 0.0, 0.0
    side = 2 * options.apart_px + 1
    peak = cv2.dilate(weight, np.ones((side, side), np.uint8)) == weight
    good = (
        peak & (roundness > options.least_roundness) & (weight > options.least_weight * float(weight.mean()))
    )
    lines, samples = np.nonzero(good)
    order = np.argsort(-weight[lines, samples])[: options.count]
    return np.column_stack((samples[order], lines[order])).astype(np.float64)


def consistent_parallax(pixels: Array, parallax: Array, limit_px: float) -> npt.NDArray[np.bool_]:
    """Return which parallaxes [n], px, fit those of their 8 neighbours in the image, at `pixels` [n, 2].

    They fit within `limit_px` and three times the median of what the neighbours differ by.
    """
    from scipy.spatial import cKDTree

    if len(pixels) < 9:
        return np.zeros(len(pixels), dtype=bool)
    near = cKDTree(pixels).query(pixels, k=9)[1][:, 1:]
    middle = np.median(parallax[near], axis=1)
    spread = np.median(np.abs(parallax[near] - middle[:, None]), axis=1)
    return np.asarray(np.abs(parallax - middle) <= limit_px + 3.0 * spread)


def match_interest_points(
    left: Image, right: Image, *, most_px: float, options: InterestOptions | None = None
) -> tuple[Array, Array]:
    """Return pixels [n, 2] in the left image of an aligned pair and their disparities [n] (0 to `most_px`).

    Disparities are to a fraction of a pixel, by the parabola through the correlation's peak.

    `left` and `right` are [rows, columns] of one size; `most_px` is the largest disparity looked for.
    """
    import cv2

    options = options or InterestOptions()
    half = options.window_px
    pixels, disparities = [], []
    lines, samples = left.shape
    for sample, line in interest_points(left, options).astype(int):
        low = max(0, int(sample - most_px) - half)
        if line - half < 0 or line + half >= lines or sample - half < 0 or sample + half >= samples:
            continue
        template = left[line - half : line + half + 1, sample - half : sample + half + 1]
        strip = right[line - half : line + half + 1, low : sample + half + 1]
        if strip.shape[1] < template.shape[1] + 2:
            continue
        score = cv2.matchTemplate(strip, template, cv2.TM_CCOEFF_NORMED)[0]
        k = int(score.argmax())
        if score[k] < options.least_score or not 0 < k < len(score) - 1:
            continue
        a, b, c = (float(score[k + d]) for d in (-1, 0, 1))
        top = k + 0.5 * (a - c) / min(a - 2 * b + c, -1e-9)
        pixels.append((float(sample), float(line)))
        disparities.append(sample - half - (low + top))
    if not pixels:
        return np.empty((0, 2)), np.empty(0)
    found, values = np.array(pixels), np.array(disparities)
    keep = consistent_parallax(found, values, options.parallax_px)
    return found[keep], values[keep]


def confirmed(
    cloud: Cloud, pixels: Array, disparities: Array, *, limit_px: float = 1.5
) -> npt.NDArray[np.bool_]:
    """Return which points of a dense cloud the interest points round them bear out.

    The disparity of each must lie between the least and the largest of the four nearest interest points,
    give or take `limit_px` and a fifth of their spread; far from any interest point (60 px) nothing is said
    and the point is kept.

    `pixels` [n, 2] and `disparities` [n], px, are those of the interest points, in the image of the cloud.
    """
    from scipy.spatial import cKDTree

    if len(pixels) < 4:
        return np.ones(len(cloud.points), dtype=bool)
    away, near = cKDTree(pixels).query(cloud.pixels, k=4)
    low, high = disparities[near].min(axis=1), disparities[near].max(axis=1)
    slack = limit_px + 0.5 * (high - low)
    fits = (cloud.disparities >= low - slack) & (cloud.disparities <= high + slack)
    return np.asarray(fits | (away[:, -1] > 60.0))
