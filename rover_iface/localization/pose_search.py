"""Every pose of a prior's reach scored against a map, by what of heights and brightness varies within metres.

What varies slower says little and errs most: an orbital DEM's long waves, exposure, haze, the angle of view.
The score is the correlation of a stop's cells with the map under them. How large it becomes by chance is seen
at the thousands of poses that are wrong: its spread there says how many independent cells there are, and that
makes a log likelihood of it. The cells are kept in two halves, sectors by turns, so that what one half finds
can be tested on ground that it never saw.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from rover_iface.errors import LocalizationError
from rover_iface.localization.relief_map import ReliefMap
from rover_iface.localization.stop_relief import StopCells

Array = npt.NDArray[np.float64]
F32 = npt.NDArray[np.float32]
Floats = TypeVar("Floats", F32, Array)
FIRST, SECOND, BOTH = 0, 1, 2


@dataclass(frozen=True, slots=True)
class SearchReach:
    """Which poses are tried: shifts up to `shift_m` along each axis, turns up to `turn_rad`."""

    shift_m: float
    turn_rad: float
    turn_step_rad: float = math.radians(1.0)
    """A degree moves ground 25 m away by 0.44 m, less than a cell of the search."""

    def __post_init__(self) -> None:
        for name in ("shift_m", "turn_rad", "turn_step_rad"):
            if not getattr(self, name) > 0:
                raise LocalizationError(f"{name} of a search is {getattr(self, name)}; it must be positive")

    @property
    def turns(self) -> Array:
        """Return the turns (k,), rad, the middle one 0."""
        count = math.ceil(self.turn_rad / self.turn_step_rad - 1e-9)
        return np.asarray(np.arange(-count, count + 1) * self.turn_step_rad, dtype=float)


@dataclass(frozen=True, eq=False, slots=True)
class PoseGrid:
    """Log likelihood of each turn and shift from the believed pose, by one kind of evidence or by several.

    Attributes
    ----------
    likelihood
        (3, turns, north, east), nats over chance: of the first half, the second, and both; NaN where the map
        knows too little.
    correlation
        The same shape; of one kind alone, else NaN.
    turns_rad, step_m
        The turns; shifts are multiples of `step_m`, 0 in the middle.
    """

    likelihood: Array
    correlation: Array
    turns_rad: Array
    step_m: float

    @property
    def reach(self) -> int:
        """Return the largest shift, in steps."""
        return (self.likelihood.shape[2] - 1) // 2

    def best(self, half: int = BOTH) -> int:
        """Return the flat index, within one half, of the likeliest pose."""
        return int(np.nanargmax(self.likelihood[half]))

    def pose(self, flat: int) -> Array:
        """Return (east, north, turn) of a flat index, from the believed pose; m and rad."""
        k, j, i = np.unravel_index(flat, self.likelihood.shape[1:])
        return np.array([(i - self.reach) * self.step_m, (j - self.reach) * self.step_m, self.turns_rad[k]])

    def near(self, pose: Array, shift_m: float, turn_rad: float) -> npt.NDArray[np.bool_]:
        """Return which poses (turns, north, east) lie within both limits of `pose` (3,)."""
        along = (np.arange(self.likelihood.shape[2]) - self.reach) * self.step_m
        away = np.hypot(along[None, :] - pose[0], along[:, None] - pose[1])
        turned = np.abs(self.turns_rad - pose[2])
        return np.asarray((away[None] <= shift_m) & (turned[:, None, None] <= turn_rad))

    def __add__(self, other: PoseGrid) -> PoseGrid:
        """Return the likelihood of both kinds of evidence; where one is unknown the other stands alone."""
        one, two = self.likelihood, other.likelihood
        total = np.where(np.isnan(one), two, np.where(np.isnan(two), one, one + two))
        nothing = np.full_like(self.correlation, np.nan)
        return PoseGrid(total, nothing, self.turns_rad, self.step_m)


def fine_structure(values: npt.NDArray[np.floating], over: float) -> F32:
    """Return `values` [rows, columns] less their mean by a Gaussian of `over` posts; NaN stays unknown."""
    import cv2

    known = np.isfinite(values)
    filled = np.where(known, values, 0.0).astype(np.float32)
    size = 2 * math.ceil(2.5 * over) + 1

    def blur(image: F32) -> F32:
        done = cv2.GaussianBlur(image, (size, size), over, borderType=cv2.BORDER_CONSTANT)
        return np.asarray(done, dtype=np.float32)

    mean = blur(filled) / np.maximum(blur(known.astype(np.float32)), 1e-6)
    return np.where(known, filled - mean, np.nan).astype(np.float32)


def bounded(fine: Floats) -> Floats:
    """Return fine structure (n,) or (r, c) cut at 2.5 deviations: shadows are there under one sun only."""
    seen = fine[np.isfinite(fine)]
    if not len(seen):
        return fine
    most = 2.5 * 1.4826 * float(np.median(np.abs(seen)))
    return np.clip(fine, -most, most)


def search(
    values: F32,
    grid: ReliefMap,
    eye: Array,
    cells: StopCells,
    own: Array,
    weights: Array,
    reach: SearchReach,
    *,
    least_share: float,
) -> PoseGrid | None:
    """Return the likelihood of every pose by one kind of evidence, or None where cells or map have none.

    Parameters
    ----------
    values
        Fine structure of the map, on the posts of `grid`, NaN where unknown.
    eye
        (2,), believed place of the stop's eye, m.
    own, weights
        (n,): fine structure of the stop's cells, NaN where unknown, and what each counts.
    least_share
        How much of the cells' weight must fall on known map, of each half.

    Notes
    -----
    Sums over all shifts by FFT; the halves are the real and the imaginary part of one raster.
    """
    good = np.isfinite(own)
    if good.sum() < 100:  # of some thousand; fewer give no spread to judge chance by
        return None
    places, halves = cells.places[good, :2], cells.second_half[good]
    own = own[good] - np.average(own[good], weights=weights[good])
    weights = weights[good] / weights[good].sum()
    frame = _Frame(values, grid, eye, places, reach)
    if not frame.knows:
        return None
    correlation, known = [], []
    for turn in reach.turns:
        rho, share = frame.correlations(places, halves, own, weights, float(turn))
        correlation.append(rho)
        known.append(share)
    half = np.array([weights[~halves].sum(), weights[halves].sum(), 1.0])
    share = np.stack(known, axis=1) / np.maximum(half, 1e-9)[:, None, None, None]
    rho = np.where(share >= least_share, np.stack(correlation, axis=1), np.nan)
    if not np.isfinite(rho[BOTH]).any():
        return None
    return PoseGrid(_likelihood(rho), rho, reach.turns, grid.spacing_m)


def _likelihood(rho: Array) -> Array:
    """Return log likelihoods of correlations (3, turns, north, east), by their spread at all poses.

    Of n independent pairs the correlation spreads by n^-1/2 about 0 if they have nothing in common, and the
    likelihood ratio of the best line against none is (1 - rho^2)^(-n/2). A negative one speaks for nothing.
    """
    out = np.full_like(rho, np.nan)
    for half in (FIRST, SECOND, BOTH):
        seen = rho[half][np.isfinite(rho[half])]
        if len(seen) < 100:
            continue
        # the middle 68 %: the true pose and its neighbours do not widen it
        low, high = np.percentile(seen, (15.9, 84.1))
        spread = max(0.5 * float(high - low), 1e-3)
        cut = np.clip(rho[half] - 0.5 * float(low + high), 0.0, 0.999)
        out[half] = -0.5 / spread**2 * np.log1p(-(cut**2))
    return out


class _Frame:
    """A map about the eye with a rim so wide that no cell leaves it, and its transforms."""

    def __init__(self, values: F32, grid: ReliefMap, eye: Array, places: Array, reach: SearchReach) -> None:
        from scipy import fft

        self.step = grid.spacing_m
        self.steps = math.ceil(reach.shift_m / self.step - 1e-9)
        radius = float(np.hypot(places[:, 0], places[:, 1]).max())
        self.rim = math.ceil(radius / self.step) + self.steps + 2
        self.size = fft.next_fast_len(2 * self.rim + 1)
        u, v = (eye[0] - grid.west_m) / self.step, (eye[1] - grid.south_m) / self.step
        i, j = round(u), round(v)
        self.rest = u - i, v - j
        framed = np.full((self.size, self.size), np.nan, np.float32)
        r0, c0 = j - self.rim, i - self.rim
        rows = slice(max(0, r0), min(values.shape[0], r0 + self.size))
        columns = slice(max(0, c0), min(values.shape[1], c0 + self.size))
        if rows.start < rows.stop and columns.start < columns.stop:
            framed[rows.start - r0 : rows.stop - r0, columns.start - c0 : columns.stop - c0] = values[
                rows, columns
            ]
        known = np.isfinite(framed)
        self.knows = bool(known.any())
        filled = np.where(known, framed, 0.0).astype(np.float32)
        layers = np.stack([known.astype(np.float32), filled, filled * filled])
        self.whole = bool(known.all())
        self.transforms = np.conj(fft.fft2(layers.astype(np.complex64)))

    def correlations(
        self, places: Array, halves: npt.NDArray[np.bool_], own: Array, weights: Array, turn: float
    ) -> tuple[Array, Array]:
        """Return correlation and known weight (3, north, east) of each half and both at every shift."""
        from scipy import fft

        from rover_iface.localization.relocalisation_kernels import add_cells

        c, s = math.cos(turn), math.sin(turn)
        x = c * places[:, 0] - s * places[:, 1]
        y = s * places[:, 0] + c * places[:, 1]
        rows = np.rint(self.rest[1] + y / self.step).astype(np.int64) + self.rim
        columns = np.rint(self.rest[0] + x / self.step).astype(np.int64) + self.rim
        raster = np.zeros((3, self.size, self.size, 2), np.float32)
        add_cells(rows, columns, halves, weights, own, raster)
        stop = fft.fft2(raster.view(np.complex64)[..., 0])
        # of halves a + i b and a real map m, conj(F(m)) F(a + i b) holds both correlations at minus the shift
        known, value, square = self.transforms
        pairs = [value * stop[0], square * stop[0], value * stop[1]]
        if not self.whole:
            pairs += [known * stop[0], known * stop[1], known * stop[2]]
        sums = fft.ifft2(np.stack(pairs))
        shifts = -np.arange(-self.steps, self.steps + 1)
        cut = sums[:, shifts[:, None], shifts[None, :]]
        parts = np.stack([cut.real, cut.imag, cut.real + cut.imag], axis=1).astype(np.float64)
        sm, smm, sms = parts[:3]
        if self.whole:  # all cells count at every shift
            one, two = raster[..., 0].sum(axis=(1, 2)), raster[..., 1].sum(axis=(1, 2))
            fixed = np.array([one, two, one + two], dtype=float).T[:, :, None, None]
            s0, ss, sss = (np.broadcast_to(f, sm.shape) for f in fixed)
        else:
            s0, ss, sss = parts[3:]
        with np.errstate(invalid="ignore", divide="ignore"):
            spread = (smm - sm * sm / s0) * (sss - ss * ss / s0)
            rho = (sms - sm * ss / s0) / np.sqrt(np.where(spread > 0, spread, np.nan))
        return np.where(s0 > 1e-6, rho, np.nan), s0
