"""Exact goal selection: label setting with a table of optimistic completions as bound.

1. `relaxation` holds the most that can still be earned from (group, experiments done there, time, energy).
   With it, a partial route's bound is one sum and one look-up.
2. Labels are extended level by level (number of experiments done), thinned by dominance in time and energy
   and by the bound. Passes of growing width give good routes early; a pass in which nothing had to be
   dropped for width is the proof.

The table depends only on roads, experiments and budgets. Another start, time, energy left or set of
experiments done is answered from the same table: `ExactSolver.solve`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from planner.orienteering.check import checked
from planner.orienteering.label_kernels import NEVER, expand
from planner.orienteering.layout import Layout, Root
from planner.orienteering.problem import IntArray, RoutingProblem, RoutingSolution
from planner.orienteering.relaxation import Multipliers, Relaxation, Slack, slack_of
from planner.tally import Step, Tally, affordable, now_s, spend, tallied

ENGINE = "exact"

_RECENTRE = (2, 5, 9)  # rounds after which the multipliers of energy are set round the best of them
_LOOKS = (4, 10)  # rounds after which a narrow pass looks for a better route
_WIDTHS = (30, 150, 1500, 40_000, 1_500_000)
_EASY = 1500  # width of the last pass before the midday table is made

_MIDDAY = 0.5  # share of the budgets that is spent where the multipliers of the search's table are set
_MIDDAY_BUCKETS = 80  # of time, in the tables for these rounds
_MIDDAY_ROUNDS = 10
_MIDDAY_RECENTRE = (0, 3, 8)
_MIDDAY_PACE = 0.15  # share of the gap that a step is after
_MEMORY = 0.7  # weight of the earlier steps in the next one: without it they undo each other


@dataclass(frozen=True, slots=True)
class ExactOptions:
    """Sizes of the tables and the number of multiplier rounds.

    `cells` and `coarse_cells` are limits for (states x time x lanes) of the fine table and of those made
    for the multipliers, `buckets` and `coarse_buckets` the time buckets aimed at; the search tries the coarse
    table first and makes the fine one when a pass of 1500 labels a level was not proof.
    `labels` is the most that one level may hold.
    """

    cells: int = 10_000_000
    coarse_cells: int = 1_000_000
    buckets: int = 400
    coarse_buckets: int = 130
    rounds: int = 12
    labels: int = 3_000_000


class ExactSolver:
    """The exact engine for one problem; keeps its table between calls.

    Use `ExactSolver.fits` first: problems whose moves can take no time, or with too many experiments, are
    not for it.
    """

    def __init__(self, problem: RoutingProblem, options: ExactOptions = ExactOptions()) -> None:
        self._problem = problem
        self._options = options
        self._layout = Layout(problem)
        self._relaxed = Relaxation(self._layout)
        self._noon: Relaxation | None = None
        self._ready = False
        self._found: tuple[int, tuple[int, ...]] | None = None
        self.iterations = 0

    @staticmethod
    def fits(problem: RoutingProblem) -> bool:
        """Return whether every move to another site takes time and the experiments fit the bit sets."""
        return Layout.fits(problem)

    # ------------------------------------------------------------------ table

    def _buckets(self, *, fine: bool) -> int:
        opt = self._options
        cells, buckets = (opt.cells, opt.buckets) if fine else (opt.coarse_cells, opt.coarse_buckets)
        lanes = len(self._relaxed.price)
        if lanes == 1:  # without energy, all cells are for time
            buckets *= 2
        return min(buckets, cells // (self._layout.states * lanes))

    def _midday(self) -> Relaxation:
        """Return the relaxation for wide passes: multipliers set for a start at noon, with a fine table.

        Most labels of a wide pass stand in the middle of the day. Multipliers that are best at noon make the
        bound at the root a little worse and that of these labels much better: at 30 sites a third of the
        labels is left, also for other starts, times and energies.
        """
        if self._noon is not None:
            return self._noon
        p, lay, relaxed = self._problem, self._layout, self._relaxed.twin()
        root = lay.root(p)
        root = replace(
            root,
            time=root.time + int(_MIDDAY * (p.time_budget - root.time)),
            fuel=root.fuel + int(_MIDDAY * (lay.e_budget - root.fuel)),
        )
        _, lane = self._relaxed.completion(root)
        target = 0.0 if self._found is None else (1.0 - _MIDDAY) * self._found[0]
        best_bound, best = math.inf, relaxed.multipliers
        way: Slack | None = None
        for r in range(_MIDDAY_ROUNDS):
            if r in _MIDDAY_RECENTRE:
                relaxed.recentre(lane)
            relaxed.fill(min(_MIDDAY_BUCKETS, self._buckets(fine=False)), root.time)
            value, lane = relaxed.completion(root)
            if value <= NEVER // 2:
                break
            bound = (relaxed.offset + value + relaxed.start(root)) / relaxed.scale
            if bound < best_bound:
                best_bound, best = bound, relaxed.multipliers
            slack = slack_of(lay, relaxed.walk(root, lane))
            way = slack if way is None else slack.plus(way, _MEMORY)
            step = relaxed.multipliers.stepped(lay, way, _MIDDAY_PACE * max(bound - target, 0.5))
            if step is not None:
                relaxed.set(step)
        relaxed.set(best)
        relaxed.fill(self._buckets(fine=True))
        self._noon = relaxed
        return relaxed

    def cost_s(self) -> float:
        """Return what one coarse table takes, in seconds of a processor as they are reckoned."""
        return self._relaxed.cost_s(self._buckets(fine=False))

    def _midday_cost_s(self) -> float:
        if self._noon is not None:
            return 0.0
        coarse = self._relaxed.cost_s(min(_MIDDAY_BUCKETS, self._buckets(fine=False)))
        return _MIDDAY_ROUNDS * coarse + self._relaxed.cost_s(self._buckets(fine=True))

    def prepare(self, seconds: float = math.inf) -> None:
        """Build the table: multipliers on coarse tables first, then the fine one when the search needs it.

        The start site, start time and energy of the problem steer the multipliers only; the table answers
        for any. `seconds` are those of a processor, as `planner.tally` reckons them.
        """
        with tallied() as tally:
            self._prepare(tally, tally.seconds + seconds)

    def _prepare(self, tally: Tally, until: float) -> None:
        lay, relaxed = self._layout, self._relaxed
        now = Multipliers.none(lay)
        relaxed.set(now)
        root = lay.root(self._problem)
        best_bound, best = math.inf, now
        relaxed.fill(self._buckets(fine=False))
        incumbent, route, _ = self._pass(relaxed, root, 30, -1, until)
        pace, quiet, lane = 1.0, 0, 0
        for r in range(self._options.rounds):
            if r:
                if r in _RECENTRE:
                    relaxed.recentre(lane)
                relaxed.set(now)
                relaxed.fill(self._buckets(fine=False))
            value, lane = relaxed.completion(root)
            if value <= NEVER // 2:
                break
            if r in _LOOKS:
                better, found, _ = self._pass(relaxed, root, 150, incumbent, until)
                if better > incumbent:
                    incumbent, route = better, found
            bound = (relaxed.offset + value + relaxed.start(root)) / relaxed.scale
            if bound < best_bound - 1e-9:
                best_bound, best, quiet = bound, now, 0
            else:
                quiet += 1
                if quiet >= 3:
                    pace, quiet = pace / 2, 0
            if bound - max(incumbent, 0) < 1.0 or tally.seconds + 2.0 * self.cost_s() > until:
                break
            slack = slack_of(lay, relaxed.walk(root, lane))
            step = now.stepped(lay, slack, pace * max(bound - max(incumbent, 0), 0.5))
            if step is None and r >= max(_RECENTRE):
                break
            now = now if step is None else step
        relaxed.set(best)
        relaxed.fill(self._buckets(fine=False))
        self._ready = True
        self._found = (incumbent, route) if incumbent > 0 else None

    # ------------------------------------------------------------------ search

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
            Limits in seconds of a processor, as `planner.tally` reckons them, and in labels made; both are
            looked at between levels.
        hint
            A feasible route to start from.
        """
        with tallied() as tally:
            deadline = tally.seconds + time_limit_s
            return self._solve(problem, time_limit_s, deadline, iterations, hint, seed, tally)

    def _solve(
        self,
        problem: RoutingProblem | None,
        time_limit_s: float,
        deadline: float,
        iterations: int | None,
        hint: tuple[int, ...],
        seed: int,
        tally: Tally,
    ) -> RoutingSolution:
        p = self._problem if problem is None else problem
        if not self._ready:
            self.prepare(0.35 * time_limit_s)
        root = self._layout.root(p)
        made_before = self.iterations
        if not self._layout.direct_end(root):
            # Driving straight to the end is not possible. A route over experiments could still be, on roads
            # without the triangle inequality; the search below decides.
            best = -1
        else:
            best = 0
        route: tuple[int, ...] = ()
        if problem is None and self._found is not None:
            best, route = self._found
        if hint:
            rank = self._layout.rank[list(hint)]
            worth = int(self._layout.worth[rank].sum())
            if worth > best:
                best, route = worth, tuple(rank.tolist())
        left, _ = self._relaxed.completion(root)
        upper = best
        proven = left <= NEVER // 2
        if not proven:
            bound = (self._relaxed.offset + left + self._relaxed.start(root)) // self._relaxed.scale
            upper = max(best, bound)
            budget = math.inf if iterations is None else made_before + iterations
            relaxed = self._relaxed if self._noon is None else self._noon
            for width in _WIDTHS:
                if upper <= best:
                    proven = True
                    break
                if width > _EASY:
                    if tally.seconds + self._midday_cost_s() > deadline:
                        break
                    relaxed = self._midday()
                paid = affordable(Step.WIDE, deadline - tally.seconds) // _open_to(root)
                value, found, dropped = self._pass(
                    relaxed, root, max(30, min(width, self._options.labels, paid)), best, deadline, budget
                )
                if value > best:
                    best, route = value, found
                upper = min(upper, max(best, dropped))
                if dropped <= best:
                    proven = True
                    break
                if tally.seconds > deadline or self.iterations >= budget:
                    break
        solution = self._answer(p, best, route, upper, proven, seed)
        return checked(p, replace(solution, iterations=self.iterations - made_before))

    def _answer(
        self,
        p: RoutingProblem,
        best: int,
        route: tuple[int, ...],
        upper: int,
        proven: bool,
        seed: int,
    ) -> RoutingSolution:
        lay = self._layout
        done = np.zeros(len(lay.order), dtype=bool)
        for i in p.done:
            done[lay.rank[i]] = True
        wanted = int((lay.must & ~done).sum())
        held = int(lay.must[list(route)].sum()) if route else 0
        if best < 0 or held < wanted:
            # With every missing must-do worth more than all prizes, a bound below the full bonus is a proof.
            impossible = proven or upper < wanted * lay.bonus
            return RoutingSolution(None, None, impossible, (), ENGINE, seed)
        cut = wanted * lay.bonus
        return RoutingSolution(
            best - cut + p.base_prize,
            upper - cut + p.base_prize,
            proven,
            tuple(int(lay.order[x]) for x in route),
            ENGINE,
            seed,
        )

    def _pass(
        self,
        relaxed: Relaxation,
        root: Root,
        width: int,
        incumbent: int,
        deadline: float,
        budget: float = math.inf,
    ) -> tuple[int, tuple[int, ...], int]:
        """Return best value, its route (ranks) and the largest bound among labels dropped for width or time.

        The value is the incumbent and the route empty when nothing better is found; the dropped bound is -1
        when every label was looked at.
        """
        open_to = _open_to(root)
        sets = np.zeros((1, self._layout.words), dtype=np.uint64)
        for x in np.nonzero(root.done)[0].tolist():
            sets[0, x >> 6] |= np.uint64(1) << np.uint64(x & 63)
        level = _Level(
            sets,
            np.array([root.group]),
            np.array([root.time]),
            np.array([root.fuel]),
            np.array([relaxed.start(root)]),
            np.array([0]),
            np.array([2**60]),
        )
        _, lane = relaxed.completion(root)
        trail: list[tuple[IntArray, IntArray]] = []
        best, best_level, best_at = incumbent, -1, -1
        dropped = -1
        while level.count:
            room = min(self._options.labels, max(4096, 6 * level.count))
            while True:
                fresh, what, parent, best_now, at = self._expand(relaxed, level, room, best, lane)
                if fresh is not None or room >= self._options.labels:
                    break
                room = min(self._options.labels, room * 4)
            if fresh is None:
                return (
                    best,
                    self._follow(trail, best_level, best_at),
                    max(dropped, int(level.bound.max()) // relaxed.scale),
                )
            self.iterations += fresh.count
            spend(Step.WIDE, level.count * open_to)  # what was made already is passed over at once
            if at >= 0:
                best, best_level, best_at = best_now, len(trail), at
            alive = np.nonzero(fresh.bound // relaxed.scale > best)[0]
            if alive.size > width:
                rank = np.lexsort((fresh.fuel[alive], fresh.time[alive], -fresh.bound[alive]))
                dropped = max(dropped, int(fresh.bound[alive[rank[width]]]) // relaxed.scale)
                alive = np.sort(alive[rank[:width]])
            if at >= 0 and at not in alive:
                trail.append((np.append(parent[alive], parent[at]), np.append(what[alive], what[at])))
                best_at = alive.size
            else:
                trail.append((parent[alive], what[alive]))
                if at >= 0:
                    best_at = int(np.searchsorted(alive, at))
            level = fresh.taken(alive)
            if level.count and (now_s() > deadline or self.iterations >= budget):
                dropped = max(dropped, int(level.bound.max()) // relaxed.scale)
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
        self, relaxed: Relaxation, level: _Level, room: int, incumbent: int, lane: int
    ) -> tuple[_Level | None, IntArray, IntArray, int, int]:
        lay = self._layout
        fresh = _Level.empty(room, lay.words)
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
            relaxed.table,
            relaxed.probe(lane),
            lane,
            lay.road_s,
            lay.road_j,
            lay.first,
            lay.base,
            relaxed.gain,
            lay.worth,
            lay.duration,
            lay.energy,
            lay.opens,
            lay.latest,
            lay.needs,
            lay.open_end,
            lay.end_s,
            lay.end_j,
            lay.home_s,
            lay.home_j,
            relaxed.step,
            self._problem.time_budget,
            lay.e_budget,
            relaxed.price,
            relaxed.slack,
            lay.amounts,
            lay.capacity,
            relaxed.offset,
            relaxed.scale,
            incumbent,
        )
        if made < 0:
            return None, what, parent, incumbent, -1
        return fresh.taken(slice(0, made)), what[:made], parent[:made], int(best), int(at)


def _open_to(root: Root) -> int:
    """Return how many experiments a label may be made longer by, at least 1."""
    return max(1, int(np.count_nonzero(root.done + root.late == 0)))


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
