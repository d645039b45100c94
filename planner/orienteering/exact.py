"""Exact goal selection: label setting with a table of optimistic completions as bound.

1. A table over (group, experiments done there, time, energy) holds the most that can still be earned, with
   every rounding in the optimistic direction; experiments done elsewhere are forgotten, so it is a
   relaxation (state-space relaxation, Christofides, Mingozzi and Toth 1981).
2. Multipliers on "at most once", on precedence and on side limits, moved by subgradient steps, make the
   relaxed walk behave. With them, a partial route's bound is one sum and one look-up.
3. Labels are extended level by level (number of experiments done), thinned by dominance in time and energy
   and by the bound. Passes of growing width give good routes early; a pass in which nothing had to be
   dropped for width is the proof.

The table depends only on roads, experiments and budgets. Another start, time, energy left or set of
experiments done is answered from the same table: `ExactSolver.solve`.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from planner.errors import RoutingError
from planner.orienteering.check import checked
from planner.orienteering.label_kernels import NEVER, expand, fill_table, trace_table
from planner.orienteering.problem import IntArray, RoutingProblem, RoutingSolution

ENGINE = "exact"

_GROUP = 4  # experiments remembered together; more at one site are split into groups with roads of no length
_LOOKS = (4, 12)  # rounds after which a narrow pass looks for a better route
_WIDTHS = (30, 150, 1500, 15_000, 150_000, 1_500_000)


@dataclass(frozen=True, slots=True)
class ExactOptions:
    """Sizes of the tables and the number of multiplier rounds.

    `cells` and `coarse_cells` are targets for (states x time x energy) of the fine table and of those made
    for the multipliers (at most `coarse_state` a state); the search tries the coarse one first and makes
    the fine one when a pass of 1500 labels a level was no proof.
    `labels` is the most that one level may hold.
    """

    cells: int = 10_000_000
    coarse_cells: int = 1_000_000
    coarse_state: int = 5_000
    rounds: int = 35
    labels: int = 3_000_000


class ExactSolver:
    """The exact engine for one problem; keeps its table between calls.

    Use `ExactSolver.fits` first: problems whose moves can take no time, or with too many experiments, are
    not for it.
    """

    def __init__(self, problem: RoutingProblem, options: ExactOptions = ExactOptions()) -> None:
        self._problem = problem
        self._options = options
        self._lay_out()
        self._table: npt.NDArray[np.signedinteger] | None = None
        self._ready = self._fine = False
        self._found: tuple[int, tuple[int, ...]] | None = None
        self.iterations = 0

    # ------------------------------------------------------------------ layout

    @staticmethod
    def fits(problem: RoutingProblem) -> bool:
        """Return whether every move to another site takes time and the experiments fit the bit sets."""
        if len(problem.experiments) > 512 or not problem.experiments:
            return False
        groups, _ = _grouped(problem)
        if sum(1 << len(g) for g in groups) > 20_000:
            return False
        return _shortest_move(problem, groups) * 20_000 >= max(1, problem.time_budget)

    def _lay_out(self) -> None:
        p = self._problem
        groups, sites = _grouped(p)
        self._order = np.array([x for g in groups for x in g], dtype=np.int64)
        self._rank = np.empty(len(self._order), dtype=np.int64)
        self._rank[self._order] = np.arange(len(self._order))
        sizes = np.array([len(g) for g in groups], dtype=np.int64)
        self._first = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        self._base = np.concatenate([[0], np.cumsum(1 << sizes)[:-1]]).astype(np.int64)
        self._states = int((1 << sizes).sum())
        site = np.array(sites, dtype=np.int64)
        self._site = site
        self._road_s = _no_self(p.travel_time)[np.ix_(site, site)].astype(np.int64)
        self._road_j = _no_self(p.travel_energy)[np.ix_(site, site)].astype(np.int64)
        a = p.arrays
        o = self._order
        self._value, self._duration, self._energy = a.prize[o], a.duration[o], a.energy[o]
        self._opens, self._latest = a.earliest_start[o], a.latest_end[o]
        self._e_budget = 0 if p.energy_budget is None else p.energy_budget
        if p.energy_budget is None:
            self._road_j = np.zeros_like(self._road_j)
            self._energy = np.zeros_like(self._energy)
        self._open_end = p.end_site is None
        if p.end_site is None:
            self._end_s = self._end_j = np.zeros(len(site), dtype=np.int64)
        else:
            self._end_s = _no_self(p.travel_time)[site, p.end_site].astype(np.int64)
            self._end_j = _no_self(p.travel_energy)[site, p.end_site].astype(np.int64)
            if p.energy_budget is None:
                self._end_j = np.zeros_like(self._end_j)
        x = len(o)
        self._words = (x + 63) // 64
        needs = np.zeros((x, self._words), dtype=np.uint64)
        self._links = []
        for before, after in p.precedence:
            b, c = int(self._rank[before]), int(self._rank[after])
            needs[c, b >> 6] |= np.uint64(1) << np.uint64(b & 63)
            self._links.append((b, c))
        self._needs = needs
        self._amounts = np.array([l.amounts for l in p.limits], dtype=np.int64).reshape(len(p.limits), x)[
            :, o
        ]
        self._capacity = np.array([l.capacity for l in p.limits], dtype=np.int64)
        must = np.array([p.experiments[i].must_do for i in o.tolist()], dtype=bool)
        self._quickest_s = _closure(self._road_s)
        self._bonus = int(self._value.sum()) + 1
        self._worth = self._value + np.where(must, self._bonus, 0)
        self._must = must
        self._groups = groups

    def _grid(self, cells: int) -> tuple[int, int, int, int]:
        """Return time step, time buckets, energy step and energy buckets for a table of about `cells`."""
        horizon = max(1, self._problem.time_budget)
        each = max(64.0, cells / self._states)
        if cells <= self._options.coarse_cells:
            each = min(each, float(self._options.coarse_state))
        if self._problem.energy_budget is None:
            width, tall = 1, min(each, 1024.0 if cells > self._options.coarse_cells else 256.0)
        else:
            width = int(min(self._e_budget + 1, max(8.0, math.sqrt(each))))
            tall = each / width
        step = max(1, math.ceil(horizon / max(16.0, tall)))
        step = min(step, max(1, _shortest_move(self._problem, self._groups)))
        if width > 1:
            width = int(max(4.0, min(width, each * step / horizon)))
        e_step = max(1, math.ceil((self._e_budget + 1) / width))
        return step, horizon // step + 1, e_step, self._e_budget // e_step + 1

    # ------------------------------------------------------------------ table

    def _fill(self, cells: int) -> None:
        step, buckets, e_step, width = self._grid(cells)
        # How often a relaxed walk can change groups decides which integers hold its sums.
        moves = self._problem.time_budget // max(1, _shortest_move(self._problem, self._groups)) + 2
        largest = int(np.abs(self._gain).max()) * moves * _GROUP
        kind = np.int32 if largest < -NEVER else np.int64
        shape = (self._states, buckets, width)
        if self._table is None or self._table.shape != shape or self._table.dtype != kind:
            self._table = np.empty(shape, dtype=kind)
        self._step, self._e_step = step, e_step
        fill_table(
            self._table,
            self._road_s,
            self._road_j,
            self._first,
            self._base,
            self._gain.astype(kind),
            self._duration,
            self._energy,
            self._opens,
            self._latest,
            self._open_end,
            self._end_s,
            self._end_j,
            0,
            step,
            self._problem.time_budget,
            e_step,
            self._e_budget,
        )

    def _root_value(self, root: _Root) -> int:
        assert self._table is not None
        k, j = root.time // self._step, root.fuel // self._e_step
        if k >= self._table.shape[1] or j >= self._table.shape[2]:
            return NEVER
        return int(self._table[self._base[root.group] + root.mask, k, j])

    def prepare(self, seconds: float = math.inf) -> None:
        """Build the table: multipliers on coarse tables first, then the fine one.

        The start site, start time and energy of the problem steer the multipliers only; the table answers
        for any.
        """
        started = time.perf_counter()
        opt = self._options
        self._scale = max(1, min(64, 2**24 // max(1, int(self._worth.max()) * 64)))
        x = len(self._worth)
        once = np.zeros(x)
        order = np.zeros(len(self._links))
        sides = np.zeros(len(self._capacity))
        self._set_gain(once, order, sides)
        root = self._root(self._problem)
        best_bound, best = math.inf, (once, order, sides)
        self._fill(opt.coarse_cells)
        incumbent, route, _ = self._pass(root, 30, -1, started + seconds)
        pace, quiet = 1.0, 0
        for r in range(opt.rounds):
            if r:
                self._set_gain(once, order, sides)
                self._fill(opt.coarse_cells)
            value = self._root_value(root)
            if value <= NEVER // 2:
                break
            if r in _LOOKS:
                better, found, _ = self._pass(root, 150, incumbent, started + seconds)
                if better > incumbent:
                    incumbent, route = better, found
            bound = (self._offset + value + root.worth_of(self._gain, self._worth * self._scale, self._once)) / self._scale
            if bound < best_bound - 1e-9:
                best_bound, best, quiet = bound, (once.copy(), order.copy(), sides.copy()), 0
            else:
                quiet += 1
                if quiet >= 3:
                    pace, quiet = pace / 2, 0
            if bound - max(incumbent, 0) < 1.0 or time.perf_counter() - started > seconds:
                break
            counts = self._trace(root)
            counts = counts + root.done
            g_once = 1.0 - counts
            g_order = np.array([counts[a] - counts[b] for a, b in self._links], dtype=float)
            g_sides = (self._capacity - self._amounts @ counts).astype(float)
            g_sides /= np.maximum(1, self._capacity)
            free = np.concatenate(
                [
                    np.where((g_once > 0) & (once <= 0), 0, g_once),
                    np.where((g_order > 0) & (order <= 0), 0, g_order),
                    np.where((g_sides > 0) & (sides <= 0), 0, g_sides),
                ]
            )
            norm = float(free @ free)
            if norm == 0:
                break
            length = pace * max(bound - max(incumbent, 0), 0.5) / norm
            once = np.maximum(0.0, once - length * g_once)
            order = np.maximum(0.0, order - length * g_order)
            sides = np.maximum(0.0, sides - length * g_sides / np.maximum(1, self._capacity))
        self._set_gain(*best)
        self._fill(opt.coarse_cells)
        self._fine = False
        self._ready = True
        self._found = (incumbent, route) if incumbent > 0 else None

    def _set_gain(
        self, once: npt.NDArray[np.float64], order: npt.NDArray[np.float64], sides: npt.NDArray[np.float64]
    ) -> None:
        scale = self._scale
        lam = np.rint(once * scale).astype(np.int64)
        mu = np.rint(order * scale).astype(np.int64)
        nu = np.rint(sides * scale).astype(np.int64)
        gain = self._worth * scale - lam
        for m, (a, b) in zip(mu.tolist(), self._links, strict=True):
            gain[a] += m
            gain[b] -= m
        self._offset = int(lam.sum())
        for k in range(len(nu)):
            gain -= nu[k] * self._amounts[k]
            self._offset += int(nu[k] * self._capacity[k])
        self._gain: IntArray = gain
        self._once: IntArray = lam

    def _trace(self, root: _Root) -> npt.NDArray[np.int64]:
        assert self._table is not None
        return trace_table(
            self._table,
            self._road_s,
            self._road_j,
            self._first,
            self._base,
            self._gain.astype(self._table.dtype),
            self._duration,
            self._energy,
            self._opens,
            self._latest,
            0,
            self._step,
            self._problem.time_budget,
            self._e_step,
            self._e_budget,
            root.group,
            root.mask,
            root.time // self._step,
            root.fuel // self._e_step,
        )

    # ------------------------------------------------------------------ search

    def _root(self, p: RoutingProblem) -> _Root:
        if len(p.experiments) != len(self._order) or p.start_site not in self._site:
            raise RoutingError(
                f"start_site is {p.start_site}; the table knows the first start and sites with experiments"
            )
        group = int(np.nonzero(self._site == p.start_site)[0][0])
        done = np.zeros(len(self._order), dtype=np.int64)
        for i in p.done:
            done[self._rank[i]] = 1
        mask = 0
        for x in range(self._first[group], self._first[group + 1]):
            if done[x]:
                mask |= 1 << int(x - self._first[group])
        fuel = p.energy_used if p.energy_budget is not None else 0
        # What can no longer be reached in time needs no multiplier: it cannot be done even once.
        sizes = np.diff(self._first)
        reach = p.start_time + np.repeat(self._quickest_s[group], sizes)
        late = (np.maximum(reach, self._opens) + self._duration > self._latest) & (done == 0)
        return _Root(group, mask, p.start_time, fuel, done, late.astype(np.int64))

    def solve(
        self,
        problem: RoutingProblem | None = None,
        *,
        time_limit_s: float = math.inf,
        iterations: int | None = None,
        hint: tuple[int, ...] = (),
        seed: int = 0,
    ) -> RoutingSolution:
        """Return the best route with its bound.

        Parameters
        ----------
        problem
            A variant of the solver's problem: other `start_site`, `start_time`, `energy_used` or `done`,
            all else the same. `None`: the problem itself.
        time_limit_s, iterations
            Limits in wall seconds and in labels made; both are looked at between levels.
        hint
            A feasible route to start from.
        """
        started = time.perf_counter()
        deadline = started + time_limit_s
        p = self._problem if problem is None else problem
        if not self._ready:
            self.prepare(0.35 * time_limit_s)
        root = self._root(p)
        made_before = self.iterations
        start_ok = p.start_time <= p.time_budget and (
            p.energy_budget is None or p.energy_used <= p.energy_budget
        )
        if not self._open_end:
            g = root.group
            start_ok = start_ok and bool(
                self._end_s[g] >= 0
                and p.start_time + self._end_s[g] <= p.time_budget
                and root.fuel + self._end_j[g] <= self._e_budget
            )
        if not start_ok:
            # Driving straight to the end is not possible. A route over experiments could still be, on roads
            # without the triangle inequality; the search below decides.
            best = -1
        else:
            best = 0
        route: tuple[int, ...] = ()
        if problem is None and self._found is not None:
            best, route = self._found
        if hint:
            rank = self._rank[list(hint)]
            if int(self._worth[rank].sum()) > best:
                best, route = int(self._worth[rank].sum()), tuple(rank.tolist())
        left = self._root_value(root)
        floor = best
        upper = best
        proven = left <= NEVER // 2
        if not proven:
            bound = (self._offset + left + root.worth_of(self._gain, self._worth * self._scale, self._once)) // self._scale
            upper = max(best, bound)
            budget = math.inf if iterations is None else made_before + iterations
            for width in _WIDTHS:
                if upper <= best:
                    proven = True
                    break
                if not self._fine and width > 1500:
                    self._fill(self._options.cells)
                    self._fine = True
                value, found, dropped = self._pass(
                    root, min(width, self._options.labels), best, deadline, budget
                )
                if value > best:
                    best, route = value, found
                upper = min(upper, max(best, dropped))
                if dropped <= best:
                    proven = True
                    break
                if time.perf_counter() > deadline or self.iterations >= budget:
                    break
        wall = time.perf_counter() - started
        solution = self._answer(p, best, route, upper, proven, seed, wall, floor)
        return checked(p, replace(solution, iterations=self.iterations - made_before))

    def _answer(
        self,
        p: RoutingProblem,
        best: int,
        route: tuple[int, ...],
        upper: int,
        proven: bool,
        seed: int,
        wall: float,
        floor: int,
    ) -> RoutingSolution:
        done = np.zeros(len(self._order), dtype=bool)
        for i in p.done:
            done[self._rank[i]] = True
        wanted = int((self._must & ~done).sum())
        held = int(self._must[list(route)].sum()) if route else 0
        if best < 0 or held < wanted:
            # With every missing must-do worth more than all prizes, a bound below the full bonus is a proof.
            impossible = proven or upper < wanted * self._bonus
            return RoutingSolution(None, None, impossible, (), ENGINE, seed, wall)
        cut = wanted * self._bonus
        return RoutingSolution(
            best - cut + p.base_prize,
            upper - cut + p.base_prize,
            proven,
            tuple(int(self._order[x]) for x in route),
            ENGINE,
            seed,
            wall,
        )

    def _pass(
        self, root: _Root, width: int, incumbent: int, deadline: float, budget: float = math.inf
    ) -> tuple[int, tuple[int, ...], int]:
        """Return best value, its route (ranks) and the largest bound among labels dropped for width or time.

        The value is the incumbent and the route empty when nothing better is found; the dropped bound is -1
        when every label was looked at.
        """
        assert self._table is not None
        sets = np.zeros((1, self._words), dtype=np.uint64)
        for x in np.nonzero(root.done)[0].tolist():
            sets[0, x >> 6] |= np.uint64(1) << np.uint64(x & 63)
        level = _Level(
            sets,
            np.array([root.group]),
            np.array([root.time]),
            np.array([root.fuel]),
            np.array([root.worth_of(self._gain, self._worth * self._scale, self._once)]),
            np.array([0]),
            np.array([2**60]),
        )
        trail: list[tuple[IntArray, IntArray]] = []
        best, best_level, best_at = incumbent, -1, -1
        dropped = -1
        while level.count:
            room = min(self._options.labels, max(4096, 24 * level.count))
            while True:
                fresh, what, parent, best_now, at = self._expand(level, room, best)
                if fresh is not None or room >= self._options.labels:
                    break
                room = min(self._options.labels, room * 4)
            if fresh is None:
                return (
                    best,
                    self._follow(trail, best_level, best_at),
                    max(dropped, int(level.bound.max()) // self._scale),
                )
            self.iterations += fresh.count
            if at >= 0:
                best, best_level, best_at = best_now, len(trail), at
            alive = np.nonzero(fresh.bound // self._scale > best)[0]
            if alive.size > width:
                rank = np.lexsort((fresh.fuel[alive], fresh.time[alive], -fresh.bound[alive]))
                dropped = max(dropped, int(fresh.bound[alive[rank[width]]]) // self._scale)
                alive = np.sort(alive[rank[:width]])
            if at >= 0 and at not in alive:
                trail.append((np.append(parent[alive], parent[at]), np.append(what[alive], what[at])))
                best_at = alive.size
            else:
                trail.append((parent[alive], what[alive]))
                if at >= 0:
                    best_at = int(np.searchsorted(alive, at))
            level = fresh.taken(alive)
            if level.count and (time.perf_counter() > deadline or self.iterations >= budget):
                dropped = max(dropped, int(level.bound.max()) // self._scale)
                break
        return best, self._follow(trail, best_level, best_at), dropped

    @staticmethod
    def _follow(trail: list[tuple[IntArray, IntArray]], level: int, at: int) -> tuple[int, ...]:
        route = []
        while level >= 0:
            parent, what = trail[level]
            route.append(int(what[at]))
            at = int(parent[at])
            level -= 1
        return tuple(route[::-1])

    def _expand(
        self, level: _Level, room: int, incumbent: int
    ) -> tuple[_Level | None, IntArray, IntArray, int, int]:
        assert self._table is not None
        fresh = _Level.empty(room, self._words)
        parent = np.empty(room, dtype=np.int64)
        what = np.empty(room, dtype=np.int64)
        chain = np.empty(room, dtype=np.int64)
        heads = np.empty(1 << max(8, (room - 1).bit_length()), dtype=np.int64)
        made, best, at = expand(
            level.count,
            *level.columns(),
            *fresh.columns(),
            parent,
            what,
            chain,
            heads,
            self._table,
            self._road_s,
            self._road_j,
            self._first,
            self._base,
            self._gain,
            self._worth,
            self._duration,
            self._energy,
            self._opens,
            self._latest,
            self._needs,
            self._open_end,
            self._end_s,
            self._end_j,
            0,
            self._step,
            self._problem.time_budget,
            self._e_step,
            self._e_budget,
            self._amounts,
            self._capacity,
            self._offset,
            self._scale,
            incumbent,
        )
        if made < 0:
            return None, what, parent, incumbent, -1
        return fresh.taken(slice(0, made)), what[:made], parent[:made], int(best), int(at)


@dataclass(frozen=True, slots=True, eq=False)
class _Root:
    group: int
    mask: int
    time: int
    fuel: int
    done: IntArray
    late: IntArray

    def worth_of(self, gain: IntArray, worth: IntArray, once: IntArray) -> int:
        """Return the scaled worth with which the first label starts.

        That is what the multipliers add to or take from what is already done (its prize was earned before
        and counts no more), less the "at most once" multipliers of what is out of reach.
        """
        return int(((gain - worth) * self.done).sum() - (once * self.late).sum())


@dataclass(frozen=True, slots=True, eq=False)
class _Level:
    sets: npt.NDArray[np.uint64]
    place: IntArray
    time: IntArray
    fuel: IntArray
    worth: IntArray
    prize: IntArray
    bound: IntArray

    @staticmethod
    def empty(room: int, words: int) -> _Level:
        return _Level(
            np.empty((room, words), dtype=np.uint64), *(np.empty(room, dtype=np.int64) for _ in range(6))
        )

    @property
    def count(self) -> int:
        return len(self.place)

    def columns(self) -> tuple[npt.NDArray[np.integer], ...]:
        return self.sets, self.place, self.time, self.fuel, self.worth, self.prize, self.bound

    def taken(self, index: IntArray | slice) -> _Level:
        return _Level(*(np.ascontiguousarray(c[index]) for c in self.columns()))


def _closure(roads: IntArray) -> npt.NDArray[np.float64]:
    """Return the least time between groups over any number of roads; infinite where there is no way."""
    cost = np.where(roads < 0, np.inf, roads.astype(np.float64))
    for k in range(len(cost)):
        cost = np.minimum(cost, cost[:, k, None] + cost[None, k, :])
    return cost


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
