"""Upper bounds on what any policy whatever can earn."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import linprog

from planner.contingency.flow_bound import flow_bound
from planner.contingency.policy import LiveSets, Moves, Policy, TooLargeError
from planner.evaluate.grid import Grid, Rounding, probability_below
from planner.evaluate.model import Model

GRIDS = tuple((nt, nt * 7 // 12) for nt in (25, 33, 49, 65, 97, 145, 193, 257, 385, 513, 769))
"""Nodes in time and energy."""

TABLE_MB = 1200.0
"""Largest table of a bound, in single precision, MB. By hand: a worker is to stay well below 4 GB."""

MACS_PER_S = 1e10
"""Multiplications and additions a second that a table's cost is reckoned with, single precision. By hand."""

DRIVE_S = 1.5e-5
"""Seconds of overhead for each drive of a table. By hand."""

FIXED_S = 4.0
"""Processor seconds that a bound may cost where the answer must not depend on the machine. By hand."""

LP_LIMIT_S = 10.0
"""Seconds for one linear program. By hand."""

LP_CELLS = 48
"""Cells of time in the program over start times: more are tighter and slower. By hand."""

MANY_OBSERVATIONS = 60
"""With more than so many a quarter of the cells is taken: the program must end in its time. By hand."""

MARGIN = 2e-5
"""Relative allowance for single precision in the tables."""


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
    time_limit_s: float,
    wall_limit_s: float = math.inf,
    deterministic: bool = False,
    should_stop: Callable[[], bool] = lambda: False,
) -> Bound:
    """Return the best bound that the time allows: a table with consumption rounded down on a fine grid.

    `time_limit_s` are processor seconds; the linear programs keep to `wall_limit_s` by the clock as well.
    It bounds every policy, also one that goes through places or comes back. Where no table fits, the
    better of two linear programs is taken: `relaxed_bound` over start times, which knows windows, and
    `flow_bound` over expected drives, which knows where targets lie. With `deterministic` the grid depends on
    the problem alone.
    """
    best = trivial_bound(model)
    if model.t_max_s <= 0.0 or model.e_max_j <= 0.0 or best.value <= 0.0:
        return Bound(0.0, "nothing can be done")

    def relaxed() -> Bound:
        seconds = min(LP_LIMIT_S, max(0.1, 2.0 * time_limit_s))
        began = time.monotonic()
        drives = flow_bound(model, limit_s=seconds, wall_s=wall_limit_s, should_stop=should_stop)
        flow = Bound(drives, "linear relaxation over drives")
        left = max(seconds / 2.0, wall_limit_s - (time.monotonic() - began))
        over_starts = relaxed_bound(model, limit_s=min(LP_LIMIT_S, left))
        return min(best, over_starts, flow, key=lambda bound: bound.value)

    if model.m > 20 or model.n > 20 or int(np.count_nonzero(model.trackable)) > 12:
        return relaxed()
    sets = LiveSets(model, (1 << model.m) - 1)
    start = [sets.initial(sum(1 << p for p in range(1, model.n + 1) if model.trackable[p]))]
    try:
        every = sets.all_from(start)
    except TooLargeError:
        return relaxed()
    drives = 0
    for live in every:
        here = sum(1 for p in range(1, model.n + 1) if int(model.target_bits[p]) & live.bits)
        drives += (4 * here + model.n) * model.n // 4  # those that win nothing are looked at once
    allowed = min(time_limit_s, FIXED_S) if deterministic else time_limit_s
    chosen: tuple[int, int] | None = None
    for nt, ng in GRIDS:
        cost = drives * (nt * ng * (nt + ng) / MACS_PER_S + DRIVE_S)
        size_mb = len(every) * (model.n + 1) * nt * ng * 4 / 1e6
        if size_mb <= TABLE_MB and cost <= allowed:
            chosen = nt, ng
    if chosen is None:
        return relaxed()
    policy = Policy(Grid(model, *chosen, Rounding.DOWN, np.float32), moves=Moves.ALL, should_stop=should_stop)
    if not policy.complete:
        return relaxed()
    value = policy.best() * (1.0 + MARGIN) + 1e-9
    if value < best.value:
        best = Bound(value, "dynamic programming, consumption rounded down", chosen)
    return best


def _within(ln: tuple[float, float], cells: int, step: float) -> np.ndarray[Any, Any]:
    """Return P(X <= j * step) for j = 0..cells."""
    edges = np.asarray(np.arange(cells + 1) * step, np.float64)
    return np.asarray(probability_below(edges, ln[0], ln[1]))


def relaxed_bound(model: Model, *, limit_s: float = LP_LIMIT_S) -> Bound:
    """Return a bound by linear programming over start times, for problems that no table holds.

    Variables are the chances that an observation, or a drive to a target, starts in a cell of time. A drive
    takes the stochastically shortest of the ways to its target, no track is lost and energy is free. Every
    policy satisfies: at each instant at most one action runs; an observation starts at most once, and not
    more often than the rover has arrived; what is begun fits in the downlink volume. Starts are rounded
    down to their cell, which only loosens these constraints.
    """
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
    matrix = sparse.csr_matrix(
        (np.concatenate(vals), (np.concatenate(rows), np.concatenate(cols))), shape=(row, column)
    )
    result = linprog(
        np.array(cost),
        A_ub=matrix,
        b_ub=np.array(limits),
        bounds=(0, None),
        method="highs",
        options={"time_limit": limit_s},
    )
    if result.status != 0:
        return trivial_bound(model)
    return Bound(-float(result.fun) * (1.0 + 1e-6), "linear relaxation over start times")
