"""The best order of observations as futures tell it: a local search without a grid.

A grid takes an end that is certain for one that scatters over its cells, and routes on mean values see no
lost tracks. Where amounts hardly scatter, a search on either passes over orders that end close to a budget.
Here an order is changed (two observations exchanged, one moved, put in or left out) as long as that wins in
futures that all orders share.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator

from planner.contingency import sampled_futures
from planner.contingency.sampled_futures import SURE
from planner.contingency.seeding import mean_seed, route_plan
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

COMPARED, BEGUN = 6, 2
"""Orders that are compared in many futures, and those of them that the search is begun from. By hand."""

MOST_ORDERED = 12
"""Observations up to which a plan is compared with orders: one more takes a round of some 20 changes longer.
By hand."""

SURELY_MORE = 4.0
"""Standard errors by which an order must earn more than a plan: it was chosen in the same futures."""

Order = tuple[int, ...]


def line_of(plan: Plan) -> list[ObservationId]:
    """Return the observations of the main line of a plan, in their order."""
    return [step.observation for step in plan if isinstance(step, Observe | Visit)]


def surely_better_order(model: Model, plan: Plan, *, seed: int) -> Plan | None:
    """Return an order without branches that earns more than a plan, in futures of `seed`; None without one.

    The search begins from the route on mean values and from the plan's main line.
    """
    if model.m > MOST_ORDERED:
        return None
    begin = mean_seed(model), tuple(model.number_of[name] for name in dict.fromkeys(line_of(plan)))
    plans = [route_plan(model, order) for order in best_orders(model, begin, seed=seed)]
    plans = [one for one in plans if one != plan and model.admits_plan(one)]
    if not plans:
        return None
    before = simulate(model, plan, CLOSE, seed=seed).utility
    gains = {one: simulate(model, one, CLOSE, seed=seed).utility - before for one in plans}
    best, more = max(gains.items(), key=lambda gain: float(gain[1].mean()))
    return best if float(more.mean()) > SURELY_MORE * float(more.std()) / CLOSE**0.5 + 1e-9 else None


def best_orders(
    model: Model, begin: Iterable[Order], *, seed: int, should_stop: Callable[[], bool] = lambda: False
) -> list[Order]:
    """Return the best orders that are found, none twice; those of few observations are all tried.

    The search begins from the best of `begin`, and of all orders where there are few.
    """
    every = range(model.m if model.m <= MOST_ENUMERATED else 0)
    all_orders = (itertools.permutations(every, count) for count in range(1, len(every) + 1))
    tried = dict.fromkeys(itertools.chain(begin, *all_orders))
    found = [order for order in tried if order and model.admits(sum(1 << m for m in order))]
    for futures, kept in ((sampled_futures.SCANNED, COMPARED), (sampled_futures.FITTED, BEGUN)):
        means = {order: float(_earned(model, order, futures, seed).mean()) for order in found}
        found = sorted(means, key=lambda order: -means[order])[:kept]
    orders = [order if should_stop() else order_in_futures(model, order, seed=seed) for order in found]
    return list(dict.fromkeys(orders))


def order_in_futures(model: Model, begin: Order, *, seed: int) -> Order:
    """Return the order that no single change makes better for sure, begun from one of observations by number.

    A change must win by `SURE` standard errors in `CLOSE` futures of `seed`.
    """
    order, earned = begin, _earned(model, begin, CLOSE, seed)
    for _ in range(ROUNDS):
        scanned = {new: float(_earned(model, new, SCANNED, seed).mean()) for new in changed(model, order)}
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
