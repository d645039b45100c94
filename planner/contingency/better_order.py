"""A plan against orders of observations without branches, in futures that all of them share.

A search on a grid values what it finds by the grid: it takes an end that is certain for one that scatters
over its cells, and on a coarse grid passes over an order that ends close to a budget or a window. Of few
observations all orders are carried out in futures, and the best of them are compared with the plan. Lost
tracks scatter what is earned, so that some thousands of futures tell 1 %: the last comparison is in many.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from planner.constraints.overrun import OverrunChance
from planner.contingency.chance import keeps_to
from planner.contingency.order_in_futures import CLOSE, Fits, best_routes, line_of, raced
from planner.contingency.seeding import mean_seed
from planner.evaluate.model import Model
from planner.plan_tree import Plan

MOST_ORDERED = 12
"""Observations up to which a plan is compared with orders: one more takes a round of some 20 changes longer.
By hand."""

CLOSEST = 524_288
"""Futures that decide. By hand: an error of 0.6 of that in the 200,000 of a check, for 0.2 s a plan."""

LAST = 3
"""Plans that are compared in so many."""

MORE = 1.5
"""Standard errors by which an order must earn more than a plan. By hand: what is worth the same stays."""


def better_order(
    model: Model,
    plan: Plan,
    *,
    seed: int,
    fits: Fits,
    chance: OverrunChance | None = None,
    should_stop: Callable[[], bool] = lambda: False,
) -> Plan | None:
    """Return an order without branches that earns more than a plan, in futures of `seed`; None without one.

    Only orders that `fit`, and keep to a chance constraint, are looked at; a plan that does not fit is worth
    less than any. With more than a few observations the search begins from the route on mean values and from
    the plan's main line.
    """
    if model.m > MOST_ORDERED:
        return None
    must = sum(1 << m for m in range(model.m) if model.must_do[m])
    begin = mean_seed(model, must=must), tuple(model.number_of[name] for name in dict.fromkeys(line_of(plan)))
    overrun = 1.0 if chance is None else chance.allowed
    routes = best_routes(model, begin, seed=seed, fits=fits, overrun=overrun, should_stop=should_stop)
    left = raced(model, (plan, *routes) if fits(plan) else routes, ((CLOSE, LAST),), seed=seed)
    if len(left) > 1 and not should_stop():
        left = raced(model, sorted(left, key=lambda one: one != plan), ((CLOSEST, LAST),), seed=seed)
    for one, earned in left.items():
        if one == plan:
            return None
        more = earned - left[plan] if plan in left else np.ones(1)
        if float(more.mean()) <= MORE * float(more.std()) / len(more) ** 0.5:
            return None
        if chance is None or keeps_to(model, one, chance, seed=seed + 1):
            return one
    return None
