"""What every order of a day's observations is worth in drawn futures, carried out one after another.

Written from the definition of a plan that skips what fails, for days of one observation a target, a drive
between any two places and none that fails. It shares no code with the planner but the problem's fields:
futures are numpy's draws, and each is gone through by itself. Orders that begin alike are carried out
together as far as they do.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from planner.problem import START, Amount, Problem

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Order = tuple[int, ...]


class Drawn(NamedTuple):
    """The futures of a day: amounts [places, places, futures] and [observations, futures], tracks that each
    drive loses as bits, and what the day says of observations [observations] and of everything.
    """

    leg_s: Floats
    leg_j: Floats
    lost: Ints
    obs_s: Floats
    obs_j: Floats
    worth: Floats
    opens: Floats
    closes: Floats
    placed: NDArray[np.bool_]
    start_s: float
    start_j: float
    carried_s: float
    hotel_w: float
    most_s: float
    most_j: float
    penalty: float


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
        rng = np.random.default_rng(seed)
        number = {name: k for k, name in enumerate((START, *(t.id for t in problem.targets)))}
        shape = count + 1, count + 1, futures
        leg_s, leg_j, lost = np.zeros(shape), np.zeros(shape), np.zeros(shape, np.int64)
        for leg in problem.legs:
            a, b = number[leg.origin], number[leg.to]
            leg_s[a, b], leg_j[a, b] = (_drawn(rng, x, futures) for x in (leg.time_s, leg.energy_j))
            for target, chance in leg.p_lose.items():
                lost[a, b] |= (rng.random(futures) < chance).astype(np.int64) << number[target]
        what = [t.observations[0] for t in problem.targets]
        windows = np.array([o.window_s or (-math.inf, math.inf) for o in what])
        budget = problem.budget
        self.drawn = Drawn(
            leg_s, leg_j, lost,
            np.array([_drawn(rng, o.time_s, futures) for o in what]),
            np.array([_drawn(rng, o.energy_j, futures) for o in what]),
            np.array([o.utility * o.p_success for o in what]), windows[:, 0].copy(), windows[:, 1].copy(),
            np.array([o.needs_track for o in what]), problem.track_start_time_s, problem.track_start_energy_j,
            problem.track_overhead_s_per_leg, problem.hotel_w, budget.time_s, budget.usable_energy_j,
            problem.overrun_penalty,
        )  # fmt: skip

    def worths(self) -> dict[Order, float]:
        """Return the mean utility of every order that is not empty; observation k is that of target k."""
        placed = np.flatnonzero(self.drawn.placed).tolist()
        others = [m for m in range(len(self.drawn.placed)) if m not in placed]
        found: dict[Order, float] = {}
        for size in range(len(placed) + 1):
            for started in itertools.combinations(placed, size):
                allowed = np.array(sorted((*started, *others)), np.int64)
                bits = sum(1 << m for m in started)
                orders = [
                    order
                    for length in range(1, len(allowed) + 1)
                    for order in itertools.permutations(allowed.tolist(), length)
                    if not bits & ~sum(1 << m for m in order)
                ]
                for order, mean in zip(sorted(orders), _every(self.drawn, allowed, bits), strict=True):
                    found[order] = float(mean)
        return found


@njit(cache=True)
def _every(day: Drawn, allowed: Ints, started: int) -> Floats:
    """Return the mean utility of the orders of `allowed` [n] that hold all that is `started` (bits), in the
    order of the alphabet.
    """
    most, futures = allowed.shape[0], day.obs_s.shape[1]
    begun = 0
    for m in range(day.placed.shape[0]):
        begun += (started >> m) & 1
    time_s, energy_j = np.empty((most + 1, futures)), np.empty((most + 1, futures))
    earned, over = np.zeros((most + 1, futures)), np.zeros((most + 1, futures), np.bool_)
    place, tracked = np.zeros((most + 1, futures), np.int64), np.zeros((most + 1, futures), np.int64)
    time_s[0], energy_j[0], tracked[0] = begun * day.start_s, begun * day.start_j, started << 1
    for f in range(futures):
        over[0, f] = _over(day, time_s[0, f], energy_j[0, f])
    means, count = np.empty(1024), 0
    chosen, done, depth = np.full(most + 1, -1), 0, 0
    while depth >= 0:
        if chosen[depth] >= 0:  # back from all that begins with it
            done &= ~(1 << allowed[chosen[depth]])
        chosen[depth] += 1
        while chosen[depth] < most and (done >> allowed[chosen[depth]]) & 1:
            chosen[depth] += 1
        if chosen[depth] >= most:
            chosen[depth] = -1
            depth -= 1
            continue
        m = allowed[chosen[depth]]
        done |= 1 << m
        depth += 1
        total = 0.0
        for f in range(futures):
            t, g, won, gone = (
                time_s[depth - 1, f],
                energy_j[depth - 1, f],
                earned[depth - 1, f],
                over[depth - 1, f],
            )
            here, tracks = place[depth - 1, f], tracked[depth - 1, f]
            if not gone and (not day.placed[m] or (tracks >> (m + 1)) & 1):
                carried = 0
                for p in range(1, day.placed.shape[0] + 1):
                    carried += (tracks >> p) & 1
                t += day.leg_s[here, m + 1, f] + day.carried_s * carried
                g += day.leg_j[here, m + 1, f]
                tracks &= ~day.lost[here, m + 1, f]
                here = m + 1
                gone = _over(day, t, g)
                if not gone and t <= day.closes[m] and (not day.placed[m] or (tracks >> (m + 1)) & 1):
                    t = max(t, day.opens[m]) + day.obs_s[m, f]
                    g += day.obs_j[m, f]
                    gone = _over(day, t, g)
                    won += 0.0 if gone else day.worth[m]
                    tracks &= ~(1 << (m + 1))
            time_s[depth, f], energy_j[depth, f], earned[depth, f], over[depth, f] = t, g, won, gone
            place[depth, f], tracked[depth, f] = here, tracks
            total += won - day.penalty * gone
        if not started & ~done:
            if count == means.shape[0]:
                means = np.concatenate((means, np.empty_like(means)))
            means[count] = total / futures
            count += 1
    return means[:count]


@njit(cache=True)
def _over(day: Drawn, time_s: float, energy_j: float) -> bool:
    return time_s > day.most_s or energy_j + day.hotel_w * time_s > day.most_j


def _drawn(rng: np.random.Generator, amount: Amount, futures: int) -> Floats:
    """Return draws of a log-normal amount of this mean and deviation."""
    if amount.mean <= 0.0:
        return np.zeros(futures)
    variance = math.log1p((amount.sd / amount.mean) ** 2)
    return rng.lognormal(math.log(amount.mean) - variance / 2.0, math.sqrt(variance), futures)
