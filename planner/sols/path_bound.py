"""An upper bound for every policy over several sols: what the flow allows, and no chain of actions exceeds.

First the flow of `flow_program`, a linear program with cuts. It lets the rover drive in fractions, has no
windows, and spends in one future what another one saves. Then multipliers u >= 0 on its rows of times,
charges, entries and observations made once. Every policy satisfies those rows, so it earns no more than

    sum of u * limit  +  E[what its actions earn, less u times what they are in the rows],

and the second is not more than the best chain earns (`chains`), whatever u is. A chain sees what is left of
the resource that limits more, and where the rover stands; it forgets what was observed far away. The least
multipliers are sought by column generation: chains are columns of a small linear program, whose multipliers
make the next chain. The next multipliers lie between those and the best so far (Pessoa et al. 2018), and cuts
are added where the mixture of chains violates them. The search takes a coarse grid that behaves like the fine
one; the bound is worked out with its multipliers on the fine one.

An observation that waits for its window draws the hotel load meanwhile. With w joules of waiting and R left
it draws E[min(w + E, R)] = w + E[min(E, R - w)] >= (w + c) P(w + E <= R), c as in `flow_program`: so waits
are charged for where the observation succeeds, by chains that see the time. Overruns cost nothing here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from planner.contingency.linear_program import solved
from planner.evaluate.model import Floats
from planner.sols.chains import Along, Chains
from planner.sols.flow_program import FlowProgram, Row, RowKind
from planner.sols.path_problem import PathProblem
from planner.tally import now_s, tallied

ROUNDS = 60
"""Rounds of cuts; the bound of any round holds. By hand."""

TOLERANCE = 1e-6
"""Relative allowance for the solver's own tolerance of 1e-7 (HiGHS), and for tails and settled values."""

ENOUGH, STALLED = 1e-4, 3
"""Rounds in a row that lower the bound by less than this share, after which it is left. By hand."""

USED = 1e-9
"""Multiplier from which on a row is used."""

CLOSE = 1e-3
"""Share of the bound between chains and their mixture at which cuts are sought. By hand."""

SMOOTH = 0.8
"""Share of the best multipliers in the next ones. By hand."""

COLUMNS = 600
"""Most chains."""

COARSE_NODES, REMEMBERED = 81, 3
"""Nodes of the search, and observations that a place remembers. By hand."""

FINE_NODES = {Along.CHARGE: 801, Along.TIME: 301}
"""Nodes of the bound. By hand: rounding draws down costs the bound more than rounding times."""


@dataclass(frozen=True, slots=True, eq=False)
class PathBound:
    """No policy earns more than `value`."""

    value: float


class _Master:
    """Mixtures of chains within the rows: its multipliers make the next chain."""

    def __init__(self, flow: FlowProgram, multipliers: Floats) -> None:
        self.flow = flow
        used = [
            (row, value)
            for row, value in zip(flow.rows, multipliers, strict=True)
            if row.kind in (RowKind.TIME, RowKind.CHARGE, RowKind.ONCE)
            or (row.kind is RowKind.ENTRY and value > USED)
        ]
        self.rows: list[Row] = [row for row, _ in used]
        self.best = np.array([max(value, 0.0) for _, value in used])
        # what a multiplier may come to on the way: ten times what the whole limit could pay for
        scale = {RowKind.TIME: flow.path.time_s.max(), RowKind.CHARGE: flow.path.series.battery.capacity_j}
        dear = 10.0 * float(flow.worth.sum())
        self.most = np.array([dear / scale.get(row.kind, 1.0) for row in self.rows])
        self.columns = np.zeros((flow.count, 0))
        self.waited_j = np.zeros((flow.path.sols, 0))
        self._take_rows()

    def _take_rows(self) -> None:
        rows, count = self.rows, self.flow.count
        at = np.repeat(np.arange(len(rows)), [len(row.at) for row in rows])
        values, columns = (np.concatenate([getattr(row, n) for row in rows]) for n in ("values", "at"))
        self.matrix = sparse.csr_matrix((values, (at, columns)), shape=(len(rows), count))
        self.limits = np.array([row.limit for row in rows])
        charged = [i for i, row in enumerate(rows) if row.sol >= 0]
        sols = [rows[i].sol for i in charged]
        shape = (len(rows), self.flow.path.sols)
        self.drawn = sparse.csr_matrix((np.ones(len(sols)), (charged, sols)), shape=shape)

    def value(self, chains: Chains, multipliers: Floats) -> float:
        """Return what no policy earns more than, by the best chain for the multipliers."""
        flow = self.flow
        worth = -flow.cost - self.matrix.T @ multipliers
        charge = worth[flow.charge]
        least, most = flow.bounds[flow.charge].T
        value = float(self.limits @ multipliers + (charge * np.where(charge > 0.0, most, least)).sum())
        return value + chains.best(worth, flow.path.model.hotel_w * (self.drawn.T @ multipliers))

    def add(self, chains: Chains) -> None:
        """Add the last chain as a column."""
        found = chains.follow()
        self.columns = np.column_stack([self.columns, found.columns])
        waited_j = self.flow.path.model.hotel_w * found.waited_s
        self.waited_j = np.column_stack([self.waited_j, waited_j])

    def solve(self, limit_s: float) -> tuple[float, Floats, Floats] | None:
        """Return what the best mixture earns, its multipliers and its columns in the flow."""
        flow, count, size = self.flow, self.columns.shape[1], len(self.rows)
        uses = self.matrix @ self.columns + self.drawn @ self.waited_j
        cost = np.concatenate([flow.cost @ self.columns, np.zeros(len(flow.charge)), self.most])
        rows = sparse.bmat(
            [
                [sparse.csr_matrix(uses), self.matrix[:, flow.charge], -sparse.identity(size)],
                [np.ones((1, count)), None, None],
            ],
            format="csr",
        )
        bounds = np.tile([0.0, np.inf], (len(cost), 1))
        bounds[count : count + len(flow.charge)] = flow.bounds[flow.charge]
        answer = solved(cost, rows, np.append(self.limits, 1.0), bounds, limit_s)
        if answer.status != 0:
            return None
        multipliers = np.maximum(-answer.ineqlin.marginals[:-1], 0.0)
        return -float(answer.fun), multipliers, self.columns @ answer.x[:count]

    def cut(self, mixture: Floats) -> int:
        """Add the cuts that a mixture violates; return how many."""
        self.rows += (new := self.flow.violated(mixture))
        self.best = np.append(self.best, np.zeros(len(new)))
        self.most = np.append(self.most, np.full(len(new), 10.0 * float(self.flow.worth.sum())))
        self._take_rows()
        return len(new)


def _scarce(flow: FlowProgram, multipliers: Floats) -> Along:
    """Return what limits the rover more, by what the multipliers pay for: the charge, or the time."""
    paid = dict.fromkeys(RowKind, 0.0)
    for row, multiplier in zip(flow.rows, multipliers, strict=True):
        paid[row.kind] += multiplier * abs(row.limit)
    return Along.CHARGE if paid[RowKind.CHARGE] >= paid[RowKind.TIME] else Along.TIME


def _chain_bound(flow: FlowProgram, multipliers: Floats, best: float, limit_s: float) -> float:
    """Return the bound by chains, from multipliers of the flow's rows on.

    It is `best` where chains pay without end, or the limit does not pay for one on the fine grid.
    """
    if limit_s <= 0.0:
        return best
    along = _scarce(flow, multipliers)
    until = now_s() + limit_s
    fine = Chains(flow, along, nodes=FINE_NODES[along], remembered=REMEMBERED)
    coarse = Chains(flow, along, nodes=COARSE_NODES, remembered=REMEMBERED, like=FINE_NODES[along])
    until -= fine.seconds
    if now_s() >= until:
        return best
    master = _Master(flow, multipliers)
    tried, least, smooth, mixed = master.best, math.inf, SMOOTH, -math.inf
    for _ in range(COLUMNS):
        if now_s() >= until:
            break
        value = master.value(coarse, tried)
        if math.isinf(value):
            return best
        if value < least:
            least, master.best = value, tried
        master.add(coarse)
        answer = master.solve(max(until - now_s(), 0.0))
        if answer is None:
            break
        smooth = SMOOTH if answer[0] > mixed * (1.0 + USED) else 0.5 * smooth
        mixed, multipliers, mixture = answer
        if least - mixed < CLOSE * least:
            added = master.cut(mixture)
            if not added:
                break
            multipliers = np.append(multipliers, np.zeros(added))
        tried = smooth * master.best + (1.0 - smooth) * multipliers
    return master.value(fine, master.best) * (1.0 + TOLERANCE) + 1e-9


def path_bound(path: PathProblem, *, limit_s: float) -> PathBound:
    """Return what no policy earns more than over all sols; the sum of all utilities if there is no time.

    `limit_s` are seconds of a processor as `planner.tally` reckons them.
    """
    flow = FlowProgram(path)
    best = float(flow.worth[path.allowed.any(axis=0)].sum())
    if not len(flow.to) or not path.allowed.any():
        return PathBound(0.0)
    with tallied():
        until, idle, multipliers = now_s() + limit_s, 0, None
        for _ in range(ROUNDS):
            answer = flow.solve(max(until - now_s(), 0.0))
            if answer.status != 0:
                break
            multipliers = -answer.ineqlin.marginals
            value = -float(answer.fun) * (1.0 + TOLERANCE) + 1e-9
            idle = 0 if value < best * (1.0 - ENOUGH) else idle + 1
            best = min(best, value)
            if idle >= STALLED or now_s() >= until or not flow.cut(answer.x, answer.slack):
                best = min(best, _chain_bound(flow, multipliers, best, until - now_s()))
                break
    return PathBound(best)
