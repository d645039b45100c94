"""Compiled loops of sol paths: an order carried out in drawn futures, the search for orders, a policy's days.

An order is an array of observations. Carried out by rule, the rover goes for the next observation of it while
mean and `caution` standard deviations of what that takes are within the sol's time and charge, else it ends
the sol, and leaves out what no later sol fits either.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numba
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Loop = TypeVar("Loop", bound=Callable[..., Any])


def _compiled(loop: Loop) -> Loop:
    return numba.njit(cache=True, nogil=True)(loop)


class Days(NamedTuple):
    """K sols: time, reserve, what the rest adds, the most it leaves, windows (K, m, 2), what is allowed."""

    time_s: Array
    reserve_j: Array
    gain_j: Array
    ceiling_j: Array
    window: Array
    allowed: Array
    charge_j: float
    hotel_w: float
    penalty: float


class Needs(NamedTuple):
    """What a drive (P, P) and an observation (m) take: mean and variance of time and of whole energy, and S
    drawn futures of time and of energy beside the hotel load.
    """

    place: Array
    worth: Array
    has_leg: Array
    leg: Array  # (P, P, 4)
    obs: Array  # (m, 4)
    leg_t: Array  # (S, P, P)
    leg_g: Array
    obs_t: Array  # (S, m)
    obs_g: Array


@_compiled
def _fits(days: Days, needs: Needs, caution: float, sol: int, t: float, b: float, place: int, m: int) -> bool:
    if not days.allowed[sol, m]:
        return False
    to = needs.place[m]
    mean_t, var_t, mean_e, var_e = 0.0, 0.0, 0.0, 0.0
    if to != place:
        if not needs.has_leg[place, to]:
            return False
        leg = needs.leg[place, to]
        mean_t, var_t, mean_e, var_e = leg[0], leg[1], leg[2], leg[3]
    if t + mean_t > days.window[sol, m, 1]:
        return False
    waits = max(days.window[sol, m, 0] - t - mean_t, 0.0)
    mean_t += needs.obs[m, 0] + waits
    mean_e += needs.obs[m, 2] + days.hotel_w * waits
    if t + mean_t + caution * np.sqrt(var_t + needs.obs[m, 1]) > days.time_s[sol]:
        return False
    return bool(b - mean_e - caution * np.sqrt(var_e + needs.obs[m, 3]) >= days.reserve_j[sol])


@_compiled
def value_by_rule(days: Days, needs: Needs, order: Array, length: int, caution: float) -> float:
    """Return what an order earns by the rule in the mean of the drawn futures, in utility.

    The first `length` entries of `order` [m] are the observations, by number, one after another.
    """
    futures, sols = needs.leg_t.shape[0], len(days.time_s)
    total = 0.0
    for s in range(futures):
        k, t, b, place = 0, 0.0, days.charge_j, 0
        for index in range(length):
            m = order[index]
            for _ in range(2):
                # the first sol, from this one on, on which the observation fits
                at, t1, b1 = k, t, b
                while not _fits(days, needs, caution, at, t1, b1, place, m):
                    if at + 1 == sols:
                        at = sols
                        break
                    b1 = min(days.ceiling_j[at], b1 + days.gain_j[at])
                    t1 = 0.0
                    at += 1
                if at == sols:
                    break
                k, t, b = at, t1, b1
                to = needs.place[m]
                over = False
                if to != place:
                    t2 = needs.leg_t[s, place, to]
                    used = needs.leg_g[s, place, to] + days.hotel_w * t2
                    over = t + t2 > days.time_s[k] or b - used < days.reserve_j[k]
                    t += t2
                    b = max(b - used, days.reserve_j[k])
                    if not over:
                        place = to
                if not over:
                    if t > days.window[k, m, 1]:
                        break
                    waits = max(days.window[k, m, 0] - t, 0.0)
                    t2 = needs.obs_t[s, m] + waits
                    used = needs.obs_g[s, m] + days.hotel_w * t2
                    over = t + t2 > days.time_s[k] or b - used < days.reserve_j[k]
                    t += t2
                    b = max(b - used, days.reserve_j[k])
                if not over:
                    total += needs.worth[m]
                    break
                total -= days.penalty
                t = days.time_s[k] + 1.0  # the sol is over
                if k + 1 == sols:
                    break
                b = min(days.ceiling_j[k], b + days.gain_j[k])
                t = 0.0
                k += 1
            if t > days.time_s[k]:
                break
    return total / futures


@_compiled
def changed_order(order: Array, length: int, new: Array) -> int:
    """Write a changed order (m,) into `new` (m,); return its length. What stands behind it is left out."""
    n = len(order)
    new[:] = order
    kind = np.random.randint(0, 6)
    if kind == 0 and length < n:  # put one in
        source, to = np.random.randint(length, n), np.random.randint(0, length + 1)
        _moved(new, source, to)
        return length + 1
    if kind == 1 and length > 0:  # leave one out
        _moved(new, np.random.randint(0, length), length - 1)
        return length - 1
    if kind == 2 and 0 < length < n:  # one for another
        a, b = np.random.randint(0, length), np.random.randint(length, n)
        new[a], new[b] = new[b], new[a]
        return length
    if length < 2:
        return length
    a, b = np.random.randint(0, length), np.random.randint(0, length)
    if kind == 3:
        low, high = min(a, b), max(a, b)
        while low < high:
            new[low], new[high] = new[high], new[low]
            low += 1
            high -= 1
    elif kind == 4:
        _moved(new, a, b)
    else:  # a string of up to three
        for _ in range(np.random.randint(1, 4)):
            _moved(new, a, b)
            if a > b:
                a, b = min(a + 1, length - 1), min(b + 1, length - 1)
    return length


@_compiled
def _moved(order: Array, source: int, to: int) -> None:
    held = order[source]
    step = 1 if to > source else -1
    for k in range(source, to, step):
        order[k] = order[k + step]
    order[to] = held


@_compiled
def mean_starts(days: Days, needs: Needs, order: Array, length: int, margin: int) -> tuple[Array, Array]:
    """Return between which places of an order each sol begins and ends where all takes its mean, (K,) both,
    with so many more on both sides; the first sol begins with the order. Of `order` (m,), observations by
    number, the first `length` count.
    """
    sols = len(days.time_s)
    low, high = np.full(sols, length, np.int64), np.full(sols, length, np.int64)
    low[0] = 0
    k, t, b, place = 0, 0.0, days.charge_j, 0
    for index in range(length):
        m = order[index]
        at, t1, b1 = k, t, b
        while at < sols and not _fits(days, needs, 0.0, at, t1, b1, place, m):
            b1 = min(days.ceiling_j[at], b1 + days.gain_j[at])
            t1 = 0.0
            at += 1
        if at == sols:
            continue
        for sol in range(k, at):
            high[sol], low[sol + 1] = index, index
        k, t, b = at, t1, b1
        to = needs.place[m]
        if to != place:
            t += needs.leg[place, to, 0]
            b -= needs.leg[place, to, 2]
            place = to
        waits = max(days.window[k, m, 0] - t, 0.0)
        t += waits + needs.obs[m, 0]
        b -= days.hotel_w * waits + needs.obs[m, 2]
    for sol in range(sols):
        low[sol] = max(low[sol] - margin, 0)
        high[sol] = min(high[sol] + margin, length)
    low[0] = 0
    return low, high


@_compiled
def annealed(
    days: Days, needs: Needs, order: Array, length: int, caution: float, seed: int, steps: int, hot: float,
    cold: float,
) -> tuple[Array, int, Array, int, float]:  # fmt: skip
    """Return the order that simulated annealing ends at and its length, and the best with length and value.

    The temperature falls from `hot` to `cold`.

    `order` [m] holds observations by number, of which the first `length` count; both orders returned are [m]
    too.
    """
    np.random.seed(seed)
    now, size = order.copy(), length
    value = value_by_rule(days, needs, now, size, caution)
    best, best_size, best_value = now.copy(), size, value
    new = now.copy()
    for step in range(steps):
        heat = hot * (cold / hot) ** (step / steps)
        changed = changed_order(now, size, new)
        found = value_by_rule(days, needs, new, changed, caution)
        if found >= value or np.random.random() < np.exp((found - value) / heat):
            now, new = new, now
            size, value = changed, found
            if value > best_value:
                best[:] = now
                best_size, best_value = size, value
    return now, size, best, best_size, best_value


class Table(NamedTuple):
    """What a policy does, by sol, place in the order (the start first), time node and node of energy drawn.

    `leaving` (K, L + 1, nt, nd): 0 ends the sol, q goes to the q-th next; `arrived` (K, L, nt, nd): 0 ends
    the sol, 1 observes, 2 leaves it out.
    """

    order: Array
    leaving: Array
    arrived: Array
    step_t: Array  # (K,)
    step_d: Array
    most_j: Array


class Amounts(NamedTuple):
    """Log-normal parameters (mu T, sigma T, mu G, sigma G) of drives (P, P, 4) and observations (m, 4), and
    the chances that drives fail (P, P).
    """

    leg: Array
    obs: Array
    fail: Array


class Told(NamedTuple):
    """What N futures came to: utility (N, K), observations made (K, m), morning charge (N, K), overruns (K,),
    energy drawn (N, K).
    """

    utility: Array
    made: Array
    charge_j: Array
    overran: Array
    drawn_j: Array


@_compiled
def _draw(mu: float, sigma: float) -> float:
    return float(np.exp(mu + sigma * np.random.standard_normal())) if mu > -np.inf else 0.0


@_compiled
def _act(table: Table, arrived: bool, k: int, i: int, t: float, drawn: float) -> int:
    acts = table.arrived if arrived else table.leaving
    a = min(int(t / table.step_t[k] + 0.5), acts.shape[2] - 1)
    b = min(int(drawn / table.step_d[k] + 0.5), acts.shape[3] - 1)
    return int(acts[k, i, a, b])


@_compiled
def carried_out(
    days: Days, needs: Needs, amounts: Amounts, table: Table, seed: int, futures: int, told: Told
) -> None:
    """Carry a policy out in so many futures, written into `told`; the success coin is averaged out.

    Where a drive fails the rover is back, and what it was driving to is left out on all sols.
    """
    np.random.seed(seed)
    sols = len(days.time_s)
    for s in range(futures):
        b, place, i, arrived = days.charge_j, 0, 0, False  # i: observations of the order that are behind
        for k in range(sols):
            told.charge_j[s, k] = morning = b
            t, base = 0.0, table.most_j[k] - b
            while True:
                drawn = base + (morning - b) - days.hotel_w * t
                act = _act(table, arrived, k, i, t, max(drawn, 0.0))
                if act == 0:
                    break
                if arrived:
                    m = table.order[i]
                    if act == 2 or not days.allowed[k, m] or t > days.window[k, m, 1]:
                        i, arrived = i + 1, False
                        continue
                    took = _draw(amounts.obs[m, 0], amounts.obs[m, 1])
                    took += max(days.window[k, m, 0] - t, 0.0)
                    used = _draw(amounts.obs[m, 2], amounts.obs[m, 3]) + days.hotel_w * took
                    over = t + took > days.time_s[k] or b - used < days.reserve_j[k]
                    if not over:
                        told.utility[s, k] += needs.worth[m]
                        told.made[k, m] += 1.0
                        i, arrived = i + 1, False
                else:
                    following = i + act - 1
                    to = needs.place[table.order[following]]
                    took, used, over = 0.0, 0.0, False
                    fails = False
                    if to != place:
                        if not needs.has_leg[place, to]:  # back where a drive failed, which leads elsewhere
                            break
                        took = _draw(amounts.leg[place, to, 0], amounts.leg[place, to, 1])
                        used = _draw(amounts.leg[place, to, 2], amounts.leg[place, to, 3])
                        used += days.hotel_w * took
                        over = t + took > days.time_s[k] or b - used < days.reserve_j[k]
                        p_fail = amounts.fail[place, to]
                        fails = p_fail > 0.0 and np.random.random() < p_fail
                    if not over:
                        if fails:
                            i = following + 1
                        else:
                            i, place, arrived = following, to, True
                t += took
                b = max(b - used, days.reserve_j[k])
                if over:
                    told.utility[s, k] -= days.penalty
                    told.overran[k] += 1.0
                    break
            told.drawn_j[s, k] = morning - b
            b = min(days.ceiling_j[k], b + days.gain_j[k])
