"""Texture statistics of single patches, by which a classifier tells pictures apart.

Nothing here depends on how bright or how strongly stretched a frame is: each frame is stretched to the same
range over its ground first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studies.common.texture_statistics import stretch

Grey = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
Array = npt.NDArray[np.float64]
PATCH_PX = 64
"""Side of a patch, as in `texture_statistics`: some 50 features of SIFT, and a spectrum over four octaves."""

STEP_PX = 32
"""Patches begin at multiples of half their side: small masks hold some, and intervals go by scene anyway."""

BANDS = {"low": (2, 6), "middle": (6, 14), "high": (14, 29)}
"""Cycles a patch over which the slope of the spectrum is fitted, last one left out."""

SCALES_PX = 0.7, 1.4, 2.8
"""Inner widths of the differences of Gaussians (outer ones are twice as wide)."""

LBP_RADII_PX = 1, 3
NAMES = (
    *(f"spectrum slope, {band}" for band in BANDS),
    "energy above f/4",
    "rms contrast",
    "skewness",
    "kurtosis",
    "kurtosis of gradients",
    *(f"kurtosis of details, {s} px" for s in SCALES_PX),
    *(f"skewness of details, {s} px" for s in SCALES_PX),
    "details, 0.7 to 1.4 px",
    "details, 1.4 to 2.8 px",
    "dark share",
    "quiet share",
    "half-width",
    "second peak",
    "SIFT per Mpx",
    "anisotropy",
    "vertical to horizontal",
    *(f"LBP {r} px, {n}" for r in LBP_RADII_PX for n in (*(f"{k} up" for k in range(9)), "mixed")),
)


@dataclass(frozen=True, slots=True, eq=False)
class Patches:
    """Statistics (n, len(NAMES)) of a frame's patches and their upper left corners (n, 2), row and column."""

    values: Array
    corners: npt.NDArray[np.int64]


def half_size(image: Grey, mask: Mask) -> tuple[Grey, Mask]:
    """Return picture and mask (rows, columns) at half the size: coding and sensor noise count for less."""
    import cv2

    rows, columns = image.shape[0] // 2, image.shape[1] // 2
    small = cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA)
    whole = mask[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2).all(axis=(1, 3))
    return np.asarray(small, dtype=np.float32), np.asarray(whole)


def patch_statistics(
    image: npt.NDArray[np.generic], mask: Mask, *, most: int, rng: np.random.Generator
) -> Patches:
    """Return statistics of at most `most` patches within the mask, drawn from those at steps of `STEP_PX`.

    Parameters
    ----------
    image, mask
        (rows, columns); the ground that is looked at is where the mask holds.

    Raises
    ------
    ValueError
        If no patch lies within the mask.
    """
    values = np.asarray(image, dtype=np.float32)
    grey = stretch(np.where(mask, values, np.median(values[mask])), mask=mask)
    corners = [
        (top, left)
        for top in range(0, grey.shape[0] - PATCH_PX + 1, STEP_PX)
        for left in range(0, grey.shape[1] - PATCH_PX + 1, STEP_PX)
        if mask[top : top + PATCH_PX, left : left + PATCH_PX].all()
    ]
    if not corners:
        raise ValueError(f"no patch of {PATCH_PX} px lies within the mask of {int(mask.sum())} pixels")
    chosen = sorted(rng.permutation(len(corners))[:most])
    kept = np.array([corners[k] for k in chosen])
    maps = _Maps(grey, mask)
    return Patches(np.array([maps.statistics(int(top), int(left)) for top, left in kept]), kept)


class _Maps:
    """What is computed once for a whole frame, and read patch by patch."""

    def __init__(self, grey: Grey, mask: Mask) -> None:
        import cv2

        self.grey = grey
        self.middle = float(np.median(grey[mask]))
        blurred = {
            s: cv2.GaussianBlur(grey, (0, 0), s) for s in sorted({t for s in SCALES_PX for t in (s, 2 * s)})
        }
        self.details = [blurred[s] - blurred[2 * s] for s in SCALES_PX]
        self.down, self.across = np.gradient(grey)
        self.patterns = [local_binary_patterns(grey, r) for r in LBP_RADII_PX]
        found = cv2.SIFT.create().detect(np.round(grey).astype(np.uint8), mask.astype(np.uint8) * 255)
        self.features = np.array([(p.pt[1], p.pt[0]) for p in found]).reshape(-1, 2)
        frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(PATCH_PX), np.fft.fftfreq(PATCH_PX)))
        self.fine = frequency > 0.25
        self.ring = np.round(frequency * PATCH_PX).astype(int)
        self.window = np.outer(np.hanning(PATCH_PX), np.hanning(PATCH_PX))

    def statistics(self, top: int, left: int) -> list[float]:
        """Return the numbers of `NAMES` for the patch with this corner."""
        cut = slice(top, top + PATCH_PX), slice(left, left + PATCH_PX)
        patch = self.grey[cut].astype(np.float64)
        inside = ((self.features >= (top, left)) & (self.features < (top + PATCH_PX, left + PATCH_PX))).all(
            axis=1
        )
        details = [d[cut].astype(np.float64) for d in self.details]
        spread = [float(d.std()) + 1e-6 for d in details]
        gradients = np.concatenate((self.down[cut].ravel(), self.across[cut].ravel()))
        return [
            *self._spectrum(patch),
            float(patch.std() / max(8.0, patch.mean())),
            _moment(patch, 3),
            _moment(patch, 4),
            _moment(gradients, 4),
            *(_moment(d, 4) for d in details),
            *(_moment(d, 3) for d in details),
            float(np.log(spread[0] / spread[1])),
            float(np.log(spread[1] / spread[2])),
            float((patch < 0.5 * self.middle).mean()),
            _quiet_share(details[0]),
            *_template(patch),
            float(inside.sum()) / PATCH_PX**2 * 1e6,
            *_direction(self.down[cut], self.across[cut]),
            *(
                float(x)
                for p in self.patterns
                for x in np.bincount(p[cut].ravel(), minlength=10) / patch.size
            ),
        ]

    def _spectrum(self, patch: Array) -> list[float]:
        """Return the slopes of the radial power spectrum and the share above f/4."""
        power = np.abs(np.fft.fft2((patch - patch.mean()) * self.window)) ** 2
        radial = np.bincount(self.ring.ravel(), power.ravel()) / np.maximum(1, np.bincount(self.ring.ravel()))
        slopes = [
            float(np.polyfit(np.log(np.arange(*band)), np.log(radial[slice(*band)] + 1e-9), 1)[0])
            for band in BANDS.values()
        ]
        return [*slopes, float(power[self.fine].sum() / max(1e-9, power.sum()))]


def _moment(values: npt.NDArray[np.floating], order: int) -> float:
    """Return a standardised moment; the fourth, heavy-tailed as it is, as its logarithm (Gauss: log 3)."""
    centred = values - values.mean()
    moment = float((centred**order).mean()) / max(1e-9, float(centred.std())) ** order
    return float(np.log(max(moment, 1.0))) if order == 4 else moment


def _quiet_share(detail: Array) -> float:
    """Return the share of 8 x 8 px blocks with less than half of the patch's fine detail: uneven ground."""
    blocks = detail.reshape(PATCH_PX // 8, 8, PATCH_PX // 8, 8).std(axis=(1, 3))
    return float((blocks < 0.5 * detail.std()).mean())


def _template(patch: Array) -> tuple[float, float]:
    """Return half-width, px, and second peak of the score of the patch's middle 21 x 21 px."""
    import cv2

    grey = patch.astype(np.float32)
    score = cv2.matchTemplate(grey, grey[22:43, 22:43], cv2.TM_CCOEFF_NORMED)
    line = (score[22, 22:43] + score[22, 22:1:-1] + score[22:43, 22] + score[22:1:-1, 22]) / 4.0
    below = np.nonzero(line < 0.5)[0]
    width = 20.0
    if len(below):
        k = int(below[0])
        width = k - (0.5 - float(line[k])) / max(1e-6, float(line[k - 1] - line[k]))
    score[14:31, 14:31] = -1.0
    return width, float(score.max())


def _direction(down: Grey, across: Grey) -> tuple[float, float]:
    """Return the structure tensor's anisotropy, 0..1, and the log of vertical to horizontal gradients."""
    yy, xx, xy = float((down**2).mean()), float((across**2).mean()), float((down * across).mean())
    return float(np.hypot(xx - yy, 2 * xy)) / max(1e-6, xx + yy), float(np.log((yy + 1e-6) / (xx + 1e-6)))


def local_binary_patterns(grey: Grey, radius_px: int) -> npt.NDArray[np.uint8]:
    """Return uniform rotation-invariant patterns of eight neighbours: how many are brighter, 9 if mixed.

    `grey` and what comes back are (rows, columns); neighbours lie `radius_px` away in rows, columns and
    diagonals, the edge is repeated. A pattern is uniform if it goes up and down once at most round the pixel.

    Notes
    -----
    Ojala, Pietikaeinen, Maeenpaeae 2002, eq. 9, with neighbours on pixels instead of between them. Ties are
    not brighter: equal greys of an 8-bit picture count as flat.
    """
    r = radius_px
    wide = np.pad(grey, r, mode="edge")
    rows, columns = grey.shape
    ring = ((-r, -r), (-r, 0), (-r, r), (0, r), (r, r), (r, 0), (r, -r), (0, -r))
    up = np.stack([wide[r + i : r + i + rows, r + j : r + j + columns] > grey for i, j in ring])
    changes = (up != np.roll(up, 1, axis=0)).sum(axis=0)
    return np.where(changes <= 2, up.sum(axis=0), 9).astype(np.uint8)
