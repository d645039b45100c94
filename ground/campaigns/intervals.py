"""Intervals of 95 %: of a mean, of a share, of a quantile. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist

CONFIDENCE = 0.95
Z = NormalDist().inv_cdf(0.5 + CONFIDENCE / 2)

Interval = tuple[float, float]


def mean_interval(mean: float, standard_error: float, runs: int) -> Interval:
    """Return the interval of a mean by Student's distribution with `runs - 1` degrees of freedom."""
    if runs < 2:
        return -math.inf, math.inf
    half = student(runs - 1) * standard_error
    return mean - half, mean + half


def student(freedom: float) -> float:
    """Return the two-sided 95 % quantile of Student's distribution."""
    if freedom > 1000:
        return Z
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + CONFIDENCE / 2))


def share_interval(count: int, runs: int) -> Interval:
    """Return Wilson's score interval of a share (Wilson 1927); within 0 and 1, sound for small counts."""
    if runs == 0:
        return 0.0, 1.0
    share, z2 = count / runs, Z * Z
    middle = (share + z2 / (2 * runs)) / (1 + z2 / runs)
    half = Z * math.sqrt(share * (1 - share) / runs + z2 / (4 * runs * runs)) / (1 + z2 / runs)
    # At the ends the bound is exact; rounding must not leave the share outside its own interval.
    return (0.0 if count == 0 else max(0.0, middle - half)), (
        1.0 if count == runs else min(1.0, middle + half)
    )


def quantile_interval(ordered: Sequence[float], p: float) -> Interval:
    """Return the order statistics between which a quantile lies, by the binomial distribution of ranks.

    Exact for any continuous distribution where the sample is large enough; else the ends of the sample.
    """
    from scipy.special import bdtr

    runs = len(ordered)
    guess = Z * math.sqrt(runs * p * (1 - p))
    low, high = max(0, math.floor(runs * p - guess) - 1), min(runs - 1, math.ceil(runs * p + guess))
    # Widen until P(low < rank <= high) is enough: the normal guess is short in the tails.
    while low > 0 and bdtr(low - 1, runs, p) > (1 - CONFIDENCE) / 2:
        low -= 1
    while high < runs - 1 and 1 - bdtr(high, runs, p) > (1 - CONFIDENCE) / 2:
        high += 1
    return float(ordered[low]), float(ordered[high])


def quantile(ordered: Sequence[float], p: float) -> float:
    """Return a quantile of ordered values, between neighbours by their ranks (type 7 of Hyndman and Fan)."""
    at = p * (len(ordered) - 1)
    low = math.floor(at)
    high = min(low + 1, len(ordered) - 1)
    return float(ordered[low] + (at - low) * (ordered[high] - ordered[low]))


class Moments:
    """Mean and spread of numbers that come one by one (Welford 1962)."""

    def __init__(self) -> None:
        self.runs, self.mean, self._m2 = 0, 0.0, 0.0

    def add(self, number: float) -> None:
        self.runs += 1
        step = number - self.mean
        self.mean += step / self.runs
        self._m2 += step * (number - self.mean)

    @property
    def sd(self) -> float:
        return math.sqrt(self._m2 / (self.runs - 1)) if self.runs > 1 else 0.0

    @property
    def standard_error(self) -> float:
        return self.sd / math.sqrt(self.runs) if self.runs else math.inf
