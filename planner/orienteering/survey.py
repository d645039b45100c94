"""Goal selection on large surveys: diversified local search for one budget and no other rule.

One site for each experiment, symmetric roads, one time budget, fixed ends: the classical orienteering
problem with tens to thousands of nodes. Several searches start through different far nodes, so that they
do not lock into one region; the budget of iterations goes round after round to the better half of them.
One step takes out a few strings of neighbouring nodes, puts nodes back by prize against detour with a random
exponent, shortens the tour (2-opt and or-opt) and is accepted by annealing on prize minus a multiplier of
length.
"""

from __future__ import annotations

import time
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from planner.orienteering.check import checked
from planner.orienteering.problem import RoutingProblem, RoutingSolution
from planner.orienteering.survey_kernels import search
from planner.tally import Step, affordable, spend

ENGINE = "survey"

Array = npt.NDArray[Any]

_STARTS = 12
_LOOKED_AT = 200  # nodes that a step looks at beside its neighbours and the route, of one take-out and repair
_NEIGHBOUR = 5  # times that a step looks at each of the neighbours
_CHUNKS = 150  # pieces into which the steps are cut
_HEAT = 3.0  # first temperature in mean prizes
_COLDEST = 0.01  # last temperature as a share of the first


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
    """Return the best route found; no bound. The same for the same seed and limit on every machine."""
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
        each = _LOOKED_AT + _NEIGHBOUR * k + n
        planned = iterations if iterations is not None else affordable(Step.SURVEY, time_limit_s) // each
        chunk = int(min(20_000.0, max(50.0, planned / _CHUNKS)))
        limit = float(planned)
        if iterations is not None:
            limit = min(limit, float(max(1, affordable(Step.SURVEY, time_limit_s) // each)))
        temperature = max(1.0, float(prize[usable].mean())) * _HEAT
        stage, stop = 0, False
        while not stop:
            fresh = []
            for value, s, route in pool:
                if done >= limit:
                    stop = True
                    fresh.append((value, s, route))
                    continue
                steps = int(min(chunk, limit - done))
                heat = temperature * _COLDEST ** min(1.0, done / limit)
                spend(Step.SURVEY, steps * each)
                top, top_value, last = search(
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
