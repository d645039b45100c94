"""Whether what a tracker tells of its errors holds, watched while it runs, and corrected where it does not.

No truth is at hand on the way, but two measurements of one thing are: a template of this stop and one of an
earlier one, a range and the one expected. Each such pair tells whether a 95 % region held. The factor on the
covariance follows adaptive conformal inference (Gibbs and Candes 2021): it rises by `rate` times 0.95
with each miss, falls by `rate` times 0.05 with each hit, so that in the long run 95 % of the checks hold
whatever the pictures are like.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

LEVEL = 0.95
INSIDE = {1: 3.841, 2: 5.991}
"""95 % of chi square, by degrees of freedom."""


@dataclass(slots=True)
class CoverageWatch:
    """Counts checks and keeps the factor on the variances that are told; it never shrinks them below 1.

    `rate` is the share by which one miss raises the logarithm of the factor: 0.1 needs some twenty
    misses in a row of surprises to reach `most`, and forgets one within twenty hits.
    """

    rate: float = 0.1
    most: float = 9.0
    checks: int = 0
    held: int = 0
    _log: float = 0.0

    @property
    def factor(self) -> float:
        """Return what variances are to be multiplied by."""
        return math.exp(self._log)

    @property
    def coverage(self) -> float:
        """Return the share of checks that held, with the factor of their time; NaN before the first."""
        return self.held / self.checks if self.checks else math.nan

    def see(self, squared: float, freedom: int) -> None:
        """Take a check: squared error over the variance told without the factor, its freedom (1, 2)."""
        if not math.isfinite(squared):
            return
        held = squared <= INSIDE[freedom] * self.factor
        self.checks += 1
        self.held += held
        step = self.rate * ((0.0 if held else 1.0) - (1.0 - LEVEL))
        self._log = min(math.log(self.most), max(0.0, self._log + step))
