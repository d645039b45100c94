"""Upper bounds where no table of all live sets fits: multipliers, and at each place a memory of its own."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from planner.contingency.by_place.layout import Memory, Size, Wanted
from planner.contingency.by_place.relaxation import NgRelaxation
from planner.contingency.priced_relaxation import Weights
from planner.evaluate.model import Floats, Model
from planner.tally import now_s

COARSE = 128
"""Nodes on which multipliers are found."""

STAGES = ((0, 3, 0.2), (0, 8, 0.2), (3, 24, 0.03), (4, 16, 0.015), (5, 12, 0.01))
"""Observations remembered at a place besides its own, subgradient steps with them, and the share of the bound
by which the first of these aim below it. The first stage is for energy and for time, what follows for the
closer of the two. By hand, on 15 and 30 targets of seed 5."""

LAST = (
    *((6, 512), (5, 512), (6, 384), (5, 384), (4, 512), (4, 384), (5, 256), (4, 256)),
    *((3, 384), (3, 256), (3, 192), (2, 192), (1, 192), (0, 192)),
)
"""The same, and the nodes of the bound itself, from the closest on. By hand."""

MOST_COUNTED = 10
"""Tracks counted: each adds as many states as there are without. By hand."""

LARGEST_MB = 900.0
"""Largest relaxation, MB. By hand, as `bounds.TABLE_MB`."""

PRICED_SHARE = 0.55
"""Share of the limit for multipliers. By hand."""

PATIENCE, SHORTER, SHORTEST = 3, 0.6, 2e-4
"""Steps without a gain after which they aim less far, by what, and the least share. By hand."""

DEFLECTED = 0.4
"""Share of the step before in the next (Camerini, Fratta and Maffioli 1975). By hand."""

MARGIN = 2e-5
"""Relative allowance for single precision, of all that is summed."""


@dataclass(frozen=True, eq=False)
class Priced:
    """A resource with its best multipliers [wanted], and the bound there."""

    weights: Weights
    prices: Floats
    value: float


def ng_bound(model: Model, *, limit_s: float) -> float:
    """Return what no policy earns more than; infinite where the limit allows no relaxation.

    `limit_s` are seconds of a processor as `planner.tally` reckons them.
    """
    begun = now_s()
    until = begun + limit_s
    priced_until = begun + PRICED_SHARE * limit_s
    wanted = Wanted.of(model)
    count = len(wanted.number)
    if not count or not model.has_leg[:, 1:].any():
        return math.inf
    found: list[Priced] = []
    for share in (0.0, 1.0):
        none = Priced(Weights.of(model, share), np.zeros(count), math.inf)
        found.append(_better(model, none, *STAGES[0], priced_until))
    best = min(found, key=lambda one: one.value)
    if best.value == math.inf:
        return math.inf
    for stage in STAGES[1:]:
        best = _better(model, best, *stage, priced_until)
    value = best.value
    for more, nodes in LAST:
        memory = remembered(model, best.weights, more)
        size = Size.of(model, memory, MOST_COUNTED, nodes)
        if size.seconds <= until - now_s() and size.table_mb <= LARGEST_MB:
            value = min(
                value, NgRelaxation(model, best.weights, nodes, memory, MOST_COUNTED).bound(best.prices)
            )
            break
    summed = abs(value) + model.penalty + float(best.prices @ wanted.chance)
    return value + MARGIN * summed + 1e-9


def remembered(model: Model, weights: Weights, more: int) -> Memory:
    """Return what each place remembers: its own, and of others what a drive there and back would win most on.

    A win is what an observation is worth, for the resource that it takes in the mean. Its multiplier is not
    taken off: it is high where the observation was made again and again, which is what a memory is to end.
    """
    wanted = Wanted.of(model)
    leg = weights.per_s * model.leg[:, :, 0] + weights.per_j * model.leg[:, :, 2]
    own = weights.per_s * model.obs[wanted.number, 0] + weights.per_j * model.obs[wanted.number, 2]
    memory: Memory = []
    for p in range(model.n + 1):
        loop = leg[p, wanted.place] + leg[wanted.place, p] + own
        rate = np.where(np.isnan(loop), 0.0, wanted.worth / np.maximum(loop, 1e-12))
        dear = [int(k) for k in np.argsort(-rate, kind="stable") if rate[k] > 0.0][: more if p else 0]
        memory.append((*np.nonzero(wanted.place == p)[0].tolist(), *dear))
    return memory


def _better(model: Model, found: Priced, more: int, steps: int, share: float, until: float) -> Priced:
    """Return the best multipliers found from those given, with a memory of so many others at each place."""
    memory = remembered(model, found.weights, more)
    size = Size.of(model, memory, MOST_COUNTED, COARSE)
    if now_s() + steps / 2 * size.seconds > until or size.table_mb > LARGEST_MB:
        return found
    relaxation = NgRelaxation(model, found.weights, COARSE, memory, MOST_COUNTED)
    prices, idle = found.prices, 0
    best, best_prices, best_slope = math.inf, prices, np.zeros(len(prices))
    move = np.zeros(len(prices))
    for _ in range(steps):
        value = relaxation.bound(prices)
        slope = relaxation.slope()
        if value < best:
            idle = 0 if value < best * (1.0 - 1e-4) else idle + 1
            best, best_prices, best_slope = value, prices, slope
        else:
            idle += 1
        if idle >= PATIENCE:
            share, idle, prices, slope, move = share * SHORTER, 0, best_prices, best_slope, 0.0 * move
        move = slope + DEFLECTED * move
        move = np.where((prices <= 0.0) & (move > 0.0), 0.0, move)
        length = float(move @ move)
        if length < 1e-10 or share < SHORTEST or now_s() > until:
            break
        prices = np.maximum(0.0, prices - share * best / length * move)
    return Priced(found.weights, best_prices, min(best, found.value))
