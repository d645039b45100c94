"""What every order of a day's observations is worth in drawn futures, by plain numpy.

Written from the definition of a plan that skips what fails, for days of one observation a target, a drive
between any two places and none that fails. It shares no code with the planner but the problem's fields.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner.problem import START, Amount, Problem

Floats = NDArray[np.float64]
Order = tuple[int, ...]

FROM = 2
"""Observations after which all orders that begin alike are carried out together."""


@dataclass(frozen=True, slots=True)
class Standing:
    """Where orders that begin alike stand in each future: arrays [orders, futures]."""

    orders: list[Order]
    time_s: Floats
    energy_j: Floats
    earned: Floats
    place: NDArray[np.int8]
    tracked: NDArray[np.int16]
    over: NDArray[np.bool_]


class AllOrders:
    """The futures of a day, drawn by numpy's own generator."""

    def __init__(self, problem: Problem, futures: int, *, seed: int) -> None:
        """Raise if the day is not of the kind that this counts.

        Raises
        ------
        ValueError
            If a target has several observations, or a drive is missing or may fail.
        """
        count = len(problem.targets)
        if any(len(t.observations) != 1 for t in problem.targets) or any(leg.p_fail for leg in problem.legs):
            raise ValueError("all orders are counted of days of one observation a target and sure drives")
        if len(problem.legs) < count * count or problem.sol_kinds or problem.precedence:
            raise ValueError("all orders are counted of days with every drive and nothing else")
        self.problem, self.count = problem, count
        rng = np.random.default_rng(seed)
        number = {START: 0, **{t.id: k + 1 for k, t in enumerate(problem.targets)}}
        shape = count + 1, count + 1, futures
        self.leg_s, self.leg_j, self.lost = np.zeros(shape), np.zeros(shape), np.zeros(shape, np.int16)
        for leg in problem.legs:
            a, b = number[leg.origin], number[leg.to]
            self.leg_s[a, b], self.leg_j[a, b] = (_drawn(rng, x, futures) for x in (leg.time_s, leg.energy_j))
            for target, chance in leg.p_lose.items():
                self.lost[a, b] |= (rng.random(futures) < chance).astype(np.int16) << number[target]
        self.what = [t.observations[0] for t in problem.targets]
        self.obs_s = np.array([_drawn(rng, o.time_s, futures) for o in self.what])
        self.obs_j = np.array([_drawn(rng, o.energy_j, futures) for o in self.what])
        self.placed = [o.needs_track for o in self.what]
        self.futures = futures

    def worths(self) -> dict[Order, float]:
        """Return the mean utility of every order that is not empty; observation k is that of target k."""
        placed = [m for m in range(self.count) if self.placed[m]]
        others = [m for m in range(self.count) if not self.placed[m]]
        found: dict[Order, float] = {}
        for size in range(len(placed) + 1):
            for started in itertools.combinations(placed, size):
                for standing in self._carried_out(self._begun(started), sorted((*started, *others))):
                    worth = standing.earned - self.problem.overrun_penalty * standing.over
                    for order, mean in zip(standing.orders, worth.mean(axis=1), strict=True):
                        if order and set(started) <= set(order):
                            found[order] = float(mean)
        return found

    def _begun(self, started: tuple[int, ...]) -> Standing:
        one = (1, self.futures)
        time_s = np.full(one, len(started) * self.problem.track_start_time_s)
        energy_j = np.full(one, len(started) * self.problem.track_start_energy_j)
        tracked = np.full(one, sum(1 << m + 1 for m in started), np.int16)
        over = self._over(time_s, energy_j)
        return Standing([()], time_s, energy_j, np.zeros(one), np.zeros(one, np.int8), tracked, over)

    def _carried_out(self, here: Standing, allowed: list[int]) -> Iterator[Standing]:
        """Yield the standing of every order of allowed observations that begins with those of `here`."""
        yield here
        longer = [self._followed(here, m) for m in allowed]
        longer = [one for one in longer if one.orders]
        if not longer:
            return
        if len(longer[0].orders[0]) <= FROM:
            for one in longer:
                yield from self._carried_out(one, allowed)
            return
        merged = Standing(
            [order for one in longer for order in one.orders],
            *(
                np.concatenate([getattr(one, name) for one in longer])
                for name in ("time_s", "energy_j", "earned", "place", "tracked", "over")
            ),
        )
        yield from self._carried_out(merged, allowed)

    def _followed(self, here: Standing, m: int) -> Standing:
        """Return the orders that do not hold observation m yet, with it next."""
        which = [k for k, order in enumerate(here.orders) if m not in order]
        to, what, futures = m + 1, self.what[m], np.arange(self.futures)[None, :]
        time_s, energy_j, earned = here.time_s[which], here.energy_j[which], here.earned[which]
        place, tracked, over = here.place[which], here.tracked[which], here.over[which]
        goes = ~over
        if self.placed[m]:
            goes &= (tracked >> to & 1).astype(bool)
        carried = np.bitwise_count(tracked) * self.problem.track_overhead_s_per_leg
        time_s = time_s + goes * (self.leg_s[place, to, futures] + carried)
        energy_j = energy_j + goes * self.leg_j[place, to, futures]
        over = over | self._over(time_s, energy_j)
        tracked = np.where(goes, tracked & ~self.lost[place, to, futures], tracked)
        place = np.where(goes, to, place).astype(np.int8)
        opens, closes = what.window_s or (-math.inf, math.inf)
        makes = goes & ~over & (time_s <= closes)
        if self.placed[m]:
            makes &= (tracked >> to & 1).astype(bool)
        time_s = np.where(makes, np.maximum(time_s, opens) + self.obs_s[m], time_s)
        energy_j = energy_j + makes * self.obs_j[m]
        over = over | self._over(time_s, energy_j)
        earned = earned + (makes & ~over) * (what.utility * what.p_success)
        tracked = np.where(makes, tracked & ~(1 << to), tracked).astype(np.int16)
        orders = [(*here.orders[k], m) for k in which]
        return Standing(orders, time_s, energy_j, earned, place, tracked, over)

    def _over(self, time_s: Floats, energy_j: Floats) -> NDArray[np.bool_]:
        budget = self.problem.budget
        used_j = energy_j + self.problem.hotel_w * time_s
        return (time_s > budget.time_s) | (used_j > budget.usable_energy_j)


def _drawn(rng: np.random.Generator, amount: Amount, futures: int) -> Floats:
    """Return draws of a log-normal amount of this mean and deviation."""
    if amount.mean <= 0.0:
        return np.zeros(futures)
    variance = math.log1p((amount.sd / amount.mean) ** 2)
    return rng.lognormal(math.log(amount.mean) - variance / 2.0, math.sqrt(variance), futures)
