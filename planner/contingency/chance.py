"""Plans under a chance constraint: the multiplier of an overrun at which a plan keeps within it.

The chance of ending over a budget is bought out with a multiplier on top of the problem's own cost (after
Lagrange). For any multiplier, the optimal value with it plus multiplier times allowed chance bounds every
policy that keeps to the constraint.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from planner.constraints.overrun import OverrunChance
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.plan_tree import Plan

FUTURES = 200_000
"""For a share of 0.05 a standard error of 0.0005."""

GROWTH = 4.0
"""Factor from one multiplier to the next while none is high enough. By hand."""

TRIED = 9
"""Multipliers tried after the first, each three or so times the work of a what-if."""


def keeps_to(model: Model, plan: Plan, chance: OverrunChance, *, seed: int) -> bool:
    """Return whether a plan keeps to a chance constraint, with 99 % confidence."""
    return chance.kept(float(np.mean(simulate(model, plan, FUTURES, seed=seed).overrun)), FUTURES)


def plans_within(
    find: Callable[[float, bool], list[Plan]],
    keeps: Callable[[Plan], bool],
    *,
    first_price: float,
    should_stop: Callable[[], bool],
) -> tuple[list[Plan], list[float]]:
    """Return plans that keep to a chance constraint, and the multipliers next to the least one that does.

    Parameters
    ----------
    find
        Plans for a multiplier, by number of branches; the second argument asks for a quick search.
    keeps
        Whether a plan keeps to the constraint.
    first_price
        The first multiplier above nothing that is tried.
    """
    met: dict[Plan, None] = {}
    low, high, price = 0.0, math.inf, first_price

    def kept_at(at: float, quick: bool) -> bool:
        plans = [plan for plan in find(at, quick) if plan]
        met.update(dict.fromkeys(plans))
        return not plans or keeps(plans[-1])

    if kept_at(0.0, False):
        return [plan for plan in met if keeps(plan)], [0.0]
    for _ in range(TRIED):
        if should_stop():
            break
        if kept_at(price, True):
            high = price
        else:
            low = price
        if high == math.inf:
            price *= GROWTH
        else:
            price = math.sqrt(low * high) if low > 0.0 else high / GROWTH
    if high < math.inf and not should_stop():
        kept_at(high, False)
    return [plan for plan in met if keeps(plan)], [p for p in (0.0, low, high) if p < math.inf]
