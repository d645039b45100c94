"""Upper bounds on what any policy whatever can earn."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from planner.contingency.flow_bound import flow_bound
from planner.contingency.linear_program import solved
from planner.contingency.policy import Live, LiveSets, Moves, Policy, TooLargeError
from planner.contingency.priced_bound import priced_bound
from planner.evaluate.grid import PASSES, Grid, Rounding, probability_below
from planner.evaluate.majorant import Majorant
from planner.evaluate.model import Model
from planner.tally import SECONDS, Step, now_s

GRIDS = tuple((nt, nt * 7 // 12) for nt in (25, 33, 49, 65, 97, 145, 193, 257, 385, 513, 769))
"""Nodes in time and energy of a table that rounds down."""

CLOSE_GRIDS = tuple((nt, nt * 7 // 6) for nt in dict.fromkeys(int(25 * 1.02**k) for k in range(94)))
"""Those of a table of functions above the value: drives scatter less in energy than in time, and each takes a
sixteenth more than the one before, so that little of a limit is left over."""

CLOSE_FROM_S, DOWN_SHARE = 1.0, 0.15
"""Limit from which both tables are made, and the share of it for the one that rounds down: it is closer where
amounts scatter little. It comes first, and what it leaves is for the other; where that is the finest there
is, the rest of the limit is for a finer one that rounds down. By hand."""

SCATTER = 1.0 / 48.0
"""Share of the day by which half of the drives scatter where functions above the value have the whole limit:
a cell of a middling table, over which they are smooth. By hand."""

TABLE_MB = 1200.0
"""Largest table of a bound, in single precision, MB. By hand: a worker is to stay well below 4 GB."""

LP_SHARE = 8.0
"""What the linear programs may use, of the limit for a table: they are for where none fits. By hand."""

LP_LIMIT_S = 2.8
"""Limit above which they get no more. By hand."""

LP_CELLS = 48
"""Cells of time in the program over start times: more are tighter and slower. By hand."""

MANY_OBSERVATIONS = 60
"""With more than so many a quarter of the cells is taken: the program must end in its time. By hand."""

LEAST_PRICED_S = 0.2
"""Limit from which the bound by multipliers is tried: less finds none worth having. By hand."""

BY_PLACE_FROM_S, SMALL_MEMORY_SHARE = 8.0, 0.08
"""Limit from which the bound with a memory of each place is made too, and what the one with a single small
memory has of it then: that one knows precedence, and energy is rounded less where amounts hardly scatter. By
hand."""

MARGIN = 2e-5
"""Relative allowance for single precision in the tables."""

SUMMED = 1e-12
"""Relative allowance for the rounding of chances that sum to 1."""

AGAIN_FROM, AGAIN_TO = 1.5, 2.0
"""How often a table looks at drives, and at places that they lead to, as values rise again. Counted on tables
of 4 and 6 targets."""

LATE = 2.0
"""A table that takes so much longer than reckoned (many ways back) is given up for the next coarser one."""

BY_TABLE = "dynamic programming, consumption rounded down"
ABOVE = "dynamic programming, piecewise linear above the value"


@dataclass(frozen=True, slots=True)
class Bound:
    """No policy earns more than `value`; `method` says how it was found, `nodes` on what grid."""

    value: float
    method: str
    nodes: tuple[int, int] | None = None


def trivial_bound(model: Model) -> Bound:
    """Return the sum of all expected utilities: what would be earned if nothing cost anything."""
    return Bound(float(np.sum(model.utility * model.p_success)), "sum of utilities")


def upper_bound(
    model: Model,
    *,
    limit_s: float,
) -> Bound:
    """Return the best bound that the limit allows: from a table of functions above the value, or of values
    with consumption rounded down on a fine grid.

    `limit_s` are seconds of a processor as `planner.tally` reckons them. It bounds every policy, also one
    that goes through places or comes back. Where no table fits, the best of these is taken: linear programs,
    `relaxed_bound` over start times, which knows windows, and `flow_bound` over expected drives, which knows
    where targets lie; `priced_bound`, a table on one resource that remembers what matters most; and for
    longer limits `ng_bound`, which remembers by place and leg.

    Where the kind of sol is hidden, the bound is that of a planner who is told it at the start: the mean over
    the kinds of the bounds of their own problems. Who is not told may do no more, so it holds for every
    policy, also one that learns the kind from its progress (information relaxation: Brown, Smith and Sun
    2010, without a penalty). Each kind has an equal share of the limit.
    """
    if len(model.sols.chance):
        return _told_the_kind(model, limit_s)
    best = trivial_bound(model)
    if model.t_max_s <= 0.0 or model.e_max_j <= 0.0 or best.value <= 0.0:
        return Bound(0.0, "nothing can be done")

    def relaxed() -> Bound:
        each_s = LP_SHARE / 2.0 * min(limit_s, LP_LIMIT_S)
        drives = flow_bound(model, limit_s=each_s)
        flow = Bound(drives, "linear relaxation over drives")
        over_starts = relaxed_bound(model, limit_s=each_s)
        found = [best, over_starts, flow]
        if limit_s >= LEAST_PRICED_S:
            share = 1.0 if limit_s < BY_PLACE_FROM_S else SMALL_MEMORY_SHARE
            priced = priced_bound(model, limit_s=share * limit_s)
            found.append(Bound(priced, "multipliers and a small memory"))
            if share < 1.0:
                # Half of all that planning imports, which a first plan and small problems never need.
                from planner.contingency.by_place.bound import ng_bound

                by_place = ng_bound(model, limit_s=(1.0 - share) * limit_s)
                found.append(Bound(by_place, "multipliers and a memory of each place"))
        return min(found, key=lambda bound: bound.value)

    if model.m > 20 or model.n > 20 or int(np.count_nonzero(model.trackable)) > 12:
        return relaxed()
    sets = LiveSets(model, (1 << model.m) - 1)
    start = [sets.initial(sum(1 << p for p in range(1, model.n + 1) if model.trackable[p]))]
    try:
        every = sets.all_from(start)
    except TooLargeError:
        return relaxed()
    drives = drives_of(model, every)
    down, above = rounded_down(model, drives), tables_above(model, drives)
    close = limit_s >= CLOSE_FROM_S
    spreads_s = model.leg[model.has_leg][:, 1]
    scattered = 2 * np.count_nonzero(spreads_s >= SCATTER * model.t_max_s) > len(spreads_s)
    first_s = 0.0 if close and scattered else limit_s * (DOWN_SHARE if close else 1.0)
    found = [_by_table(down, len(every), first_s)]
    if close:
        left_s = limit_s - down.taken_s(found[0])
        finest = _by_table(above, len(every), left_s)
        found.append(finest)
        if finest is None or finest.nodes == above.sizes[0]:
            found.append(_by_table(down, len(every), left_s - above.taken_s(finest)))
    tables = [bound for bound in found if bound is not None]
    return min([best, *tables], key=lambda bound: bound.value) if tables else relaxed()


def _told_the_kind(model: Model, limit_s: float) -> Bound:
    """Return the mean over the kinds of sols of the bounds where each is known."""
    kinds = model.by_kind
    each = [(chance, upper_bound(known, limit_s=limit_s / len(kinds))) for chance, known in kinds]
    methods = ", ".join(dict.fromkeys(bound.method for _, bound in each))
    value = math.fsum(chance * bound.value for chance, bound in each) * (1.0 + SUMMED)
    return Bound(value, f"kind of sol told at the start; {methods}")


@dataclass(frozen=True, slots=True)
class Tables:
    """Kinds of one table from the finest to the coarsest: nodes, what it takes, s, and its grid."""

    method: str
    sizes: tuple[tuple[int, int], ...]
    seconds: Callable[[int, int], float]
    grid: Callable[[int, int], Grid]

    def taken_s(self, found: Bound | None) -> float:
        """Return what a bound by such a table takes."""
        return 0.0 if found is None or found.nodes is None else self.seconds(*found.nodes)


@dataclass(frozen=True, slots=True)
class Drives:
    """Work of a table: drives, their groups to one place, ways in which groups end, and such ways of drives
    that fail; all about.
    """

    single: float
    groups: float
    lost: float
    failed: float

    def seconds(self, cells: int, drive_s: float) -> float:
        """Return what they take on a grid of so many nodes, where one drive alone takes `drive_s`."""
        passes = (self.lost + self.failed) * cells * SECONDS[Step.PASS]
        python = self.groups * SECONDS[Step.DRIVE] + self.lost * SECONDS[Step.LOST]
        return self.single * drive_s + passes + python


def drives_of(model: Model, every: list[Live]) -> Drives:
    """Return the work of a table of `Moves.ALL` on these live sets."""
    single = groups = lost = failed = 0.0
    fails = bool(model.fail[model.has_leg].any())
    for live in every:
        here = sum(1 for p in range(1, model.n + 1) if int(model.target_bits[p]) & live.bits)
        tracks = sum(1 for p in range(1, model.n + 1) if int(model.place_bits[p]) & live.bits)
        asked = here + model.n / 4.0  # places whose value rose; those that win nothing are looked at once
        drives = AGAIN_FROM * asked * model.n
        single += drives
        groups += AGAIN_TO * asked
        lost += AGAIN_TO * asked * 2.0**tracks
        failed += drives * 2.0 ** max(0, tracks - 1) if fails else 0.0
    return Drives(single, groups, lost, failed)


def rounded_down(model: Model, drives: Drives) -> Tables:
    """Return the tables of values with consumption rounded down."""

    def seconds(nt: int, ng: int) -> float:
        each = nt * ng * ((nt + ng) * SECONDS[Step.CELL] + PASSES * SECONDS[Step.PASS])
        return drives.seconds(nt * ng, each)

    return Tables(BY_TABLE, GRIDS[::-1], seconds, partial(_grid_down, model))


def _grid_down(model: Model, nt: int, ng: int) -> Grid:
    return Grid(model, nt, ng, Rounding.DOWN, np.float32)


def tables_above(model: Model, drives: Drives) -> Tables:
    """Return the tables of functions above the value."""

    def seconds(nt: int, ng: int) -> float:
        grid = Majorant(model, nt, ng)
        return drives.seconds(nt * ng, grid.drive_s) + grid.once_s()

    return Tables(ABOVE, CLOSE_GRIDS[::-1], seconds, partial(Majorant, model))


def _by_table(kind: Tables, live_sets: int, limit_s: float) -> Bound | None:
    """Return the bound of the finest table that the limit allows; None where there is none."""
    for nt, ng in kind.sizes:
        grid = kind.grid(nt, ng)
        size_mb = live_sets * (grid.model.n + 1) * nt * ng * 4 / 1e6 + grid.kernels_mb
        if size_mb > TABLE_MB or kind.seconds(nt, ng) > limit_s:
            continue
        late = partial(_is_past, now_s() + LATE * limit_s)
        policy = Policy(grid, moves=Moves.ALL, should_stop=late)
        if policy.complete:
            return Bound(policy.best() * (1.0 + MARGIN) + 1e-9, kind.method, (nt, ng))
    return None


def _is_past(until_s: float) -> bool:
    return now_s() > until_s


def _within(ln: tuple[float, float], cells: int, step: float) -> np.ndarray[Any, Any]:
    """Return P(X <= j * step) for j = 0..cells."""
    edges = np.asarray(np.arange(cells + 1) * step, np.float64)
    return np.asarray(probability_below(edges, ln[0], ln[1]))


def relaxed_bound(model: Model, *, limit_s: float = math.inf) -> Bound:
    """Return a bound by linear programming over start times, for problems that no table holds.

    Variables are the chances that an observation, or a drive to a target, starts in a cell of time. A drive
    takes the stochastically shortest of the ways to its target, no track is lost and energy is free. Every
    policy satisfies: at each instant at most one action runs; an observation starts at most once, and not
    more often than the rover has arrived; what is begun fits in the downlink volume. Starts are rounded
    down to their cell, which only loosens these constraints.
    """
    model.require_one_kind("a bound over start times")
    cells = LP_CELLS if model.m <= MANY_OBSERVATIONS else LP_CELLS // 4
    step = model.t_max_s / cells
    cost: list[float] = []
    rows: list[np.ndarray[Any, Any]] = []
    cols: list[np.ndarray[Any, Any]] = []
    vals: list[np.ndarray[Any, Any]] = []
    column = 0
    drives: dict[int, list[tuple[int, int]]] = {}
    driven: dict[int, np.ndarray[Any, Any]] = {}
    arrivals: dict[int, list[int]] = {}
    wanted = [m for m in range(model.m) if model.utility[m] > 0.0]

    def put(row: np.ndarray[Any, Any], value: np.ndarray[Any, Any]) -> None:
        kept = np.abs(value) > 1e-12
        rows.append(row[kept])
        vals.append(value[kept])
        cols.append(np.full(int(kept.sum()), column))

    def occupy(within: np.ndarray[Any, Any], k: int) -> None:
        later = np.arange(k + 1, cells + 1)
        put(later, 1.0 - within[later - k])

    for place in sorted({int(model.obs_place[m]) for m in wanted}):
        legs = [a for a in range(model.n + 1) if model.has_leg[a, place]]
        if not legs:
            continue
        within = np.max([_within(tuple(model.leg_ln[a, place, :2]), cells, step) for a in legs], axis=0)
        driven[place] = within
        arrivals[place] = legs
        drives[place] = []
        for k in range(cells):
            drives[place].append((k, column))
            cost.append(0.0)
            occupy(within, k)
            column += 1
    row = cells + 1
    limits = [1.0] * row
    once: list[int] = []
    begun: list[tuple[int, int]] = []  # column and observation
    for m in wanted:
        place = int(model.obs_place[m])
        if place not in driven:
            continue
        worth = float(model.utility[m] * model.p_success[m])
        within = _within(tuple(model.obs_ln[m, :2]), cells, step)
        opens, closes = model.window[m]
        base = row
        for k in range(cells):
            if k * step > closes or (k + 1) * step < opens:
                continue
            cost.append(-worth * float(within[cells - k]))
            begun.append((column, m))
            occupy(within, k)
            put(np.arange(base + k, base + cells + 1), np.ones(cells + 1 - k))
            column += 1
        here = column
        for k, drive in drives[place]:
            reach = np.arange(k, cells)
            rows.append(base + reach)
            vals.append(-driven[place][reach + 1 - k])
            cols.append(np.full(len(reach), drive))
        column = here
        limits += [0.0] * cells + [float(model.chances.most[m])]
        once.append(base + cells)
        row = base + cells + 1
    if not once:
        return Bound(0.0, "nothing can be reached")
    for values, limit in model.chances.rows:
        rows.append(np.full(len(begun), row))
        cols.append(np.array([k for k, _ in begun]))
        vals.append(np.array([values[m] for _, m in begun]))
        limits.append(limit)
        row += 1
    from scipy import sparse  # 0.1 s that a first plan does not need

    matrix = sparse.csr_matrix(
        (np.concatenate(vals), (np.concatenate(rows), np.concatenate(cols))), shape=(row, column)
    )
    result = solved(np.array(cost), matrix, np.array(limits), (0, None), limit_s)
    if result.status != 0:
        return trivial_bound(model)
    return Bound(-float(result.fun) * (1.0 + 1e-6), "linear relaxation over start times")
