"""What kinds of activities came to in recorded runs: odds, times and energies, drawn to what was believed.

Of n activities of a kind s succeeded. With a belief p0 worth K = `BELIEVED` of them, the odds are
(s + K p0) / (n + K), the mean of a beta distribution of parameters K p0 and K (1 - p0) after n trials
(Gelman et al. 2013, Bayesian Data Analysis, section 2.4). Neither parameter is less than `HALF`, so a profile
that says that a kind never fails is not taken for certain once it was tried. Means and variances of times and
energies are those of the n and K others as believed taken together. Where the days are known, successes of
one day may go together (`intraday_correlation`): that leaves the odds, and widens their error by the square
root of the design effect.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from typing import Annotated

import numpy as np
import numpy.typing as npt
from annotated_types import Ge, MinLen

from mission.values import Chance, NotNegative, Share, value
from planner.errors import ProblemError
from planner.path_network.intraday_correlation import UNKNOWN, design_effect, fit_intraday_correlation

BELIEVED = 5.0
"""Activities that what was believed before is worth. By hand: half of the least that a calibration is made of
(`driven_legs.FEWEST_LEGS`), so that ten that were seen weigh twice as much."""

HALF = 0.5
"""Of a failure: what is believed where no figure is known, as Jeffreys' prior of a rate has it (Gelman et al.
2013, section 2.8)."""

TRACK_START = "trackstart"
"""Kind of the activity that begins a track; others are named by their instrument."""


@value
class ActivityFit:
    """Odds, time (s) and energy (J, without hotel load) of one kind of activity; `tried` 0 is a belief.

    `p_se` is the standard error of `p_success`; 0 for a belief. `intraday_correlation` is that of the
    successes of one day, `intraday_correlation_se` its error, `days` how many days of two tries or more it
    rests on; 0 where they are taken as independent.
    """

    name: Annotated[str, MinLen(1)]
    p_success: Chance
    time_mean_s: NotNegative
    time_sd_s: NotNegative
    energy_mean_j: NotNegative
    energy_sd_j: NotNegative
    tried: Annotated[int, Ge(0)] = 0
    succeeded: Annotated[int, Ge(0)] = 0
    p_se: NotNegative = 0.0
    intraday_correlation: Share = 0.0
    intraday_correlation_se: NotNegative = 0.0
    days: Annotated[int, Ge(0)] = 0

    @property
    def expected_correlation(self) -> float:
        """The correlation of two successes of a day to come; 0 where it is not known how days differ.

        They go together because days differ, and because the odds themselves are known to `p_se` only: the
        variance of a day's odds is the mean of rho p (1 - p) and `p_se`^2 (law of total variance).
        """
        if not self.days or not 0.0 < self.p_success < 1.0:
            return 0.0
        unknown = min(1.0, self.p_se**2 / (self.p_success * (1.0 - self.p_success)))
        return self.intraday_correlation + (1.0 - self.intraday_correlation) * unknown


def fit_activity(
    belief: ActivityFit,
    success: Sequence[bool],
    duration_s: Sequence[float],
    energy_j: Sequence[float],
    day: Sequence[Hashable] = (),
) -> ActivityFit:
    """Return what is believed of a kind of activity after some of it; itself where there were none.

    `day` is that of each; without them successes are taken as independent.

    Raises
    ------
    ProblemError
        If there are not as many times and energies as outcomes, or one is negative or not finite.
    """
    count = len(success)
    times, energies = np.asarray(duration_s, dtype=np.float64), np.asarray(energy_j, dtype=np.float64)
    if times.shape != (count,) or energies.shape != (count,):
        shapes = f"times of shape {times.shape}, energies {energies.shape}"
        raise ProblemError(f"activity {belief.name}: {count} outcomes, {shapes}")
    if not all(np.all(np.isfinite(x) & (x >= 0.0)) for x in (times, energies)):
        raise ProblemError(f"activity {belief.name}: a time or an energy is negative or not finite")
    if not count:
        return belief
    succeeded = sum(map(bool, success))
    believed = min(max(BELIEVED * belief.p_success, HALF), BELIEVED - HALF)
    p = (succeeded + believed) / (count + BELIEVED)
    time_mean, time_sd = _together(times, belief.time_mean_s, belief.time_sd_s)
    energy_mean, energy_sd = _together(energies, belief.energy_mean_j, belief.energy_sd_j)
    together = UNKNOWN
    if len(day):
        together = fit_intraday_correlation(success, day, (believed, BELIEVED - believed))
    widened = design_effect(together.mean, day) if together.days else 1.0
    return ActivityFit(
        name=belief.name,
        p_success=p,
        time_mean_s=time_mean,
        time_sd_s=time_sd,
        energy_mean_j=energy_mean,
        energy_sd_j=energy_sd,
        tried=count,
        succeeded=succeeded,
        p_se=math.sqrt(widened * p * (1.0 - p) / (count + BELIEVED + 1.0)),
        intraday_correlation=together.mean,
        intraday_correlation_se=together.error,
        days=together.days,
    )


def _together(seen: npt.NDArray[np.float64], mean: float, sd: float) -> tuple[float, float]:
    """Return mean and deviation of what was seen (n,) and `BELIEVED` more of this mean and deviation."""
    weight = len(seen) + BELIEVED
    both = (float(seen.sum()) + BELIEVED * mean) / weight
    square = float(np.square(seen - both).sum()) + BELIEVED * (sd**2 + (mean - both) ** 2)
    return both, math.sqrt(square / weight)
