"""The linear relaxation of branch-and-cut: columns and rows that come and go, and bounds that are exact.

Clp, which OR-Tools carries, keeps its basis while rows, columns and bounds change. Its floating-point answer
is never believed: `Relaxation.bound` rounds the multipliers to integers and takes the largest value of the
Lagrangean over all edges and nodes, those without a column too, in integer arithmetic. So each bound holds
whatever the linear solver did, and the same sums find new columns and fix those that cannot matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from ortools.linear_solver import pywraplp

from planner.orienteering.cut_kernels import PLAIN, edge_profits
from planner.orienteering.cuts import FractionalTour, Row
from planner.tally import SECONDS, Step, spend

Array = npt.NDArray[Any]

_BITS = 44  # all prizes together are 2^44 units of a bound: 2^50 is the most of one multiplier, 2^63 of a sum
_LARGEST = 1 << 50
_UNUSED = 1e-9  # multiplier that counts as none
# What else Python does, in numbers handed to the solver; least squares over ten files of 52 to 262 nodes.
_ROW, _COLUMN = 34.0, 5.0  # of one new row or column, beside its coefficients
_LOOKED = 13.0  # of one row, when columns are added
_LATE = 22.0  # of one coefficient of a column in a row that Clp has already: its matrix is moved for each
_SOLVED, _BOUNDED = 4.0, 3.3  # of one row or node, when the program is solved and bounded
_PENALTY = 4.0  # of a row that cannot hold, in prizes of all nodes together


@dataclass(frozen=True, slots=True, eq=False)
class Tours:
    """Tours through node 0 that are to be found: prizes (n,), lengths (n, n), both integers, and the budget.

    `home` (n,) is the least length from a node to the depot by way of any others. With `joined`, the last
    node is where the tour ends, and the edge of no length from it to node 0 is always used.
    """

    prize: Array
    length: Array
    home: Array
    budget: int
    joined: bool

    @property
    def nodes(self) -> int:
        """Number of nodes, the depot among them."""
        return len(self.prize)


@dataclass(slots=True, eq=False)
class Box:
    """What the variables may be: flags for alive edges (m,) and visits (n,), and rows that only hold here."""

    x_low: Array
    x_high: Array
    y_low: Array
    y_high: Array
    local: tuple[Row, ...] = ()

    @property
    def empty(self) -> bool:
        """Whether no tour is in it: something must be and may not be."""
        return bool((self.x_low > self.x_high).any() or (self.y_low > self.y_high).any())

    def copy(self) -> Box:
        """Return a box of its own."""
        return Box(self.x_low.copy(), self.x_high.copy(), self.y_low.copy(), self.y_high.copy(), self.local)


@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """A proven bound and what each edge (m,) and visit (n,) adds to it, in units of `scale` to a prize."""

    units: int
    scale: int
    edge: Array
    node: Array

    @property
    def prize(self) -> int:
        """No tour in the box is worth more."""
        return self.units // self.scale


class Relaxation:
    """Maximise y over the box, under degree equations, the budget and the rows added so far.

    `tail`, `head`, `length` (m,) are the alive edges: all that a better tour might use.
    """

    def __init__(self, tours: Tours, tail: Array, head: Array, columns: Array) -> None:
        self.tours = tours
        self.tail, self.head = tail, head
        self.length = tours.length[tail, head]
        self.rows: list[Row] = []
        self.scale = max(1, (1 << _BITS) // (int(tours.prize.sum()) + 1))
        self._unit = max(1.0, float(tours.budget) / 16.0)
        self._keys = tail * tours.nodes + head
        self._column_of = np.full(len(tail), -1, dtype=np.int64)
        self._build(columns)

    # ------------------------------------------------------------------ model

    def _build(self, columns: Array) -> None:
        solver = pywraplp.Solver.CreateSolver("CLP")
        self._solver = solver
        self._parameters = pywraplp.MPSolverParameters()
        p = pywraplp.MPSolverParameters
        self._parameters.SetIntegerParam(p.PRESOLVE, p.PRESOLVE_OFF)
        self._parameters.SetIntegerParam(p.LP_ALGORITHM, p.DUAL)
        self._parameters.SetIntegerParam(p.INCREMENTALITY, p.INCREMENTALITY_ON)
        n = self.tours.nodes
        goal = solver.Objective()
        goal.SetMaximization()
        self._goal = goal
        self._y = [solver.NumVar(0.0, 1.0, "") for _ in range(n)]
        self._y_bounds = np.tile(np.array([0, 1], dtype=np.int8), (n, 1))
        top = float(max(1, int(self.tours.prize.max())))
        self._top = top
        for v in range(n):
            if self.tours.prize[v]:
                goal.SetCoefficient(self._y[v], float(self.tours.prize[v]) / top)
        self._penalty = _PENALTY * float(self.tours.prize.sum()) / top
        self._budget = solver.Constraint(-solver.infinity(), self.tours.budget / self._unit)
        self._degree = [solver.Constraint(0.0, 0.0) for _ in range(n)]
        over = solver.NumVar(0.0, solver.infinity(), "")
        goal.SetCoefficient(over, -self._penalty)
        self._budget.SetCoefficient(over, -1.0)
        self._short = solver.NumVar(0.0, solver.infinity(), "")  # in every row: there always is a solution
        goal.SetCoefficient(self._short, -self._penalty)
        for v in range(n):
            self._degree[v].SetCoefficient(self._y[v], -2.0)
            for sign in (1.0, -1.0):
                lacking = solver.NumVar(0.0, solver.infinity(), "")
                goal.SetCoefficient(lacking, -self._penalty)
                self._degree[v].SetCoefficient(lacking, sign)
        self._x: list[Any] = []
        self._edge_of = np.empty(0, dtype=np.int64)
        self._column_of[:] = -1
        self._x_bounds = np.empty((0, 2), dtype=np.int8)
        self._handles: list[Any] = []
        self._handed = 0
        self._row_on = np.empty(0, dtype=np.bool_)
        self._local: dict[Row, int] = {}
        self._optimal = False
        old, self.rows = self.rows, []
        self.add_columns(columns)
        self.add_rows(old)

    def add_columns(self, edges: Array) -> None:
        """Make columns (k,) of alive edges that are none yet."""
        edges = edges[self._column_of[edges] < 0]
        if not len(edges):
            return
        entries = [row.edge_coefficients(self.tail[edges], self.head[edges]) for row in self.rows]
        handed = sum(int(np.count_nonzero(values)) for values in entries)
        spend(Step.HANDED, _COLUMN * len(edges) + _LOOKED * len(self.rows))
        if _LATE * handed > self._dearness():
            self.rows = [row for row in self.rows if row not in self._local]
            self._build(np.concatenate([self._edge_of, edges]))
            return
        spend(Step.HANDED, _LATE * handed)
        first = len(self._x)
        for e in edges.tolist():
            column = self._solver.NumVar(0.0, 1.0, "")
            self._degree[self.tail[e]].SetCoefficient(column, 1.0)
            self._degree[self.head[e]].SetCoefficient(column, 1.0)
            self._budget.SetCoefficient(column, float(self.length[e]) / self._unit)
            self._x.append(column)
        for handle, values in zip(self._handles, entries, strict=True):
            for k in np.nonzero(values)[0].tolist():
                handle.SetCoefficient(self._x[first + k], float(values[k]))
        self._column_of[edges] = np.arange(first, len(self._x))
        self._edge_of = np.concatenate([self._edge_of, edges])
        fresh = np.tile(np.array([0, 1], dtype=np.int8), (len(edges), 1))
        self._x_bounds = np.concatenate([self._x_bounds, fresh])

    def _dearness(self) -> float:
        """Return what it costs to build the program anew and to solve it from nothing, as `Step.HANDED`.

        An iteration for each column is what that takes, nearly.
        """
        rows, columns = len(self.rows), len(self._x)
        pivots = columns * (rows + self.tours.nodes) * SECONDS[Step.PIVOT] / SECONDS[Step.HANDED]
        return self._handed + _ROW * rows + _COLUMN * columns + pivots

    def add_rows(self, rows: list[Row], *, on: bool = True) -> None:
        """Add inequalities; rows that are not `on` hold only in boxes that name them."""
        tail, head = self.tail[self._edge_of], self.head[self._edge_of]
        infinity = self._solver.infinity()
        handed = _ROW * len(rows)
        for row in rows:
            handle = self._solver.Constraint(float(row.at_least) if on else -infinity, infinity)
            values = row.edge_coefficients(tail, head)
            named = np.nonzero(values)[0].tolist()
            for k in named:
                handle.SetCoefficient(self._x[k], float(values[k]))
            visits = row.node_coefficients()
            seen = np.nonzero(visits)[0].tolist()
            for v in seen:
                handle.SetCoefficient(self._y[v], float(visits[v]))
            self._handed += len(named) + len(seen)
            handed += len(named) + len(seen)
            handle.SetCoefficient(self._short, 1.0)
            self._handles.append(handle)
            self.rows.append(row)
        spend(Step.HANDED, handed)
        self._row_on = np.concatenate([self._row_on, np.full(len(rows), on)])

    # ------------------------------------------------------------------ solution

    def solve(self, box: Box) -> FractionalTour:
        """Return an optimum of the linear program in a box.

        It need not be one: what follows from it is taken from `bound` only.
        """
        self._confine(box)
        p = pywraplp.MPSolverParameters
        for algorithm in (p.DUAL, p.PRIMAL):
            self._parameters.SetIntegerParam(p.LP_ALGORITHM, algorithm)
            status = self._solver.Solve(self._parameters)
            pivots = self._solver.iterations()
            height = len(self.rows) + self.tours.nodes
            spend(Step.PIVOT, height * max(0, pivots))
            spend(Step.HANDED, _SOLVED * height)
            if status == pywraplp.Solver.OPTIMAL:
                break
        self._optimal = status == pywraplp.Solver.OPTIMAL
        values = [v.solution_value() if self._optimal else 0.0 for v in (*self._x, *self._y)]
        x, y = np.array(values[: len(self._x)]), np.array(values[len(self._x) :])
        e = self._edge_of
        self.x = np.zeros(len(self.tail))
        self.x[e] = x
        return FractionalTour.of(self.tail[e], self.head[e], x, y)

    def _confine(self, box: Box) -> None:
        for row in box.local:
            if row not in self._local:
                self._local[row] = len(self.rows)
                self.add_rows([row], on=False)
        here = set(box.local)
        for row, r in self._local.items():
            on = row in here
            if on != self._row_on[r]:
                infinity = self._solver.infinity()
                self._handles[r].SetBounds(float(row.at_least) if on else -infinity, infinity)
                self._row_on[r] = on
        wanted = np.stack([box.x_low[self._edge_of], box.x_high[self._edge_of]], axis=1)
        for k in np.nonzero((wanted != self._x_bounds).any(axis=1))[0].tolist():
            self._x[k].SetBounds(float(wanted[k, 0]), float(wanted[k, 1]))
        self._x_bounds = wanted
        visits = np.stack([box.y_low, box.y_high], axis=1)
        for v in np.nonzero((visits != self._y_bounds).any(axis=1))[0].tolist():
            self._y[v].SetBounds(float(visits[v, 0]), float(visits[v, 1]))
        self._y_bounds = visits

    def bound(self, box: Box) -> Bound:
        """Return the bound of the last optimum's multipliers in a box, exact in integers."""
        t, scale, n = self.tours, self.scale, self.tours.nodes
        if not self._optimal:  # no multipliers: all there is
            nothing = np.zeros(len(self.tail), dtype=np.int64)
            return Bound(scale * int(t.prize.sum()), scale, nothing, np.zeros(n, dtype=np.int64))
        units = float(scale) * self._top
        # L = goal + per_length (budget - c x) + node (x(d(v)) - 2 y) + by (row - at_least)
        # with per_length, by >= 0
        per_length = max(0, round(self._budget.dual_value() * units / self._unit))
        per_length = min(per_length, _LARGEST // max(1, t.budget))
        node = self._integers(np.array([-c.dual_value() for c in self._degree]) * units)
        by = np.maximum(0, self._integers(np.array([-h.dual_value() for h in self._handles]) * units))
        active = np.nonzero((by > 0) & self._row_on)[0]
        with_set = np.array([r for r in active.tolist() if self.rows[r].kind != PLAIN], dtype=np.int64)
        sides = np.zeros((t.nodes, len(with_set)), dtype=np.bool_)
        for k, r in enumerate(with_set.tolist()):
            sides[:, k] = self.rows[r].side
        kinds = np.array([self.rows[r].kind for r in with_set.tolist()], dtype=np.int64)
        edge = edge_profits(self.tail, self.head, self.length, per_length, node, kinds, sides, by[with_set])
        visit = t.prize * scale - 2 * node
        constant = per_length * t.budget
        named = [np.empty((0, 2), dtype=np.int64)]
        for r in active.tolist():
            row, m = self.rows[r], int(by[r])
            constant -= m * row.at_least
            visit += m * row.node_coefficients()
            if len(row.edges):
                named.append(np.stack([row.edges[:, 0] * n + row.edges[:, 1], m * row.edges[:, 2]], axis=1))
        places, amounts = np.concatenate(named).T
        at = np.minimum(np.searchsorted(self._keys, places), len(self._keys) - 1)
        known = self._keys[at] == places
        np.add.at(edge, at[known], amounts[known])
        most = np.where(edge > 0, box.x_high * edge, box.x_low * edge)
        visits = np.where(visit > 0, box.y_high * visit, box.y_low * visit)
        spend(Step.PRICED, len(self.tail) * (len(with_set) + 2))
        spend(Step.HANDED, _BOUNDED * (len(self.rows) + n))
        return Bound(constant + int(most.sum()) + int(visits.sum()), scale, edge, visit)

    @staticmethod
    def _integers(values: Array) -> Array:
        return np.rint(np.clip(np.nan_to_num(values), -_LARGEST, _LARGEST)).astype(np.int64)

    # ------------------------------------------------------------------ what is left

    def missing(self, bound: Bound, box: Box, most: int) -> Array:
        """Return alive edges, no column yet, that would raise the linear program most."""
        candidates = np.nonzero((self._column_of < 0) & (bound.edge > 0) & (box.x_high > 0))[0]
        return candidates[np.argsort(-bound.edge[candidates], kind="stable")[:most]]

    @property
    def columns(self) -> Array:
        """Alive edges (k,) that are columns."""
        return self._edge_of

    def slack_rows(self) -> Array:
        """Return which rows (r,) have no multiplier at the last optimum."""
        if not self._optimal:
            return np.zeros(len(self._handles), dtype=np.bool_)
        spend(Step.HANDED, len(self._handles))
        return np.array([abs(h.dual_value()) < _UNUSED for h in self._handles], dtype=np.bool_)

    def crowded(self) -> bool:
        """Return whether there are so many rows that those without use should go."""
        return len(self.rows) > 4 * self.tours.nodes

    def keep(self, edges: Array, rows: list[Row]) -> None:
        """Build the program anew with alive edges (k,), the columns among them, and these rows."""
        columns = np.nonzero(self._column_of[edges] >= 0)[0]
        self.tail, self.head, self.length = self.tail[edges], self.head[edges], self.length[edges]
        self._keys = self._keys[edges]
        self._column_of = np.full(len(edges), -1, dtype=np.int64)
        self.rows = [row for row in rows if row not in self._local]
        self._build(columns)
