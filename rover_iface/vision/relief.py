"""Alignment of a template over a surface with relief, seen by a camera that stands a little aside.

A template is warped as if its surface were a plane. Where the cameras stand apart, what lies behind or before
the plane is moved along the line that range moves pixels along: slopes and bends of the surface take the
whole window with them, and ground behind an edge moves by whole pixels. So slope, bend and roll are fitted
together with the place, and pixels that do not follow count little (Tukey). Brightness may be changed by a
parabola: cameras differ in exposure and contrast.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.vision.tracker import Image

PLACE, RELIEF, ROLL = slice(0, 2), slice(2, 7), 7
MOTIONS, MARGIN_PX = 8, 8


@dataclass(frozen=True, slots=True)
class ReliefOptions:
    """Parameters of the alignment.

    Attributes
    ----------
    half_px, weight_px
        The window's half side, and the deviation of the weight that falls off from its middle.
    slope_px, bend_px, roll_rad
        What the surface may displace the window's border by its slope and its bend, and how far the cameras
        may be rolled: one standard deviation each.
    outlier
        Residuals beyond this many deviations do not count.
    """

    half_px: int = 20
    weight_px: float = 9.0
    slope_px: float = 2.0
    bend_px: float = 1.2
    roll_rad: float = 0.01
    outlier: float = 4.0
    steps: int = 15


@dataclass(frozen=True, eq=False)
class Aligned:
    """Where a template's middle lies, pixels (2,), and the weighted correlation there."""

    pixel: Array
    score: float


def align_relief(
    image: Image, template: Image, at: Array, along: Array, options: ReliefOptions
) -> Aligned | None:
    """Return where an image shows the middle of a template, to a few hundredths of a pixel.

    Gauss and Newton with a prior on slope, bend and roll. None where the window does not lie in the image or
    shows too little of the template.

    Parameters
    ----------
    template
        Square, of odd side, at least as large as the window; NaN where nothing is known.
    at
        (2,), where the search has it, within about a pixel.
    along
        (2,), unit: the line along which the image shows a point when its range changes.
    """
    window = _Window.cut(image, template, at, along, options)
    if window is None:
        return None
    motion, tone = np.zeros(MOTIONS), np.zeros(3)
    found: _Residuals | None = None
    for step in range(options.steps):
        found = window.residuals(motion, tone if step else None, robust=step > 2)
        if found is None:
            return None
        change = window.step(found, motion)
        motion, tone = motion + change[:MOTIONS], found.tone + change[MOTIONS:]
        if step > 4 and np.abs(change[PLACE]).max() < 2e-3:
            break
    assert found is not None
    return Aligned(at + motion[PLACE], found.correlation())


@dataclass(frozen=True, eq=False)
class _Residuals:
    """Pixels that both show: brightness wanted, powers of what is seen, slopes, weights; and the tone."""

    wanted: Array
    powers: Array
    slopes: Array
    weights: Array
    tone: Array

    @property
    def off(self) -> Array:
        return np.asarray(self.wanted - self.powers @ self.tone)

    def correlation(self) -> float:
        """Return the weighted correlation of what is wanted and what is seen."""
        w = self.weights / self.weights.sum()
        a, b = self.wanted - w @ self.wanted, self.powers @ self.tone
        b = b - w @ b
        return float(w @ (a * b) / max(1e-12, np.sqrt((w @ a**2) * (w @ b**2))))


@dataclass(frozen=True, eq=False)
class _Window:
    """Template and image round a place, with what stays the same from step to step."""

    wanted: Array
    at: Array
    along: Array
    corner: Array
    region: Image
    slope_x: Image
    slope_y: Image
    across: Array
    down: Array
    relief: Array
    weights: Array
    precision: Array
    options: ReliefOptions

    @classmethod
    def cut(
        cls, image: Image, template: Image, at: Array, along: Array, options: ReliefOptions
    ) -> _Window | None:
        import cv2

        half, middle = options.half_px, template.shape[0] // 2
        reach = half + MARGIN_PX
        x, y = (round(float(v)) for v in at)
        left, top = max(0, x - reach), max(0, y - reach)
        region = np.ascontiguousarray(image[top : max(0, y + reach + 1), left : max(0, x + reach + 1)])
        if min(region.shape) < half or middle < half:
            return None
        inner = slice(middle - half, middle + half + 1)
        v, u = np.mgrid[-half : half + 1, -half : half + 1].astype(np.float64)
        a, d = u / half, v / half
        spread = (options.slope_px,) * 2 + (options.bend_px,) * 3 + (options.roll_rad * half,)
        return cls(
            template[inner, inner].astype(np.float64),
            np.asarray(at, dtype=np.float64),
            np.asarray(along, dtype=np.float64),
            np.array([left, top], dtype=np.float64),
            region,
            0.5 * cv2.Sobel(region, cv2.CV_32F, 1, 0, ksize=1),
            0.5 * cv2.Sobel(region, cv2.CV_32F, 0, 1, ksize=1),
            a,
            d,
            np.stack((a, d, a * a, a * d, d * d), axis=-1),
            np.exp(-0.5 * (u * u + v * v) / options.weight_px**2),
            np.concatenate((np.zeros(2), np.array(spread) ** -2.0)),
            options,
        )

    def residuals(self, motion: Array, tone: Array | None, *, robust: bool) -> _Residuals | None:
        """Return what is left over at a motion; a tone that is not given is fitted. None with few pixels."""
        x, y = self._places(motion)
        seen, gx, gy = (self._sample(part, x, y) for part in (self.region, self.slope_x, self.slope_y))
        known = np.isfinite(self.wanted) & np.isfinite(seen + gx + gy)
        if known.sum() < 150 or known.sum() < 0.6 * known.size:
            return None
        b, wanted, weights = seen[known], self.wanted[known], self.weights[known]
        centred = b - b.mean()
        powers = np.stack((np.ones_like(b), b, centred**2), axis=-1)
        if tone is None:
            root = np.sqrt(weights)[:, None]
            tone = np.linalg.lstsq(powers * root, wanted * root[:, 0], rcond=None)[0]
        gain = tone[1] + 2.0 * tone[2] * centred
        sx, sy = gain * gx[known], gain * gy[known]
        by_range = (self.along[0] * sx + self.along[1] * sy)[:, None] * self.relief[known]
        roll = self.across[known] * sy - self.down[known] * sx
        slopes = np.column_stack((sx, sy, by_range, roll))
        off = wanted - powers @ tone
        if robust:
            scale = 1.4826 * float(np.median(np.abs(off)[weights > 0.2])) + 1e-6
            weights = weights * np.clip(1.0 - (off / (self.options.outlier * scale)) ** 2, 0.0, None) ** 2
        return _Residuals(wanted, powers, slopes, weights, tone)

    def step(self, found: _Residuals, motion: Array) -> Array:
        """Return the change (11,) of motion and tone that the residuals ask for; the place by up to 1 px."""
        off, w = found.off, found.weights
        j = np.hstack((found.slopes, found.powers))
        variance = float(w @ off**2 / w.sum())
        # neighbouring pixels tell the same: their residuals count for a quarter
        prior = np.concatenate((4.0 * variance * self.precision, np.zeros(3)))
        normal = (j * w[:, None]).T @ j + np.diag(prior + 1e-12)
        gradient = j.T @ (w * off) - prior * np.concatenate((motion, np.zeros(3)))
        change = np.linalg.solve(normal, gradient)
        change[PLACE] = np.clip(change[PLACE], -1.0, 1.0)
        return np.asarray(change)

    def _places(self, motion: Array) -> tuple[Array, Array]:
        """Return samples and lines of the region at which the window's pixels are, moved."""
        half = self.options.half_px
        aside, roll = self.relief @ motion[RELIEF], motion[ROLL]
        start = self.at + motion[PLACE] - self.corner
        x = start[0] + half * self.across + self.along[0] * aside - roll * self.down
        y = start[1] + half * self.down + self.along[1] * aside + roll * self.across
        return np.asarray(x), np.asarray(y)

    @staticmethod
    def _sample(part: Image, x: Array, y: Array) -> npt.NDArray[np.float64]:
        import cv2

        return np.asarray(
            cv2.remap(
                part,
                x.astype(np.float32),
                y.astype(np.float32),
                cv2.INTER_CUBIC,
                borderMode=cv2.BORDER_CONSTANT,
                borderValue=np.nan,
            ),
            dtype=np.float64,
        )
