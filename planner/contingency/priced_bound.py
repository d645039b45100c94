"""Upper bounds where no table of all live sets fits: multipliers, and a small memory for what keeps a large
one.

On a coarse grid of one resource (`Relaxation`) multipliers are found by subgradient steps (Polyak 1969), and
what keeps a large one is remembered, one or two observations at a time: mostly a handful decides the day. The
bound is then that of the finest grid the limit allows, at these multipliers. Energy and time are tried, and
the better is kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from planner.contingency.priced_relaxation import MOST_HERE, Relaxation, Weights, reckoned_mb
from planner.evaluate.model import Floats, Model
from planner.tally import now_s

COARSE, FINER = 128, (2048, 1024, 512, 256)
"""Nodes on which multipliers and memory are found, and those of the bound."""

LARGEST_MB = 800.0
"""Largest relaxation, MB, with the masses of its drives. By hand, as `bounds.TABLE_MB`."""

MOST_REMEMBERED = 9
"""Observations remembered: each doubles the sets. By hand."""

MOST_COUNTED = 6
"""Tracks counted without their targets: each adds as many sets as there are without. By hand."""

PRICE_STEPS, MORE_STEPS = 120, 30
"""Subgradient steps without memory, and with it. By hand: with memory they begin near the best."""

PATIENCE, SHORTER, SHORTEST = 6, 0.6, 1e-3
"""Steps without a gain after which they are shortened, by what, and the shortest. By hand."""

AIM = 0.7
"""Share of the bound at which the steps aim, as no plan's value is known here. By hand."""

LEAST_STEPS = 4
"""Subgradient steps that must be affordable for a larger memory. By hand."""

DEAR = 1e-3
"""Multiplier from which an observation is worth remembering."""

PRICED_SHARE = 0.5
"""Share of the limit for the first part. By hand."""

MARGIN = 2e-5
"""Relative allowance for single precision, of all that is summed."""


@dataclass(frozen=True, eq=False)
class Priced:
    """A relaxation with its best multipliers, by observation, and the bound there."""

    relaxation: Relaxation
    prices: Floats  # (m,)
    value: float

    @property
    def own(self) -> Floats:
        """The multipliers of the wanted observations."""
        return np.where(self.relaxation.priced, self.prices[self.relaxation.wanted], 0.0)


def priced_bound(model: Model, *, limit_s: float) -> float:
    """Return what no policy earns more than; infinite where the relaxation does not apply.

    `limit_s` are seconds of a processor as `planner.tally` reckons them.
    """
    model.require_one_kind("a bound by multipliers")
    until = now_s() + limit_s
    wanted = (model.utility > 0.0) & (model.chances.most > 0.0)
    here = np.bincount(model.obs_place[wanted], minlength=1)
    if not wanted.any() or not model.has_leg[:, 1:].any() or int(here.max()) > MOST_HERE:
        return math.inf
    if reckoned_mb(model, COARSE, ()) > LARGEST_MB:
        return math.inf
    first = [_best_prices(_of(model, share, ()), np.zeros(model.m), until) for share in (0.0, 1.0)]
    if min(found.value for found in first) == math.inf:
        return math.inf
    best = min((_counting(model, found, until) for found in first), key=lambda found: found.value)
    best = _remembering(model, best, now_s() + PRICED_SHARE * (until - now_s()))
    found, relaxation = best.value, best.relaxation
    for nodes in FINER:
        times = nodes / COARSE
        size_mb = reckoned_mb(model, nodes, relaxation.memory, relaxation.most)
        if relaxation.seconds * times**2 <= until - now_s() and size_mb <= LARGEST_MB:
            finer = Relaxation(model, relaxation.weights, nodes, relaxation.memory, relaxation.most)
            found = min(found, finer.bound(best.own))
            break
    summed = abs(found) + model.penalty + relaxation.owed(best.own)
    return found + MARGIN * summed + 1e-9


def _of(model: Model, time_share: float, memory: tuple[int, ...]) -> Relaxation:
    return Relaxation(model, Weights.of(model, time_share), COARSE, memory)


def _counting(model: Model, found: Priced, until: float) -> Priced:
    """Return what comes of counting tracks, where the limit allows it and it is closer."""
    seconds = found.relaxation.seconds * (MOST_COUNTED + 1)
    too_large = reckoned_mb(model, COARSE, (), MOST_COUNTED) > LARGEST_MB
    if too_large or now_s() + MORE_STEPS * seconds > until or found.value == math.inf:
        return found
    larger = Relaxation(model, found.relaxation.weights, COARSE, (), MOST_COUNTED)
    if not larger.most:
        return found
    return min(found, _best_prices(larger, found.prices, until), key=lambda one: one.value)


def _best_prices(relaxation: Relaxation, begin: Floats, until: float) -> Priced:
    """Return the best multipliers found from those given."""
    prices = np.where(relaxation.priced, begin[relaxation.wanted], 0.0)
    best, best_prices, share, idle = math.inf, prices, 1.0, 0
    made = np.zeros(len(prices))
    for _ in range(MORE_STEPS if relaxation.memory or relaxation.most else PRICE_STEPS):
        value = relaxation.bound(prices)
        if value < best:
            idle = 0 if value < best * (1.0 - 1e-4) else idle + 1
            best, best_prices, made = value, prices, relaxation.made()
        else:
            idle += 1
        slope = np.where(relaxation.priced, relaxation.chance - made, 0.0)
        if idle and value > best:
            slope = np.where(relaxation.priced, relaxation.chance - relaxation.made(), 0.0)
        if idle >= PATIENCE:
            share, idle, prices = share * SHORTER, 0, best_prices
            slope = np.where(relaxation.priced, relaxation.chance - made, 0.0)
            value = best
        slope = np.where((prices <= 0.0) & (slope > 0.0), 0.0, slope)
        length = float(slope @ slope)
        if length < 1e-10 or share < SHORTEST or value == math.inf or now_s() > until:
            break
        prices = np.maximum(0.0, prices - share * (1.0 - AIM) * value / length * slope)
    by_observation = begin.copy()
    by_observation[relaxation.wanted] = np.where(relaxation.priced, best_prices, 0.0)
    return Priced(relaxation, by_observation, best)


def _remembering(model: Model, found: Priced, until: float) -> Priced:
    """Return what comes of remembering what is dear, until nothing is or the limit is used up."""
    alone = np.array(
        [not model.is_place[m] or int(model.place_bits[model.obs_place[m]]).bit_count() == 1
         for m in range(model.m)]
    )  # fmt: skip
    best = found
    while True:
        relaxation = found.relaxation
        dear = np.where(alone & (found.prices > DEAR), found.prices, 0.0)
        room = MOST_REMEMBERED - len(relaxation.memory)
        count = min(room, 2 if len(relaxation.memory) < 4 else 1)
        new = [int(m) for m in np.argsort(-dear, kind="stable")[: max(0, count)] if dear[m] > 0.0]
        if not new or now_s() + LEAST_STEPS * relaxation.seconds * (1 << len(new)) > until:
            return best
        memory = (*relaxation.memory, *new)
        if reckoned_mb(model, COARSE, memory, relaxation.most) > LARGEST_MB:
            return best
        larger = Relaxation(model, relaxation.weights, COARSE, memory, relaxation.most)
        found = _best_prices(larger, found.prices, until)
        best = min(best, found, key=lambda one: one.value)
