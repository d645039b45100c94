"""The best order of observations as futures tell it: a local search without a grid.

A grid takes an end that is certain for one that scatters over its cells, and routes on mean values see no
lost tracks. Where amounts hardly scatter, a search on either passes over orders that end close to a budget.
Here an order is changed (two observations exchanged, one moved, put in or left out) as long as that wins in
futures that all orders share.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from planner.contingency.sampled import futures as sampled_futures
from planner.contingency.sampled.futures import SURE
from planner.contingency.seeding import route_plan, routes_of
from planner.evaluate.model import Floats, Model
from planner.evaluate.monte_carlo import simulate
from planner.plan_tree import Observe, Plan, Visit
from planner.problem import ObservationId

SCANNED, CLOSE = 4_096, 65_536
"""Futures in which all changes are tried, and in which the likeliest are compared. By hand: the latter tell
1 % where tracks are often lost.
"""

ROUNDS = 8
"""Changes of one order after each other. By hand: two or three are usual."""

TRIED = 3
"""Changes that are looked at closely in a round."""

MOST_ENUMERATED = 5
"""Observations up to which every order is tried: 325 orders take a third of a second. By hand."""

COMPARED, LIKELY, BEGUN = 24, 6, 2
"""Plans that are compared in many futures, those left after that, and orders that the search is begun from.
By hand: of 325 orders some 20 are within the error of the best in the fewest futures.
"""

MATTERS = 5e-4
"""Share of its value by which a plan must be better. By hand: the error of the evaluator."""

Order = tuple[int, ...]

Fits = Callable[[Plan], bool]
"""Whether a plan may be an answer: it does what must be done, say."""


def line_of(plan: Plan) -> list[ObservationId]:
    """Return the observations of the main line of a plan, in their order."""
    return [step.observation for step in plan if isinstance(step, Observe | Visit)]


def best_routes(
    model: Model,
    begin: Iterable[Order],
    *,
    seed: int,
    fits: Fits = lambda _: True,
    overrun: float = 1.0,
    should_stop: Callable[[], bool] = lambda: False,
) -> list[Plan]:
    """Return the best plans without branches that are found, best first; orders of few observations are all
    tried.

    The search begins from the best of `begin`, and of all orders where there are few. Plans that do not
    `fit`, and those that overrun a budget more often than `overrun`, are left out.
    """
    few = model.m <= MOST_ENUMERATED
    every = range(model.m if few else 0)
    all_orders = (itertools.permutations(every, count) for count in range(1, len(every) + 1))
    orders: Iterable[Order] = dict.fromkeys(itertools.chain(begin, *all_orders))
    if not few:
        orders = _begun(model, orders, seed, fits, should_stop)
    admitted = [order for order in orders if order and model.admits(sum(1 << m for m in order))]
    plans = dict.fromkeys(plan for order in admitted for plan in routes_of(model, order) if fits(plan))
    stages = (sampled_futures.SCANNED, COMPARED), (sampled_futures.FITTED, LIKELY)
    return [*raced(model, plans, stages, seed=seed, overrun=overrun)]


def _begun(
    model: Model, begin: Iterable[Order], seed: int, fits: Fits, should_stop: Callable[[], bool]
) -> dict[Order, None]:
    """Return the orders that a search finds from the best of some others that fit, and those."""
    tried = [order for order in begin if order and model.admits(sum(1 << m for m in order))]
    tried = [order for order in tried if fits(route_plan(model, order))]
    means = {order: float(_earned(model, order, sampled_futures.FITTED, seed).mean()) for order in tried}
    best = sorted(means, key=lambda order: -means[order])[:BEGUN]
    found = [
        order if should_stop() else order_in_futures(model, order, seed=seed, fits=fits) for order in best
    ]
    return dict.fromkeys((*found, *best))


def raced(
    model: Model, plans: Iterable[Plan], stages: Iterable[tuple[int, int]], *, seed: int, overrun: float = 1.0
) -> dict[Plan, Floats]:
    """Return the plans that may be the best of some, best first, with what they earn [futures].

    Each stage is a number of futures of `seed`, and how many plans are left at most. A plan is given up that
    surely is not better than the best one by as much as matters, that earns the same in every future, or
    that surely overruns a budget more often than allowed.
    """
    left = dict.fromkeys(plans, np.zeros(0))
    for futures, most in stages:
        most_overrun = overrun + SURE * (overrun * (1.0 - overrun) / futures) ** 0.5
        met = {plan: simulate(model, plan, futures, seed=seed) for plan in left}
        earned = {plan: one.utility for plan, one in met.items() if np.mean(one.overrun) <= most_overrun}
        ranked = sorted(earned, key=lambda plan: -float(earned[plan].mean()))
        left = {}
        for plan in ranked:
            if len(left) < most and _may_win(earned[plan], list(left.values())):
                left[plan] = earned[plan]
        if len(left) < 2:
            break
    return left


def _may_win(earned: Floats, others: list[Floats]) -> bool:
    """Return whether a plan may be better than the first of others by as much as matters."""
    if not others:
        return True
    behind = others[0] - earned
    ahead = SURE * float(behind.std()) / len(behind) ** 0.5 - float(behind.mean())
    matters = MATTERS * abs(float(others[0].mean()))
    return ahead > matters and not any(np.array_equal(earned, other) for other in others)


def order_in_futures(model: Model, begin: Order, *, seed: int, fits: Fits = lambda _: True) -> Order:
    """Return the order that no single change makes better for sure, begun from one of observations by number.

    Orders whose plans do not `fit` are passed over. A change must win by `SURE` standard errors in `CLOSE`
    futures of `seed`.
    """
    order, earned = begin, _earned(model, begin, CLOSE, seed)
    for _ in range(ROUNDS):
        near = [new for new in changed(model, order) if fits(route_plan(model, new))]
        scanned = {new: float(_earned(model, new, SCANNED, seed).mean()) for new in near}
        likely = sorted(scanned, key=lambda new: (-scanned[new], new))
        best, gain, kept = order, 0.0, earned
        for new in likely[:TRIED]:
            there = _earned(model, new, CLOSE, seed)
            more = there - earned
            won, error = float(more.mean()), float(more.std()) / len(more) ** 0.5
            if won > max(gain, SURE * error + 1e-9):
                best, gain, kept = new, won, there
        if best == order:
            return order
        order, earned = best, kept
    return order


def _earned(model: Model, order: Order, futures: int, seed: int) -> Floats:
    return simulate(model, route_plan(model, order), futures, seed=seed, threads=1).utility


def changed(model: Model, order: Order) -> Iterator[Order]:
    """Yield each order that one change leads to, once."""
    seen = {order}
    for new in every_change(model, order):
        if new not in seen and model.admits(sum(1 << m for m in new)):
            seen.add(new)
            yield new


def every_change(model: Model, order: Order) -> Iterator[Order]:
    """Yield each order that one change leads to, some twice, whether it is admitted or not."""
    size = len(order)
    for i in range(size):
        left = (*order[:i], *order[i + 1 :])
        yield left
        for k in range(size):
            yield (*left[:k], order[i], *left[k:])
        for k in range(i + 1, size):
            yield (*order[:i], order[k], *order[i + 1 : k], order[i], *order[k + 1 :])
    for m in range(model.m):
        if m not in order and model.utility[m] > 0.0:
            for k in range(size + 1):
                yield (*order[:k], m, *order[k:])
