"""Texture statistics by which a rendered image is compared with flight images.

Without this comparison a tracking result on rendered images means nothing: a ground that is too smooth is
lost at once, one that is too rich is never lost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Grey = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class TextureStatistics:
    """Medians over 64-pixel patches, one every 32 pixels; SIFT over the whole image given.

    Attributes
    ----------
    spectrum_slope
        Of the radial power spectrum, log-log, 2 to 28 cycles a patch.
    high_energy
        Share of the power above a quarter of the sampling frequency.
    rms_contrast
        Standard deviation / mean.
    half_width_px
        Where the autocorrelation of a 21 x 21 template falls to one half.
    second_peak
        Best score of that template elsewhere within +-20 pixels, its own peak (+-8) left out.
    sift_per_mpx
        Features of the default detector per million pixels.
    """

    spectrum_slope: float
    high_energy: float
    rms_contrast: float
    half_width_px: float
    second_peak: float
    sift_per_mpx: float


RANGES: dict[str, tuple[float, float]] = {
    "spectrum_slope": (-3.0, -2.0),
    "high_energy": (0.08, 0.26),
    "rms_contrast": (0.16, 0.39),
    "half_width_px": (2.0, 4.0),
    "second_peak": (0.31, 0.56),
    "sift_per_mpx": (900.0, 23000.0),
}
"""What eight frames of Spirit, Opportunity and Curiosity span (`docs/results/cameras.md`)."""


def stretch(
    image: npt.NDArray[np.generic], percent: float = 0.5, mask: npt.NDArray[np.bool_] | None = None
) -> Grey:
    """Return the image in 0..255, the darkest and brightest `percent` (of what `mask` holds) cut off."""
    values = np.asarray(image, dtype=np.float32)
    low, high = np.percentile(values if mask is None else values[mask], [percent, 100.0 - percent])
    return np.asarray(255.0 * np.clip((values - low) / max(1e-6, high - low), 0, 1), dtype=np.float32)


def measure(image: npt.NDArray[np.generic], mask: npt.NDArray[np.bool_] | None = None) -> TextureStatistics:
    """Return the statistics of an image, over the patches that lie within `mask` (default: all)."""
    import cv2

    values = np.asarray(image, dtype=np.float32)
    if mask is not None:
        values = np.where(mask, values, np.median(values[mask]))
    grey = stretch(values, mask=mask)
    rows, columns = grey.shape
    window = np.outer(np.hanning(64), np.hanning(64)).astype(np.float32)
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(64), np.fft.fftfreq(64)))
    ring = np.round(frequency * 64).astype(int)
    slopes, energies, contrasts, widths, seconds = [], [], [], [], []
    for top in range(0, rows - 63, 32):
        for left in range(0, columns - 63, 32):
            cut = (slice(top, top + 64), slice(left, left + 64))
            if mask is not None and not mask[cut].all():
                continue
            patch = grey[cut]
            mean = float(patch.mean())
            if mean < 8.0 or float(patch.std()) < 1.0:
                continue
            power = np.abs(np.fft.fft2((patch - mean) * window)) ** 2
            radial = np.bincount(ring.ravel(), power.ravel()) / np.maximum(1, np.bincount(ring.ravel()))
            k = np.arange(2, 29)
            slopes.append(float(np.polyfit(np.log(k), np.log(radial[2:29] + 1e-9), 1)[0]))
            energies.append(float(power[frequency > 0.25].sum() / power.sum()))
            contrasts.append(float(patch.std()) / mean)
            cy, cx = top + 32, left + 32
            if not (30 <= cy < rows - 31 and 30 <= cx < columns - 31):
                continue
            template = grey[cy - 10 : cy + 11, cx - 10 : cx + 11]
            score = cv2.matchTemplate(
                grey[cy - 30 : cy + 31, cx - 30 : cx + 31], template, cv2.TM_CCOEFF_NORMED
            )
            line = (score[20, 20:] + score[20, 20::-1] + score[20:, 20] + score[20::-1, 20]) / 4.0
            below = np.nonzero(line < 0.5)[0]
            widths.append(float(below[0]) if len(below) else 20.0)
            score[12:29, 12:29] = -1
            seconds.append(float(score.max()))
    whole = None if mask is None else mask.astype(np.uint8) * 255
    features = len(cv2.SIFT.create().detect(grey.astype(np.uint8), whole))
    area = float(grey.size if mask is None else mask.sum())
    lists = (slopes, energies, contrasts, widths, seconds)
    slope, energy, contrast, width, second = (float(np.median(v)) if v else float("nan") for v in lists)
    return TextureStatistics(slope, energy, contrast, width, second, features / area * 1e6)
