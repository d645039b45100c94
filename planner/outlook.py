"""What a day's plan may earn: the distribution of its utility, with every success drawn.

Plans are searched and valued with the mean of each observation, which is all that their mean needs. What a
day may come to needs the successes themselves, and these go together within a day: what makes one placement
hard on a site makes the others hard. On each future the observations of a kind (placements, images) share one
draw, which says how good their odds are on that day: each takes that quantile of a beta distribution of mean
`p_success` and intraclass correlation rho (`path_network.intraday_correlation`), and its coin falls by them.
So the observations of one instrument come to a beta-binomial number, and every mean stays as it was, since no
step of a plan turns on whether an observation succeeded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from planner.contingency.reduction import held_by
from planner.evaluate.model import Floats, Ints, Model
from planner.evaluate.monte_carlo import Futures, simulate
from planner.plan_tree import Plan
from planner.problem import Kind, Observation, Problem

FUTURES = 20_000
"""Of an outlook: a share of 5 % to 0.15 %."""

BITS = 50
"""Observations told apart in one sum of powers of two; floats hold 53 bits."""

DIGITS = 6
"""Of utilities: sums of the same observations in another order are one value."""

COINS, DAYS = 0xC01, 0xDA5
"""Named streams: of success coins, and of what the observations of a day have in common."""


@dataclass(frozen=True, eq=False)
class Outlook:
    """What a plan earns in drawn futures, and what it uses in the mean.

    `values` (k,) are the utilities that it may come to, rising, and `shares` (k,) those of the futures with
    each. `made` holds the chance that each observation of the problem is made and succeeds, in its order.
    `time_s`, `energy_j` and `overrun` (the chance of ending over a budget) are means.
    """

    values: Floats
    shares: Floats
    mean: float
    sd: float
    time_s: float
    energy_j: float
    overrun: float
    made: tuple[float, ...]

    def quantile(self, p: float) -> float:
        """Return the least utility that at least a share `p` of the futures do not exceed."""
        reached = int(np.searchsorted(np.cumsum(self.shares), p - 1e-12))
        return float(self.values[min(reached, len(self.values) - 1)])


def outlook(problem: Problem, plan: Plan, *, seed: int, futures: int = FUTURES) -> Outlook:
    """Return what a plan may come to on its day.

    A seed has the same futures whatever the correlation; their coins are tossed with the day's odds.
    """
    part = held_by(problem, plan)
    model = Model.of(part)
    carried, worth = _carried_out(model, plan, futures, seed)
    coins = np.random.default_rng([seed, COINS]).random(worth.shape)
    success = (worth > 0.0) & (coins < day_odds(part, futures, seed=seed))
    earned: Floats = (worth * success) @ model.utility - model.penalty * carried.overrun
    rounded: Floats = np.round(earned, DIGITS)
    values, counts = np.unique(rounded, return_counts=True)
    made = dict(zip(model.observation_ids, success.mean(axis=0).tolist(), strict=True))
    return Outlook(
        values=values,
        shares=counts / futures,
        mean=float(earned.mean()),
        sd=float(earned.std()),
        time_s=float(carried.time_s.mean()),
        energy_j=float(carried.energy_j.mean()),
        overrun=float(carried.overrun.mean()),
        made=tuple(made.get(o.id, 0.0) for o in problem.observations),
    )


def day_odds(problem: Problem, futures: int, *, seed: int) -> Floats:
    """Return the odds that each observation has on the day of each future, (futures, observations).

    Their means over the futures are `p_success`; without a correlation they are that on every day.
    """
    rng = np.random.default_rng([seed, DAYS])
    shared = {kind: rng.random(futures) for kind in Kind}
    known: dict[tuple[Kind, float, float], Floats] = {}

    def odds(o: Observation) -> Floats:
        rho = problem.intraday_correlation.get(o.instrument, 0.0)
        which = o.kind, o.p_success, rho
        if which not in known:
            known[which] = beta_quantile(shared[o.kind], o.p_success, rho)
        return known[which]

    return np.column_stack([odds(o) for o in problem.observations] or [np.zeros((futures, 0))])


def beta_quantile(share: npt.ArrayLike, mean: float, correlation: float) -> Floats:
    """Return quantiles of the beta distribution of a mean and an intraclass correlation, both 0 to 1.

    Parameters
    ----------
    share
        Shape (n,), between 0 and 1.

    Notes
    -----
    At a correlation of 0 every quantile is the mean; at 1 the odds of a day are 0 or 1.
    """
    u = np.asarray(share, dtype=np.float64)
    if correlation <= 0.0 or not 0.0 < mean < 1.0:
        return np.full(u.shape, mean)
    if correlation >= 1.0:
        return (u >= 1.0 - mean).astype(np.float64)
    from scipy.special import betaincinv

    size = (1.0 - correlation) / correlation
    found: Floats = betaincinv(mean * size, (1.0 - mean) * size, u)
    return found


def _carried_out(model: Model, plan: Plan, futures: int, seed: int) -> tuple[Futures, Floats]:
    """Return futures with what they used, and by how much the utility of each observation counts in each,
    (futures, observations): 0 where it is not carried out, less than 1 after others of its target where that
    diminishes.

    An evaluator's future tells one sum. Where each observation is worth a power of two, the sum tells which
    were carried out; those of targets that diminish are asked for one by one.
    """
    worth = np.zeros((futures, model.m))

    def run(group: Ints) -> Futures:
        utility = np.zeros(model.m)
        utility[group] = np.exp2(np.arange(len(group), dtype=np.float64))
        asked = replace(model, utility=utility, p_success=np.ones(model.m), penalty=0.0)
        return simulate(asked, plan, futures, seed=seed, threads=1)

    count = np.bincount(model.obs_place, minlength=model.n + 1)
    less = ((model.diminishing < 1.0) & (count > 1))[model.obs_place]
    others = np.flatnonzero(~less)
    done = None
    for first in range(0, len(others), BITS):
        group = others[first : first + BITS]
        done = run(group)
        worth[:, group] = (done.utility.astype(np.int64)[:, None] >> np.arange(len(group))) & 1
    for k in np.flatnonzero(less):
        done = run(np.array([k]))
        worth[:, k] = done.utility
    return done or run(others), worth
