"""Goal selection on large surveys: a population of tours for one budget and no other rule.

One site for each experiment, symmetric roads, one time budget, fixed ends: the classical orienteering
problem with tens to thousands of nodes. Each tour of the population begins with the best part of a tour
through everything, so that whole clusters are chosen at once, and is annealed (`survey_kernels`). A child is
a tour with the nodes of a second one, or with a region that it lacks, of which the best part within the
budget is taken and annealed: so excursions of many nodes come in and others go, which no step on its own
would pay for.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from planner.orienteering.check import checked
from planner.orienteering.problem import RoutingProblem, RoutingSolution
from planner.orienteering.selection_kernels import part_within, tour_with
from planner.orienteering.survey_kernels import POWERS, anneal
from planner.orienteering.tour_kernels import KINDS, PRICED
from planner.tally import SECONDS, Step, affordable, spend

ENGINE = "survey"

Array = npt.NDArray[Any]

# By hand, on the tuning files that docs/results/orienteering.md names, where nothing else is said.
_NEIGHBOURS = 24  # nearest nodes kept of each
_BUCKETS = 64  # of length, when a child's best part is taken
_FIRST = 16  # the same of a first tour, which is annealed long: with 64 each took 11 ms on d657-gen3
_BEGUN = 0.25  # share of the limit for the first tours of a population
_FEWEST, _MOST = 3, 50  # tours of a population
_START = 3000  # steps of a first tour
_CHILD = 400  # steps of a child: with 1200 the mean gap on eight files after 1 s was 0.2 % more
_LEAST = 0.97  # of its parent's prize, for a child before it is annealed: to find less takes long
_REGION = (5, 60)  # nodes of a region put in
_REGIONS = 0.3  # share of children made with a region
_STALE = 4  # times the population that children may fail to get in before a new one is begun
_HOT, _WARM, _COLD = 0.1, 0.03, 0.01  # temperatures of first tours and children, and the last; in mean prizes
_PENALTY = 0.6  # first penalty on length, of prize over budget
_PASSES = 20  # looks at each pair of nodes when the best part of a tour of all is taken, nearly
_PIECES = 50  # of one annealing alone, so that it can be stopped
_UNLIMITED = 1 << 60  # steps

_LAID_OUT = 2.5  # cost of each pair of nodes, when the neighbours are sorted
_WEIGHTS = np.array([0.52, 0.34, 0.67, 0.59, 0.078, 0.23])
"""Cost of each kind of work in `tour_kernels` (KINDS,), in `Step.SURVEY`.

Least squares over seven of the tuning files beside other work, measured in turns with the code before, which
used 1.05 to 1.12 of its limit alone on a core: such that a limit as reckoned uses the same there.
"""


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
    visit and that are worth it, `near` (n, K) the nearest of them, -1 as filler, and `apart` (n, K) how far
    they are. `powers` (P, n) are the prizes to each of `survey_kernels.POWERS`.
    """

    length: Array
    prize: Array
    near: Array
    apart: Array
    powers: Array
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
        k = min(len(usable), _NEIGHBOURS)
        near = np.full((n, max(1, k)), -1, dtype=np.int64)
        apart = np.full((n, max(1, k)), np.iinfo(np.int64).max)
        for v in range(n if k else 0):
            others = usable[usable != v]
            order = np.argsort(d[v, others], kind="stable")[:k]
            near[v, : len(order)] = others[order]
            apart[v, : len(order)] = d[v, others[order]]
        spend(Step.SURVEY, _LAID_OUT * n * n)
        powers = prize[None, :] ** POWERS[:, None]
        return SurveyMap(d, prize, near, apart, powers, usable, budget)

    @property
    def nodes(self) -> int:
        """Number of nodes, both ends among them."""
        return len(self.prize)

    def total(self, route: Array) -> tuple[int, int]:
        """Return prize and length of a route (k,)."""
        return int(self.prize[route].sum()), int(self.length[route[:-1], route[1:]].sum())

    def selected(self, route: Array, more: Array, least: int, state: Array) -> tuple[Array, float]:
        """Return the best part of a tour through a route (k,) and more nodes (m,), and the cost.

        Parts worth less than `least` are not looked for thoroughly; a first tour, with 0, in fewer buckets.
        """
        work = np.zeros(KINDS, dtype=np.int64)
        tour = tour_with(self.length, self.near, self.apart, more, route, state, work)
        buckets = _BUCKETS if least > 0 else _FIRST
        part = part_within(self.length, self.prize, tour, self.budget, buckets, least, work)
        cost = float(work @ _WEIGHTS)
        spend(Step.SURVEY, cost)
        return part, cost

    def annealed(
        self,
        route: Array,
        steps: int,
        most: float,
        hot: float,
        penalty: Array,
        state: Array,
        cold: float = _COLD,
    ) -> tuple[Array, int, float]:
        """Return the best tour within the budget, the steps done and their cost, at most about `most`.

        Temperatures are in mean prizes; `penalty` (1,) of length and `state` (1,) of chance are moved on.
        """
        mean = max(1.0, float(self.prize[self.usable].mean()))
        heat = np.array([hot * mean, cold * mean])
        best, done, cost = anneal(
            self.length,
            self.near,
            self.apart,
            self.prize,
            self.powers,
            self.budget,
            route,
            heat,
            penalty,
            state,
            steps,
            most,
            _WEIGHTS,
        )
        spend(Step.SURVEY, cost)
        return best, int(done), float(cost)

    def improve(self, route: Array, steps: int, seed: int) -> tuple[Array, int]:
        """Return the best tour after so many steps from a route (k,) within the budget, and its prize."""
        penalty = self.penalty_of(route)
        best, _, _ = self.annealed(route, steps, np.inf, _HOT, penalty, np.array([np.uint64(seed)]))
        return best, self.total(best)[0]

    def penalty_of(self, route: Array) -> Array:
        """Return a first penalty on length (1,) for a route (k,)."""
        return np.array([_PENALTY * max(1, self.total(route)[0]) / max(1, self.budget)])

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


@dataclass(slots=True)
class _Effort:
    """Steps and cost that a search may spend and has spent; progress is the share of the scarcer one."""

    steps: int
    most: float
    done: int = 0
    spent: float = 0.0

    @property
    def progress(self) -> float:
        return max(self.done / self.steps, self.spent / self.most)


@dataclass(slots=True, order=True)
class _Member:
    """A tour of the population; the better one is the greater."""

    prize: int
    saved: int
    """Length below zero."""
    route: Array = field(compare=False)
    penalty: float = field(compare=False)


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
    left_s = time_limit_s - _LAID_OUT * m.nodes**2 * SECONDS[Step.SURVEY]
    effort = _Effort(
        _UNLIMITED if iterations is None else max(1, iterations),
        float(max(1, affordable(Step.SURVEY, left_s))),
    )
    route = _Search(m, effort, seed).run() if len(m.usable) else np.array([0, m.nodes - 1])
    chosen = tuple(int(v) - 1 for v in route[1:-1])
    total = p.base_prize + int(m.prize[m.usable].sum())
    value = p.base_prize + m.total(route)[0]
    solution = RoutingSolution(
        value, total, value == total, chosen, ENGINE, seed, time.perf_counter() - begin, effort.done
    )
    return checked(p, solution)


class _Search:
    """A population of tours, improved until steps or cost are spent or everything is visited."""

    def __init__(self, m: SurveyMap, effort: _Effort, seed: int) -> None:
        self.map, self.effort = m, effort
        self.rng = np.random.default_rng(np.random.SeedSequence([seed, 7]))
        self.state = self.rng.integers(1, 2**62, 1).astype(np.uint64)
        self.everything = int(m.prize[m.usable].sum())
        self.pool: list[_Member] = []

    def run(self) -> Array:
        """Return the best tour (k,)."""
        m, effort = self.map, self.effort
        if _PASSES * len(m.usable) ** 2 * _WEIGHTS[PRICED] * _FEWEST > _BEGUN * effort.most:
            return self._alone()
        best, members, steps = None, 0, _START
        while True:
            until = effort.progress + _BEGUN * (1.0 - effort.progress)
            self.pool = [best] if best else []
            while not self._enough(members, until):
                began = effort.progress
                self.pool.append(self._first(steps))
                if not members:  # the first tour tells how many the limit pays for
                    paid = _BEGUN / max(effort.progress - began, 1e-9)
                    members = int(min(max(paid, _FEWEST), _MOST))
                    steps = int(steps * max(1.0, paid / members))
            failed = 0
            while failed < _STALE * members:
                best = max(self.pool)
                if effort.progress >= 1.0 or best.prize == self.everything:
                    return best.route
                failed = 0 if self._generation(members) else failed + 1

    def _enough(self, members: int, until: float) -> bool:
        """Return whether the population has its members or time, or a tour that visits everything."""
        pool = self.pool
        if not pool:
            return False
        full = len(pool) >= members or self.effort.progress >= until
        return full or max(pool).prize == self.everything

    def _alone(self) -> Array:
        """Return one tour annealed all the time: the limit does not pay for a tour of everything."""
        m, effort = self.map, self.effort
        route, hot = np.array([0, m.nodes - 1]), _HOT
        penalty = np.array([_PENALTY * self.everything / max(1, m.budget)])
        for k in range(_PIECES):
            cold = _HOT * (_COLD / _HOT) ** ((k + 1) / _PIECES)
            route = self._annealed(route, effort.steps // _PIECES + 1, hot, penalty, (k + 1) / _PIECES, cold)
            hot = cold
        return route

    def _first(self, steps: int) -> _Member:
        m = self.map
        few = min(len(m.usable), int(self.rng.integers(1, 4)))
        begun = m.first_route(self.rng.choice(m.usable, size=few, replace=False))
        return self._member(_Member(0, 0, begun, 0.0), m.usable, steps, _HOT)

    def _generation(self, members: int) -> bool:
        """Make a child; return whether it got into the population."""
        m, rng, pool = self.map, self.rng, self.pool
        one = pool[int(rng.integers(len(pool)))]
        other = pool[int(rng.integers(len(pool)))]
        on = np.zeros(m.nodes, dtype=np.bool_)
        on[one.route] = True
        more = other.route[~on[other.route]]
        if not len(more) or rng.random() < _REGIONS:
            out = m.usable[~on[m.usable]]
            middle = out[int(rng.integers(len(out)))]
            near = np.argsort(m.length[middle, out], kind="stable")
            more = out[near[: int(rng.integers(*_REGION))]]
        child = self._member(one, more, _CHILD, _WARM)
        if any(child == member for member in pool):
            return False
        if len(pool) < members:
            pool.append(child)
            return True
        worst = min(range(len(pool)), key=pool.__getitem__)
        if child < pool[worst]:
            return False
        pool[worst] = child
        return True

    def _member(self, parent: _Member, more: Array, steps: int, hot: float) -> _Member:
        m = self.map
        part, cost = m.selected(parent.route, more, int(_LEAST * parent.prize), self.state)
        self.effort.spent += cost
        penalties = np.array([parent.penalty]) if parent.penalty else m.penalty_of(part)
        best = self._annealed(part, steps, hot, penalties, 1.0)
        prize, length = m.total(best)
        return _Member(prize, -length, best, float(penalties[0]))

    def _annealed(
        self, route: Array, steps: int, hot: float, penalty: Array, until: float, cold: float = _COLD
    ) -> Array:
        e = self.effort
        steps = min(steps, e.steps - e.done)
        most = until * e.most - e.spent
        if steps <= 0 or most <= 0.0:
            return route
        best, done, cost = self.map.annealed(route, steps, most, hot, penalty, self.state, cold)
        e.done += done
        e.spent += cost
        return best
