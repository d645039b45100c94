"""The factor that all drives of a day share: how far days are apart, and the kinds of sols that come of it.

On day d the log of what drive i took over what was predicted is u_d + e_di, with normal u_d of standard
deviation s between days and e_di within them. The analysis of variance of one factor gives the squares of
both (Searle, Casella and McCulloch 1992, section 3.6), and its F test says whether days differ at all.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from planner.errors import ProblemError

Floats = npt.NDArray[np.float64]

SIGNIFICANT = 0.01
"""Chance at which days that are alike are taken for different ones. By hand: times and energies are tested,
and kinds of sols make planning several times as long."""

LEAST_SD = 0.02
"""Standard deviations of the factor below which it is left out: a day then differs by 2 %."""

MOST_SD = 1.0
"""Largest taken into kinds of sols: a slow one then takes four times as long as one that is not. By hand."""

DIGITS = 6
NODES = ((1.0 / 6.0, math.sqrt(3.0)), (2.0 / 3.0, 0.0), (1.0 / 6.0, -math.sqrt(3.0)))
"""Weights and nodes of the Gauss-Hermite rule of three points for a standard normal number: the first five
moments are those of the normal."""


@dataclass(frozen=True, slots=True)
class DayFactor:
    """Standard deviations of log(real / predicted) between days and within one, and what they rest on.

    `error` is the standard error of `between_sd`; `p` the chance that days which are alike look as different.
    """

    between_sd: float
    within_sd: float
    error: float
    p: float
    days: int

    @property
    def adopted(self) -> bool:
        """Whether days differ for sure, and by more than `LEAST_SD`."""
        return self.p < SIGNIFICANT and self.between_sd >= LEAST_SD


def fit_day_factor(log_ratio: npt.ArrayLike, day: Sequence[Hashable]) -> DayFactor:
    """Return how far days are apart, by the method of moments.

    Parameters
    ----------
    log_ratio
        Shape (drives,): log of real over predicted time, or energy.
    day
        The day of each drive.

    Raises
    ------
    ProblemError
        If shapes disagree or a ratio is not finite.
    """
    x = np.asarray(log_ratio, dtype=np.float64)
    if x.shape != (len(day),) or not np.all(np.isfinite(x)):
        raise ProblemError(f"log ratios have shape {x.shape}, days {len(day)}; finite ones are needed")
    names = list(dict.fromkeys(day))
    number = np.array([names.index(d) for d in day], np.int64)
    count, days = np.bincount(number, minlength=len(names)).astype(float), len(names)
    if days < 2 or len(x) <= days:
        return DayFactor(0.0, float(x.std()) if len(x) else 0.0, 0.0, 1.0, days)
    from scipy.stats import f as f_distribution

    means = np.bincount(number, x) / count
    free = (days - 1, len(x) - days)
    between = float(count @ np.square(means - x.mean())) / free[0]
    within = float(np.square(x - means[number]).sum()) / free[1]
    usual = (len(x) - float(np.square(count).sum()) / len(x)) / free[0]
    square = max(0.0, (between - within) / usual)
    # variances of mean squares of normal numbers; of a square root by the delta method
    spread = math.sqrt(2.0 * (between**2 / free[0] + within**2 / free[1])) / usual
    p = float(f_distribution.sf(between / within, *free)) if within > 0.0 else float(between <= 0.0)
    sd = math.sqrt(square)
    return DayFactor(sd, math.sqrt(within), spread / (2.0 * sd) if sd > 0.0 else 0.0, p, days)


NO_FACTOR = DayFactor(0.0, 0.0, 0.0, 1.0, 0)
"""Where days are alike, or it is not known which legs were driven on one."""


def day_factors(log_time: Floats, log_energy: Floats, day: Sequence[Hashable]) -> tuple[DayFactor, DayFactor]:
    """Return the factors on times and energies of drives that are adopted, `NO_FACTOR` for one that is not.

    `log_time` and `log_energy` (drives,) are logs of real over predicted. Where both differ between days but
    not together, the one on energies is left out: kinds of sols hold one cause.
    """
    time_s, energy_j = (
        found if found.adopted else NO_FACTOR
        for found in (fit_day_factor(log_time, day), fit_day_factor(log_energy, day))
    )
    if time_s.days and energy_j.days:
        names = list(dict.fromkeys(day))
        number = np.array([names.index(d) for d in day], np.int64)
        times, energies = (np.bincount(number, x) / np.bincount(number) for x in (log_time, log_energy))
        if float((times - times.mean()) @ energies) <= 0.0:
            energy_j = NO_FACTOR
    return time_s, energy_j


@dataclass(frozen=True, slots=True)
class SharedFactor:
    """A kind of sol by the day factor: its probability, and the factors on times and energies of drives."""

    name: str
    p: float
    drive_time_factor: float
    drive_energy_factor: float


def kinds_of_days(time_sd: float, energy_sd: float) -> tuple[SharedFactor, ...]:
    """Return three kinds of sols for log-normal day factors of these deviations; none where both are 0.

    Times and energies are taken as moved by one cause: a day with long drives has hungry ones. Means over the
    kinds are 1, as legs state means over days. Figures have `DIGITS` digits.
    """
    if time_sd <= 0.0 and energy_sd <= 0.0:
        return ()
    names = ("slow", "usual", "quick") if time_sd > 0.0 else ("hungry", "usual", "sparing")
    times, energies = _factors(time_sd), _factors(energy_sd)
    return tuple(
        SharedFactor(name, p, t, g) for name, (p, _), t, g in zip(names, NODES, times, energies, strict=True)
    )


def _factors(sd: float) -> list[float]:
    sd = min(sd, MOST_SD)
    raw = [math.exp(sd * node) for _, node in NODES]
    mean = math.fsum(p * value for (p, _), value in zip(NODES, raw, strict=True))
    return [round(value / mean, DIGITS) for value in raw]
