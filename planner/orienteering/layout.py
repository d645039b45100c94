"""A routing problem laid out for the exact engine: experiments sorted into groups, columns, bit sets.

A group is what the relaxation remembers together: the experiments of a site, or part of them where there are
many; the parts of a crowded site are joined by roads of no length.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from planner.errors import RoutingError
from planner.orienteering.problem import IntArray, RoutingProblem

_GROUP = 4


@dataclass(frozen=True, slots=True, eq=False)
class Root:
    """Where a search begins: group, subset of its experiments done, time, energy used.

    `done` and `late` (X,) mark with 1 what is already done and what can no longer be reached in time.
    """

    group: int
    mask: int
    time: int
    fuel: int
    done: IntArray
    late: IntArray


class Layout:
    """Columns over experiments in the order of their groups (`order`), and over groups.

    Without an energy budget all energies are 0. `worth` is the prize plus a bonus, larger than all prizes
    together, on each experiment that must be done. `links` are precedence pairs, `needs` the same
    as bit sets.
    """

    def __init__(self, problem: RoutingProblem) -> None:
        p = problem
        self.problem = p
        groups, sites = _grouped(p)
        self.order = np.array([x for g in groups for x in g], dtype=np.int64)
        self.rank = np.empty(len(self.order), dtype=np.int64)
        self.rank[self.order] = np.arange(len(self.order))
        sizes = np.array([len(g) for g in groups], dtype=np.int64)
        self.first = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        self.base = np.concatenate([[0], np.cumsum(1 << sizes)[:-1]]).astype(np.int64)
        self.states = int((1 << sizes).sum())
        self.site = np.array(sites, dtype=np.int64)
        self.road_s = _no_self(p.travel_time)[np.ix_(self.site, self.site)]
        self.road_j = _no_self(p.travel_energy)[np.ix_(self.site, self.site)]
        a, o = p.arrays, self.order
        self.value, self.duration, self.energy = a.prize[o], a.duration[o], a.energy[o]
        self.opens, self.latest = a.earliest_start[o], a.latest_end[o]
        self.open_end = p.end_site is None
        if p.end_site is None:
            self.end_s = self.end_j = np.zeros(len(self.site), dtype=np.int64)
        else:
            self.end_s = _no_self(p.travel_time)[self.site, p.end_site]
            self.end_j = _no_self(p.travel_energy)[self.site, p.end_site]
        self.e_budget = 0 if p.energy_budget is None else p.energy_budget
        if p.energy_budget is None:
            self.road_j, self.energy = np.zeros_like(self.road_j), np.zeros_like(self.energy)
            self.end_j = np.zeros_like(self.end_j)
        self.home_s, self.home_j = _homeward(self.road_s, self.end_s), _homeward(self.road_j, self.end_j)
        count = len(o)
        self.words = (count + 63) // 64
        self.needs = np.zeros((count, self.words), dtype=np.uint64)
        self.links: list[tuple[int, int]] = []
        for before, after in p.precedence:
            b, c = int(self.rank[before]), int(self.rank[after])
            self.needs[c, b >> 6] |= np.uint64(1) << np.uint64(b & 63)
            self.links.append((b, c))
        amounts = np.array([l.amounts for l in p.limits], dtype=np.int64).reshape(len(p.limits), count)
        self.amounts = np.ascontiguousarray(amounts[:, o])
        self.capacity = np.array([l.capacity for l in p.limits], dtype=np.int64)
        self.must = np.array([p.experiments[i].must_do for i in o.tolist()], dtype=bool)
        self.bonus = int(self.value.sum()) + 1
        self.worth = self.value + np.where(self.must, self.bonus, 0)
        self.shortest_move = _shortest_move(p, groups)
        self._quickest_s = _closure(self.road_s)

    @staticmethod
    def fits(problem: RoutingProblem) -> bool:
        """Return whether every move to another site takes time and the experiments fit the bit sets."""
        if len(problem.experiments) > 512 or not problem.experiments:
            return False
        groups, _ = _grouped(problem)
        if sum(1 << len(g) for g in groups) > 20_000:
            return False
        return _shortest_move(problem, groups) * 20_000 >= max(1, problem.time_budget)

    def root(self, p: RoutingProblem) -> Root:
        """Return where the search for a variant of the problem begins.

        Raises
        ------
        RoutingError
            If its start is neither the problem's own nor a site with experiments.
        """
        if len(p.experiments) != len(self.order) or p.start_site not in self.site:
            raise RoutingError(
                f"start_site is {p.start_site}; the table knows the first start and sites with experiments"
            )
        group = int(np.nonzero(self.site == p.start_site)[0][0])
        done = np.zeros(len(self.order), dtype=np.int64)
        done[self.rank[list(p.done)]] = 1
        mask = 0
        for x in range(self.first[group], self.first[group + 1]):
            if done[x]:
                mask |= 1 << int(x - self.first[group])
        fuel = p.energy_used if p.energy_budget is not None else 0
        # What can no longer be reached in time needs no multiplier: it cannot be done even once.
        reach = p.start_time + np.repeat(self._quickest_s[group], np.diff(self.first))
        late = (np.maximum(reach, self.opens) + self.duration > self.latest) & (done == 0)
        return Root(group, mask, p.start_time, fuel, done, late.astype(np.int64))

    def direct_end(self, root: Root) -> bool:
        """Return whether both budgets allow to go straight to the end."""
        p = self.problem
        if root.time > p.time_budget or root.fuel > self.e_budget:
            return False
        g = root.group
        return self.open_end or bool(
            self.end_s[g] >= 0
            and root.time + self.end_s[g] <= p.time_budget
            and root.fuel + self.end_j[g] <= self.e_budget
        )


def _closure(roads: IntArray) -> npt.NDArray[np.float64]:
    """Return the least time between groups over any number of roads; infinite where there is no way."""
    cost = np.where(roads < 0, np.inf, roads.astype(np.float64))
    for k in range(len(cost)):
        cost = np.minimum(cost, cost[:, k, None] + cost[None, k, :])
    return cost


def _homeward(roads: IntArray, ends: IntArray) -> IntArray:
    """Return the least time or energy [G] to the end, by way of others too; 2^60 where there is no way."""
    direct = np.where(ends < 0, np.inf, ends.astype(np.float64))
    least = (_closure(roads) + direct[None, :]).min(axis=1)
    return np.where(np.isinf(least), 2.0**60, np.floor(least)).astype(np.int64)


def _no_self(matrix: IntArray) -> IntArray:
    clean = np.array(matrix, dtype=np.int64)
    np.fill_diagonal(clean, 0)
    return clean


def _grouped(problem: RoutingProblem) -> tuple[list[list[int]], list[int]]:
    """Return groups of experiments and their sites; the start and end sites have one even when empty."""
    at: dict[int, list[int]] = {problem.start_site: []}
    for i, e in enumerate(problem.experiments):
        at.setdefault(e.site, []).append(i)
    groups: list[list[int]] = []
    sites: list[int] = []
    for site in sorted(at):
        members = at[site]
        parts = max(1, -(-len(members) // _GROUP))
        for k in range(parts):
            groups.append(members[k * _GROUP : (k + 1) * _GROUP])
            sites.append(site)
    return groups, sites


def _shortest_move(problem: RoutingProblem, groups: list[list[int]]) -> int:
    """Return the least time from leaving one group to the end of an experiment at another."""
    roads = _no_self(problem.travel_time)
    sites = sorted({problem.start_site, *(e.site for e in problem.experiments)})
    crowded = {problem.experiments[g[0]].site for g in groups if g} if len(groups) > len(sites) else set()
    inner = roads[np.ix_(sites, sites)].astype(np.float64)
    np.fill_diagonal(inner, np.inf)
    inner[inner < 0] = np.inf
    nearest = dict(zip(sites, inner.min(axis=0).tolist(), strict=True))
    least = math.inf
    for e in problem.experiments:
        road = 0.0 if e.site in crowded else nearest[e.site]
        least = min(least, road + e.duration)
    return int(least) if math.isfinite(least) else problem.time_budget + 1
