"""The best order of observations as futures tell it: a local search without a grid.

A grid takes an end that is certain for one that scatters over its cells, and routes on mean values see no
lost tracks. Where amounts hardly scatter, a search on either passes over orders that end close to a budget.
Here an order is changed (two observations exchanged, one moved, put in or left out) as long as that wins in
futures that all orders share.
"""

from __future__ import annotations

from collections.abc import Iterator

from planner.contingency.sampled_futures import SURE
from planner.contingency.seeding import route_plan
from planner.evaluate.model import Floats, Model
from planner.evaluate.monte_carlo import simulate

SCANNED, CLOSE = 4_096, 65_536
"""Futures in which all changes are tried, and in which the likeliest are compared. By hand: the latter tell
1 % where tracks are often lost.
"""

ROUNDS = 8
"""Changes of one order after each other. By hand: two or three are usual."""

TRIED = 3
"""Changes that are looked at closely in a round."""

Order = tuple[int, ...]


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
    for new in _changes(model, order):
        if new not in seen and model.admits(sum(1 << m for m in new)):
            seen.add(new)
            yield new


def _changes(model: Model, order: Order) -> Iterator[Order]:
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
