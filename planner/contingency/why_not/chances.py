"""How often an order makes the observation asked for, as values without sampling told at some factors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Times = NDArray[np.float32]


class Right(NamedTuple):
    """How many times as often as futures tell an order makes the observation asked for.

    `widens` is the row of the curves and whether the downlink volume is widened: with another limit the
    numbers of factors mean something else. `known` is what is known by these numbers, `times` [factors] the
    same carried on to the others by straight lines, and it is `sure` [factors] where it is known.
    """

    widens: tuple[int | None, bool]
    known: dict[int, float]
    times: Times
    sure: NDArray[np.bool_]

    @classmethod
    def of(cls, widens: tuple[int | None, bool], known: dict[int, float], factors: int) -> Right:
        """Return what is known at some of so many factors, carried on to the others."""
        numbers = sorted(known)
        times = np.interp(np.arange(factors), numbers, [known[k] for k in numbers]).astype(np.float32)
        sure = np.zeros(factors, np.bool_)
        sure[numbers] = True
        return cls(widens, known, times, sure)

    def at_most(self, widens: tuple[int | None, bool], at: slice, leeway: float) -> Times:
        """Return how many times as often at most, [factors]: `leeway` times as often as told where it is not
        known.
        """
        sure = self.sure[at] & (self.widens == widens)
        return np.where(sure, np.float32(1.0), np.float32(leeway)) * self.times[at]
