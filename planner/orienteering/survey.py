"""Goal selection on large surveys: diversified local search for one budget and no other rule.

One site for each experiment, symmetric roads, one time budget, fixed ends: the classical orienteering
problem with tens to thousands of nodes. Most of several searches start with the best part of a tour through
everything, so that whole clusters are chosen at once; the budget of iterations goes round after round to the
better half of them.
One step takes out a few strings of neighbouring nodes, puts nodes back by prize against detour with a random
exponent, shortens the tour (2-opt and or-opt) and is accepted by annealing on prize minus a multiplier of
length.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from planner.orienteering.check import checked
from planner.orienteering.problem import RoutingProblem, RoutingSolution
from planner.orienteering.selection_kernels import part_within, tour_of_all
from planner.orienteering.survey_kernels import search
from planner.tally import SECONDS, Step, affordable, spend

ENGINE = "survey"

Array = npt.NDArray[Any]

_STARTS = 12
_BIG = 4
_LEFT = 1
_LOOKED_AT = 360  # nodes that a step looks at beside its neighbours and the route, of one take-out and repair
_COPIED = 8  # nodes of the route that are copied while one is looked at
_NEIGHBOUR = 5  # times that a step looks at each of the neighbours
_BUCKETS = 64  # of length, when a tour's best part is taken
_SELECTED = 0.25  # of a step for each label of that
_TOURED = 400  # of a step for each node of a tour through everything
_BEGUN = 0.25  # share of the steps that may go to the starts of several searches
_LAID_OUT = 4  # steps for each pair of nodes, when the neighbours are sorted
_CHUNKS = 150  # pieces into which the steps are cut
_HEAT = 1.0  # first temperature in mean prizes
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


@dataclass(frozen=True, slots=True, eq=False)
class SurveyMap:
    """A survey laid out for the compiled search: node 0 is the start, node n - 1 the end.

    Lengths (n, n) and prizes (n,) are integers; `usable` are the nodes that a tour within the budget may
    visit and that are worth it, `near` (n, K) the nearest of them, -1 as filler.
    """

    length: Array
    prize: Array
    near: Array
    usable: Array
    budget: int

    @staticmethod
    def of(p: RoutingProblem) -> SurveyMap:
        """Return the map of a problem that `is_survey`."""
        sites = np.array([p.start_site, *(e.site for e in p.experiments), p.end_site], dtype=np.int64)
        d = np.ascontiguousarray(p.travel_time[np.ix_(sites, sites)]).astype(np.int64)
        np.fill_diagonal(d, 0)
        if p.start_site == p.end_site:
            d[0, -1] = d[-1, 0] = 0
        n = len(sites)
        prize = np.zeros(n, dtype=np.int64)
        prize[1:-1] = [e.prize for e in p.experiments]
        budget = p.time_budget - p.start_time
        inner = (np.arange(n) > 0) & (np.arange(n) < n - 1)
        usable = np.nonzero((d[0] + d[:, n - 1] <= budget) & inner & (prize > 0))[0]
        k = min(len(usable), 24 if n > 60 else 60)
        near = np.full((n, max(1, k)), -1, dtype=np.int64)
        for v in range(n if k else 0):
            others = usable[usable != v]
            order = np.argsort(d[v, others], kind="stable")[:k]
            near[v, : len(order)] = others[order]
        spend(Step.SURVEY, _LAID_OUT * n * n)
        return SurveyMap(d, prize, near, usable, budget)

    @property
    def nodes(self) -> int:
        """Number of nodes, both ends among them."""
        return len(self.prize)

    @property
    def work(self) -> int:
        """Nodes that one step of the search looks at."""
        return _LOOKED_AT + _NEIGHBOUR * self.near.shape[1] + self.nodes // _COPIED

    @property
    def selection(self) -> int:
        """Steps that `selected` takes at most, nearly."""
        labels = _BUCKETS * len(self.usable) ** 2 // 4
        return int((_SELECTED * labels + _TOURED * len(self.usable)) / self.work)

    def improve(self, route: Array, steps: int, heat: float, seed: int) -> tuple[Array, int, Array]:
        """Return the best tour after so many steps from a route (k,), its prize, and the last tour."""
        spend(Step.SURVEY, steps * self.work)
        best, value, last = search(
            self.length, self.prize, self.near, self.budget, route, steps, heat, seed, self.usable
        )
        return best, int(value), last

    def selected(self, route: Array, seed: int) -> tuple[Array, int]:
        """Return the best part of a tour through everything made of a route (k,), and its cost in steps."""
        state = np.array([np.uint64(seed)])
        everything = tour_of_all(self.length, self.near, self.usable, route, state)
        part, work = part_within(self.length, self.prize, everything, self.budget, _BUCKETS)
        steps = int(_SELECTED * work / self.work) + _TOURED * len(everything) // self.work + 1
        spend(Step.SURVEY, steps * self.work)
        return part, steps

    def first_route(self, wanted: Array) -> Array:
        """Return a tour of the wanted nodes (k,) that fit, each put in where it costs least."""
        d, route = self.length, [0, self.nodes - 1]
        total = int(d[0, self.nodes - 1])
        for v in wanted.tolist():
            here, after = np.array(route[:-1]), np.array(route[1:])
            costs = d[here, v] + d[v, after] - d[here, after]
            at = int(np.argmin(costs))
            if total + int(costs[at]) <= self.budget:
                total += int(costs[at])
                route.insert(at + 1, v)
        return np.array(route, dtype=np.int64)


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
    m = SurveyMap.of(p)
    if m.budget < 0 or m.length[0, -1] > m.budget:
        return RoutingSolution(None, None, True, (), ENGINE, seed, time.perf_counter() - begin)
    rng = np.random.default_rng(np.random.SeedSequence([seed, 7]))
    left_s = time_limit_s - _LAID_OUT * m.nodes**2 * SECONDS[Step.SURVEY]
    paid = affordable(Step.SURVEY, left_s) // m.work
    limit = float(paid if iterations is None else min(iterations, max(1, paid)))
    planned = int(limit) if iterations is None else iterations
    route, value, done = (
        (np.array([0, m.nodes - 1]), 0, 0) if not len(m.usable) else _race(m, planned, limit, rng)
    )
    chosen = tuple(int(v) - 1 for v in route[1:-1])
    total = p.base_prize + int(m.prize[m.usable].sum())
    value += p.base_prize
    solution = RoutingSolution(
        value, total, value == total, chosen, ENGINE, seed, time.perf_counter() - begin, int(done)
    )
    return checked(p, solution)


def _race(m: SurveyMap, planned: int, limit: float, rng: np.random.Generator) -> tuple[Array, int, int]:
    """Return the best route of several searches, its prize and the steps done."""
    best_route, best_value, done = np.array([0, m.nodes - 1], dtype=np.int64), 0, 0

    def fresh(select: bool) -> tuple[Array, int]:
        count = int(rng.integers(1, 4)) if select else 0
        route = m.first_route(rng.choice(m.usable, size=min(len(m.usable), count), replace=False))
        return m.selected(route, int(rng.integers(1, 2**62))) if select else (route, 0)

    starts, left = (_STARTS, 2) if m.nodes <= 250 else (_BIG, _LEFT)
    pool: list[tuple[int, int, Array]] = []
    while len(pool) < starts and (not pool or done + m.selection <= _BEGUN * limit):
        route, cost = fresh(bool(pool))
        done += cost
        pool.append((0, len(pool), route))
    chunk = int(min(20_000.0, max(50.0, planned / _CHUNKS)))
    temperature = max(1.0, float(m.prize[m.usable].mean())) * _HEAT
    stage = 0
    while done < limit:
        after = []
        for value, s, route in pool:
            if done >= limit:
                after.append((value, s, route))
                continue
            steps = int(min(chunk, limit - done))
            heat = temperature * _COLDEST ** min(1.0, done / limit)
            top, top_value, last = m.improve(route, steps, heat, int(rng.integers(1, 2**62)))
            done += steps
            if top_value > best_value:
                best_value, best_route = top_value, top
            after.append((top_value, s, last if stage % 4 else top))
        stage += 1
        # Every few rounds the worse half gives its time to the better; at the end of a race, begin anew.
        if stage % 4 == 0 and len(after) > left:
            after.sort(key=lambda r: (-r[0], r[1]))
            after = after[: max(left, (len(after) + 1) // 2)]
        elif left > 1 and len(after) <= left and stage % 24 == 0:
            after.append((best_value, 0, best_route))
            for s in range(1, 5):
                route, cost = fresh(True)
                done += cost
                after.append((0, s, route))
        pool = after
    return best_route, best_value, done
