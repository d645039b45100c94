"""How far the successes of a day go together: the intraclass correlation of a beta-binomial number.

On day d the odds of an activity are a draw of a beta distribution of mean p, and each of the day's coins
falls by them. Two coins of a day then have the correlation rho, the intraclass correlation with the day as
class: the parameters of the beta distribution are p (1 - rho) / rho and (1 - p) (1 - rho) / rho (Skellam
1948). Coins of n tries of a day come to a variance of n p (1 - p) (1 + (n - 1) rho).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from planner.errors import ProblemError

Floats = npt.NDArray[np.float64]

BELIEVED_MEAN = 0.1
"""What is believed of rho before, in the mean: of a beta distribution with the parameters 1 and 9, which has
one of twenty above 0.28. By hand, with 100 days known that came to about 0.13. Where rho is 0, k days of n
tries tell it to sqrt(2 / (k n (n - 1))), twenty of three to 0.13: what was believed outweighs so few, and a
hundred days outweigh what was believed."""

CELLS = 200
"""Of the grid over p and of that over rho. By hand: with twice as many no mean moves by 1e-4."""


@dataclass(frozen=True, slots=True)
class IntradayCorrelation:
    """Mean of rho after the days seen, its standard deviation, and how many days had two tries or more."""

    mean: float
    error: float
    days: int


UNKNOWN = IntradayCorrelation(0.0, 0.0, 0)
"""Where no day was tried twice: coins are taken as independent."""


def fit_intraday_correlation(
    success: Sequence[bool], day: Sequence[Hashable], believed: tuple[float, float] = (1.0, 1.0)
) -> IntradayCorrelation:
    """Return how far the successes of a day go together; `UNKNOWN` where no day holds two tries.

    Parameters
    ----------
    success, day
        Whether each try succeeded and the day that it was made on, both [n].
    believed
        Parameters of the beta distribution that the odds p have before, both positive.

    Raises
    ------
    ProblemError
        If there are not as many days as outcomes, or a parameter is not positive.

    Notes
    -----
    The mean after the days by Bayes' rule, over a grid of p and rho (Gelman et al. 2013, section
    5.3, who do so for the two parameters of the beta distribution). The likelihood has the form of Griffiths
    1973, a product over tries that holds at rho = 0 too. The mean and not the mode is taken because the
    variance of what a day earns is linear in rho: with the mean its prediction has the variance it should
    have.
    """
    if len(success) != len(day):
        raise ProblemError(f"{len(success)} outcomes and {len(day)} days; as many of both are needed")
    if min(believed) <= 0.0:
        raise ProblemError(f"the odds believed before have the parameters {believed}; both must be positive")
    tried, succeeded = Counter(day), Counter(d for d, good in zip(day, success, strict=True) if good)
    several = sum(count > 1 for count in tried.values())
    if not several:
        return UNKNOWN
    middle = (np.arange(CELLS) + 0.5) / CELLS
    p, rho = middle[:, None], middle[None, :]
    apart = 1.0 - rho
    log_weight = (
        (believed[0] - 1.0) * np.log(p)
        + (believed[1] - 1.0) * np.log1p(-p)
        + (1.0 / BELIEVED_MEAN - 2.0) * np.log(apart)
    )
    good = [succeeded[d] for d in tried]
    bad = [tried[d] - succeeded[d] for d in tried]
    for r in range(max(tried.values())):
        log_weight = (
            log_weight
            + sum(y > r for y in good) * np.log(p * apart + r * rho)
            + sum(y > r for y in bad) * np.log((1.0 - p) * apart + r * rho)
            - sum(n > r for n in tried.values()) * np.log(apart + r * rho)
        )
    weight: Floats = np.exp(log_weight - log_weight.max()).sum(axis=0)
    weight /= weight.sum()
    mean = float(weight @ middle)
    return IntradayCorrelation(mean, float(np.sqrt(weight @ np.square(middle - mean))), several)


def design_effect(correlation: float, day: Sequence[Hashable]) -> float:
    """Return by how much the variance of a mean over tries exceeds that of independent ones (Kish 1965, 5.4).

    `day` is that of each try, not empty; the weights of days by their tries are taken as they are.
    """
    tried = Counter(day).values()
    return 1.0 + correlation * (sum(n * n for n in tried) / sum(tried) - 1.0)
