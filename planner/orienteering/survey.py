"""Goal selection on large surveys: diversified local search for one budget and no other rule.

One site for each experiment, symmetric roads, one time budget, fixed ends: the classical orienteering
problem with tens to thousands of nodes. Several searches start through different far nodes, so that they
do not lock into one region; the budget of iterations goes round after round to the better half of them.
One step takes out a few strings of neighbouring nodes, puts nodes back by prize against detour with a random
exponent, shortens the tour (2-opt and or-opt) and is accepted by annealing on prize minus a price on length.
"""

from __future__ import annotations

import math
import time
from itertools import pairwise
from typing import Any

import numba
import numpy as np
import numpy.typing as npt

from planner.orienteering.check import checked
from planner.orienteering.problem import RoutingProblem, RoutingSolution

ENGINE = "survey"

Array = npt.NDArray[Any]

_STARTS = 12


def is_survey(p: RoutingProblem) -> bool:
    """Return whether a problem has no rule but one time budget, one experiment a site and symmetric roads."""
    sites = [e.site for e in p.experiments]
    if p.end_site is None or p.energy_budget is not None or p.precedence or p.limits or p.done:
        return False
    if len(set(sites)) != len(sites) or p.start_site in sites or p.end_site in sites:
        return False
    if any(
        e.duration or e.energy or e.earliest_start or e.latest_end is not None or e.must_do
        for e in p.experiments
    ):
        return False
    return bool((p.travel_time >= 0).all() and (p.travel_time == p.travel_time.T).all())


def solve_survey(
    problem: RoutingProblem,
    *,
    time_limit_s: float = 10.0,
    iterations: int | None = None,
    seed: int = 0,
) -> RoutingSolution:
    """Return the best route found; no bound. Deterministic for a seed when `iterations` is what stops it."""
    begin = time.perf_counter()
    p = problem
    sites = np.array([p.start_site, *(e.site for e in p.experiments), p.end_site], dtype=np.int64)
    d = np.ascontiguousarray(p.travel_time[np.ix_(sites, sites)]).astype(np.int64)
    n = len(sites)
    prize = np.zeros(n, dtype=np.int64)
    prize[1:-1] = [e.prize for e in p.experiments]
    budget = p.time_budget - p.start_time
    if budget < 0 or d[0, n - 1] > budget:
        return RoutingSolution(None, None, True, (), ENGINE, seed, time.perf_counter() - begin)
    usable = np.nonzero(
        (d[0] + d[:, n - 1] <= budget) & (np.arange(n) > 0) & (np.arange(n) < n - 1) & (prize > 0)
    )[0]
    k = min(len(usable), 24 if n > 60 else 60)
    near = np.zeros((n, max(1, k)), dtype=np.int64)
    near[:] = -1
    if k:
        for v in range(n):
            others = usable[usable != v]
            order = np.argsort(d[v, others], kind="stable")[:k]
            near[v, : len(order)] = others[order]
    rng = np.random.default_rng(np.random.SeedSequence([seed, 7]))
    best_route, best_value = np.array([0, n - 1], dtype=np.int64), 0
    done = 0
    if k:
        starts = _STARTS if n <= 250 else 4 if n <= 700 else 2
        pool: list[tuple[int, int, Array]] = []
        for s in range(starts):
            seeds = rng.choice(
                usable, size=min(len(usable), 0 if s == 0 else int(rng.integers(1, 4))), replace=False
            )
            pool.append((0, s, _first_route(d, budget, seeds.astype(np.int64), n)))
        chunk = max(50, 200_000 // n) if n <= 1500 else 150
        limit = math.inf if iterations is None else float(iterations)
        temperature = max(1.0, float(prize[usable].mean())) * 0.6
        stage, stop = 0, False
        while not stop:
            fresh = []
            for value, s, route in pool:
                elapsed = (time.perf_counter() - begin) / max(time_limit_s, 1e-9)
                share = max(elapsed, done / limit) if math.isfinite(limit) else elapsed
                if share >= 1.0 or done >= limit:
                    stop = True
                    fresh.append((value, s, route))
                    continue
                steps = int(min(chunk, limit - done))
                heat = temperature * max(0.03, 1.0 - share)
                if iterations is not None:
                    heat = temperature * max(0.03, 1.0 - done / limit)
                top, top_value, last = _search(
                    d, prize, near, budget, route, steps, heat, int(rng.integers(1, 2**62)), usable
                )
                done += steps
                if top_value > best_value:
                    best_value, best_route = int(top_value), top
                fresh.append((int(top_value), s, last if stage % 4 else top))
            stage += 1
            # Every few rounds the worse half gives its time to the better; at the end of a race, begin anew.
            if stage % 4 == 0 and len(fresh) > 2:
                fresh.sort(key=lambda r: (-r[0], r[1]))
                fresh = fresh[: max(2, (len(fresh) + 1) // 2)]
            elif len(fresh) <= 2 and stage % 24 == 0 and starts > 1:
                fresh.append((best_value, 0, best_route))
                for s in range(1, 5):
                    seeds = rng.choice(usable, size=min(len(usable), int(rng.integers(1, 4))), replace=False)
                    fresh.append((0, s, _first_route(d, budget, seeds.astype(np.int64), n)))
            pool = fresh
    chosen = tuple(int(v) - 1 for v in best_route[1:-1])
    value = p.base_prize + best_value
    total = p.base_prize + int(prize[usable].sum())
    solution = RoutingSolution(
        value, total, value == total, chosen, ENGINE, seed, time.perf_counter() - begin, int(done)
    )
    return checked(p, solution)


def _first_route(d: Array, budget: int, seeds: Array, n: int) -> Array:
    """Return the tour start, nearest seeds, end; seeds that do not fit are left out."""
    route = [0, n - 1]
    for v in seeds.tolist():
        costs = [int(d[a, v] + d[v, b] - d[a, b]) for a, b in pairwise(route)]
        length = sum(int(d[a, b]) for a, b in pairwise(route))
        at = int(np.argmin(costs))
        if length + costs[at] <= budget:
            route.insert(at + 1, v)
    return np.array(route, dtype=np.int64)


@numba.njit(cache=True, nogil=True)
def _random(state: Array) -> float:
    """Return a uniform number in [0, 1): splitmix64."""
    state[0] += np.uint64(0x9E3779B97F4A7C15)
    z = state[0]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z ^= z >> np.uint64(31)
    return float(z >> np.uint64(11)) / 9007199254740992.0


@numba.njit(cache=True, nogil=True)
def _shorten(d: Array, tour: Array, size: int, near: Array, at: Array, begin: int, rounds: int) -> int:
    """Shorten tour[:size] (ends fixed) by 2-opt and or-opt over neighbour lists; return the new length."""
    length = 0
    for i in range(size):
        at[tour[i]] = i
        if i:
            length += d[tour[i - 1], tour[i]]
    width = min(10, near.shape[1])
    for _ in range(rounds):
        improved = False
        for i in range(size - 1):
            a = tour[i]
            b = tour[i + 1]
            ab = d[a, b]
            for q in range(width):
                c = near[a, q]
                if c < 0:
                    break
                if d[a, c] >= ab:
                    break
                j = at[c]
                if j < 0:
                    continue
                # 2-opt: a-c and b-next(c) instead of a-b and c-next(c)
                if j > i + 1 and j < size - 1:
                    e = tour[j + 1]
                    delta = d[a, c] + d[b, e] - ab - d[c, e]
                    if delta < 0:
                        lo, hi = i + 1, j
                        while lo < hi:
                            tour[lo], tour[hi] = tour[hi], tour[lo]
                            lo += 1
                            hi -= 1
                        for m in range(i + 1, j + 1):
                            at[tour[m]] = m
                        length += delta
                        improved = True
                        b = tour[i + 1]
                        ab = d[a, b]
                        continue
                elif j < i and j > 0:
                    e = tour[j + 1]
                    delta = d[c, a] + d[e, b] - d[c, e] - ab
                    if delta < 0:
                        lo, hi = j + 1, i
                        while lo < hi:
                            tour[lo], tour[hi] = tour[hi], tour[lo]
                            lo += 1
                            hi -= 1
                        for m in range(j + 1, i + 1):
                            at[tour[m]] = m
                        length += delta
                        improved = True
                        break
                # or-opt: move c (one to three nodes from c on) between a and b
                if j > 0 and j < size - 1 and j != i and j != i + 1:
                    done = False
                    for run in range(1, 4):
                        last = j + run - 1
                        if last >= size - 1 or (j <= i <= last):
                            break
                        if last == i:
                            break
                        before, after = tour[j - 1], tour[last + 1]
                        tail = tour[last]
                        out = d[before, c] + d[tail, after] - d[before, after]
                        into = min(d[a, c] + d[tail, b], d[a, tail] + d[c, b]) - ab
                        if into - out < 0:
                            flip = d[a, tail] + d[c, b] < d[a, c] + d[tail, b]
                            s0, s1, s2 = tour[j], tour[min(j + 1, last)], tour[last]
                            if last < i:
                                for m in range(j, i - run + 1):
                                    tour[m] = tour[m + run]
                                put = i - run + 1
                            else:
                                m = last
                                while m - run > i:
                                    tour[m] = tour[m - run]
                                    m -= 1
                                put = i + 1
                            if run == 1:
                                tour[put] = s0
                            elif run == 2:
                                tour[put] = s2 if flip else s0
                                tour[put + 1] = s0 if flip else s2
                            else:
                                tour[put] = s2 if flip else s0
                                tour[put + 1] = s1
                                tour[put + 2] = s0 if flip else s2
                            lo = min(put, j)
                            hi = max(put + run, last + 1)
                            lo = min(lo, i)
                            hi = max(hi, i + 2)
                            for m in range(max(0, lo), min(size, hi)):
                                at[tour[m]] = m
                            length += into - out
                            improved = True
                            done = True
                            break
                    if done:
                        break
        if not improved:
            break
    return length


@numba.njit(cache=True, nogil=True)
def _search(
    d: Array,
    prize: Array,
    near: Array,
    budget: int,
    route: Array,
    steps: int,
    heat: float,
    seed: int,
    usable: Array,
) -> tuple[Array, int, Array]:
    """Return the best tour of so many steps, its prize, and the tour at the end."""
    n = len(d)
    state = np.array([np.uint64(seed)])
    tour = np.empty(n + 1, np.int64)
    trial = np.empty(n + 1, np.int64)
    best = np.empty(n + 1, np.int64)
    at = np.full(n, -1, np.int64)
    size = len(route)
    length, value = 0, 0
    for i in range(size):
        tour[i] = route[i]
        value += prize[route[i]]
        if i:
            length += d[route[i - 1], route[i]]
    best_size, best_value, best_length = size, value, length
    best[:size] = tour[:size]
    price = 0.03 * prize.sum() / max(1, budget)
    width = near.shape[1]
    queue = np.empty(n, np.int64)
    marked = np.zeros(n, np.int64)
    for step in range(steps):
        m = size
        trial[:m] = tour[:m]
        t_value, t_length = value, length
        # take out strings round a random node
        if m > 2:
            cuts = 1 + int(_random(state) * 3)
            centre = trial[1 + int(_random(state) * (m - 2))]
            for c in range(cuts):
                if m <= 2:
                    break
                pick = -1
                if c == 0:
                    for i in range(1, m - 1):
                        if trial[i] == centre:
                            pick = i
                            break
                else:
                    # a tour node near the first one
                    for _ in range(6):
                        v = near[centre, int(_random(state) * width)]
                        if v >= 0:
                            for i in range(1, m - 1):
                                if trial[i] == v:
                                    pick = i
                                    break
                        if pick >= 0:
                            break
                if pick < 0:
                    pick = 1 + int(_random(state) * (m - 2))
                run = 1 + int(_random(state) * min(10, m - 2))
                low = max(1, pick - int(_random(state) * run))
                high = min(m - 1, low + run)
                for i in range(low, high):
                    t_value -= prize[trial[i]]
                gone = high - low
                for i in range(low, m - gone):
                    trial[i] = trial[i + gone]
                m -= gone
        for i in range(n):
            at[i] = -1
        t_length = 0
        for i in range(m):
            at[trial[i]] = i
            if i:
                t_length += d[trial[i - 1], trial[i]]
        # put nodes back: best noisy score first
        power = 0.5 + 1.5 * _random(state)
        noise = 0.3 * _random(state)
        polished = False
        for turn in range(2):
            while True:
                best_score, best_node, best_place, best_extra = -1.0, -1, -1, 0
                # candidates: neighbours of a window of the tour, or everything when small
                count = 0
                if len(usable) <= 80:
                    for q in range(len(usable)):
                        if at[usable[q]] < 0:
                            queue[count] = usable[q]
                            count += 1
                else:
                    stamp = step * 1000003 + turn * 7919 + m + 1
                    probes = min(m, 12)
                    for _ in range(probes):
                        i = int(_random(state) * m)
                        for q in range(min(width, 12)):
                            v = near[trial[i], q]
                            if v >= 0 and at[v] < 0 and marked[v] != stamp:
                                marked[v] = stamp
                                queue[count] = v
                                count += 1
                room = budget - t_length
                for c in range(count):
                    v = queue[c]
                    place, extra = -1, 0
                    if m <= 24:
                        for i in range(m - 1):
                            e = d[trial[i], v] + d[v, trial[i + 1]] - d[trial[i], trial[i + 1]]
                            if place < 0 or e < extra:
                                place, extra = i, e
                    else:
                        seen = 0
                        for q in range(width):
                            w = near[v, q]
                            if w < 0:
                                break
                            i = at[w]
                            if i < 0:
                                continue
                            seen += 1
                            if i > 0:
                                e = d[trial[i - 1], v] + d[v, w] - d[trial[i - 1], w]
                                if place < 0 or e < extra:
                                    place, extra = i - 1, e
                            if i < m - 1:
                                e = d[w, v] + d[v, trial[i + 1]] - d[w, trial[i + 1]]
                                if place < 0 or e < extra:
                                    place, extra = i, e
                            if seen >= 5:
                                break
                        if place < 0:
                            i = int(_random(state) * (m - 1))
                            place = i
                            extra = d[trial[i], v] + d[v, trial[i + 1]] - d[trial[i], trial[i + 1]]
                    if extra > room:
                        continue
                    score = (1.0 * prize[v]) ** power / (extra + 0.02 * budget / m + 1e-9)
                    score *= 1.0 + noise * (_random(state) - 0.5) * 2.0
                    if score > best_score:
                        best_score, best_node, best_place, best_extra = score, v, place, extra
                if best_node < 0:
                    break
                i = m
                while i > best_place + 1:
                    trial[i] = trial[i - 1]
                    at[trial[i]] = i
                    i -= 1
                trial[best_place + 1] = best_node
                at[best_node] = best_place + 1
                m += 1
                t_length += best_extra
                t_value += prize[best_node]
            if turn == 0 or not polished:
                shorter = _shorten(d, trial, m, near, at, 0, 20)
                if shorter >= t_length:
                    t_length = shorter
                    break
                t_length = shorter
        delta = (t_value - value) - price * (t_length - length)
        if delta >= 0 or _random(state) < math.exp(delta / heat):
            size, value, length = m, t_value, t_length
            tour[:m] = trial[:m]
            if value > best_value or (value == best_value and length < best_length):
                best_size, best_value, best_length = m, value, length
                best[:m] = trial[:m]
    return best[:best_size].copy(), best_value, tour[:size].copy()
