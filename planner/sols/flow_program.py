"""Expected drives, observations and charges of every policy over several sols, as a linear program.

The flow of `contingency.flow_bound`, once for each sol. Variables are expectations under a policy:
`x[k, a, b]` drives a -> b on sol k that end within its budgets, `y[k, m]` observations that do, `e[k, p]`
the chance that the rover stands at p after sol k, `B[k]` the charge in the morning. Every policy satisfies:

1. *Time.* As there: a success of an action costs at least c = inf over R of E[min(X, R)] / P(X <= R).
2. *Charge.* What an action draws, min(E, R) with R left above the reserve, is at least c for each success
   (`least_draw`). So with U[k] the sum of c over successes, U[k] + reserve <= B[k], and since what a rest
   makes of a charge is concave, B[k + 1] <= min(ceiling, B[k] - U[k] + gain) (Jensen).
3. *Flow.* Where the rover stands after a sol it begins the next one: drives from p and `e[k, p]` are not more
   than drives to p and `e[k - 1, p]`.
4. *Entries.* What is observed on sol k is not more than the flow that comes to its place then; what is
   observed at all not more than what comes there on all sols. Sets of places on all sols give cuts, found by
   maximum flow.
5. *Once.* Each observation is made at most once: sum over k of y[k, m] <= 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import maximum_flow

from planner.contingency.flow_bound import least_time, reached
from planner.contingency.linear_program import solved
from planner.evaluate.model import Floats, Ints
from planner.sols.least_draw import least_draw
from planner.sols.path_problem import PathProblem
from planner.tally import Step, spend

SCALE = 1_000_000
"""Flow units in which cuts are sought."""

VIOLATED = 1e-3
"""Least chance by which a cut must be violated to be added. By hand."""

BINDING = 1e-6
"""Slack up to which a cut counts as binding. By hand."""

IDLE = 8
"""Rounds without binding after which a cut is taken out. By hand: taken out at once, cuts come and go."""


class RowKind(Enum):
    """What a row of the program says."""

    TIME = "time"
    CHARGE = "charge"
    FLOW = "flow"
    ENTRY = "entry"
    ONCE = "once"


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """Sum of `values` times the columns `at`, at most `limit`: for every policy in the mean.

    `sol` is set where the row is about the charge: then all that sol `sol` draws counts on its left.
    """

    at: Ints
    values: Floats
    limit: float
    kind: RowKind
    sol: int = -1


class FlowProgram:
    """The linear program: columns are drives, observations, places after a sol, and charges."""

    def __init__(self, path: PathProblem) -> None:
        self.path, model = path, path.model
        legs = model.has_leg.copy()
        legs[:, 0] = False
        np.fill_diagonal(legs, False)
        self.origin, self.to = np.nonzero(legs)
        sols, places = path.sols, model.n + 1
        count = np.cumsum([0, sols * len(self.to), sols * model.m, sols * places, sols])
        self.x = np.arange(count[0], count[1]).reshape(sols, -1)
        self.y = np.arange(count[1], count[2]).reshape(sols, -1)
        self.e = np.arange(count[2], count[3]).reshape(sols, -1)
        self.charge = np.arange(count[3], count[4])
        self.count = int(count[4])
        self.rows: list[Row] = []
        self.worth = model.utility * model.p_success
        self.cost = np.zeros(self.count)
        self.cost[self.y] = -self.worth
        self.bounds = np.tile([0.0, np.inf], (self.count, 1))
        self.bounds[self.y.ravel(), 1] = path.allowed.ravel()
        for k in range(sols):
            # the mornings that cannot be are cut off; the reserve of a sol is the least charge after its work
            self.bounds[self.charge[k]] = path.reserve_j[k], max(path.most_j(k), path.reserve_j[k])
        self.bounds[self.charge[0]] = path.charge_j
        self._budgets()
        self._flows()
        for m in range(model.m):
            self.rows.append(Row(self.y[:, m], np.ones(sols), 1.0, RowKind.ONCE))
            inside = np.zeros((sols, places), np.bool_)
            inside[:, model.obs_place[m]] = True
            self.rows.append(self._entries(inside, self.y[:, m]))
        self.kept = len(self.rows)
        self.idle: list[int] = []

    def _budgets(self) -> None:
        model, path = self.path.model, self.path
        amounts = np.concatenate([model.leg[self.origin, self.to], model.obs])
        ln = np.concatenate([model.leg_ln[self.origin, self.to], model.obs_ln])
        seconds = np.array([least_time(*row) for row in np.column_stack([amounts[:, 0], ln[:, :2]]).tolist()])
        joules = np.array([least_draw(a, b, model.hotel_w) for a, b in zip(amounts, ln, strict=True)])
        spend(Step.CALL, len(amounts))
        for k in range(path.sols):
            at = np.concatenate([self.x[k], self.y[k]])
            self.rows.append(Row(at, seconds, float(path.time_s[k]), RowKind.TIME))
            drawn = np.append(at, self.charge[k])
            limit = -float(path.reserve_j[k])
            self.rows.append(Row(drawn, np.append(joules, -1.0), limit, RowKind.CHARGE, k))
            if k + 1 < path.sols:
                after = np.append(drawn, self.charge[k + 1])
                gain = path.rests[k].gain_j
                self.rows.append(Row(after, np.append(joules, [-1.0, 1.0]), gain, RowKind.CHARGE, k))

    def _flows(self) -> None:
        for k in range(self.path.sols):
            for place in range(self.path.model.n + 1):
                out, into = np.nonzero(self.origin == place)[0], np.nonzero(self.to == place)[0]
                at = [self.x[k, out], self.x[k, into], self.e[k, [place]]]
                values = [np.ones(len(out)), np.full(len(into), -1.0), np.ones(1)]
                if k:
                    at.append(self.e[k - 1, [place]])
                    values.append(np.full(1, -1.0))
                begun = 1.0 if k == 0 and place == 0 else 0.0
                self.rows.append(Row(np.concatenate(at), np.concatenate(values), begun, RowKind.FLOW))
            for m in range(self.path.model.m):
                place = int(self.path.model.obs_place[m])
                inside = np.zeros((self.path.sols, self.path.model.n + 1), np.bool_)
                inside[k, place] = True
                self.rows.append(self._entries(inside, self.y[[k], m]))

    def _entries(self, inside: np.ndarray[Any, Any], seen: Ints) -> Row:
        """Return that observations are made no more often than a set (K, n + 1) of places is entered."""
        at, sols = [seen], self.path.sols
        for k in range(sols):
            into = inside[k, self.to] & ~inside[k, self.origin]
            at.append(self.x[k, into])
            if k:
                at.append(self.e[k - 1, inside[k] & ~inside[k - 1]])
        columns = np.concatenate(at)
        values = np.full(len(columns), -1.0)
        values[: len(seen)] = 1.0
        return Row(columns, values, 1.0 if inside[0, 0] else 0.0, RowKind.ENTRY)

    def solve(self, limit_s: float) -> Any:
        at = np.repeat(np.arange(len(self.rows)), [len(row.at) for row in self.rows])
        values = np.concatenate([row.values for row in self.rows])
        columns = np.concatenate([row.at for row in self.rows])
        matrix = sparse.csr_matrix((values, (at, columns)), shape=(len(self.rows), self.count))
        limits = np.array([row.limit for row in self.rows])
        return solved(self.cost, matrix, limits, self.bounds, limit_s)

    def cut(self, x: Floats, slack: Floats) -> int:
        """Add the cuts that a solution [columns] with its slack [rows] violates, and take out idle ones.

        Return how many were added.
        """
        binding = slack[self.kept :] < BINDING
        self.idle = [0 if b else age + 1 for age, b in zip(self.idle, binding, strict=True)]
        cuts = zip(self.rows[self.kept :], self.idle, strict=True)
        self.rows[self.kept :] = [row for row, age in cuts if age <= IDLE]
        self.idle = [age for age in self.idle if age <= IDLE]
        added = self.violated(x)
        self.rows += added
        self.idle += [0] * len(added)
        return len(added)

    def violated(self, x: Floats) -> list[Row]:
        """Return cuts that a solution [columns] violates: on all sols together, else on single sols."""
        return self._cut_on_all(x) or self._cut_by_sol(x)

    def _cut_on_all(self, x: Floats) -> list[Row]:
        """Return sets of places entered, on all sols together, less often than one of them is seen."""
        places = self.path.model.n + 1
        capacity = np.zeros((places, places), np.int32)
        capacity[self.origin, self.to] = np.rint(SCALE * np.minimum(x[self.x].sum(axis=0), 4.0))
        made = x[self.y].sum(axis=0)
        found: list[Row] = []
        for place in np.unique(self.path.model.obs_place).tolist():
            here = np.nonzero(self.path.model.obs_place == place)[0]
            for inside in self._cuts(capacity, place, float(made[here].max())):
                entering = capacity[np.ix_(~inside, inside)].sum() / SCALE
                seen = np.nonzero(inside[self.path.model.obs_place] & (made > entering + VIOLATED))[0]
                everywhere = np.tile(inside, (self.path.sols, 1))
                found += [self._entries(everywhere, self.y[:, m]) for m in seen]
        return found

    def _cut_by_sol(self, x: Floats) -> list[Row]:
        """Return sets of (sol, place) entered less often than a place of theirs is seen on its sol."""
        sols, places = self.path.sols, self.path.model.n + 1
        capacity = np.zeros((sols * places, sols * places), np.int32)
        for k in range(sols):
            drives = np.rint(SCALE * np.minimum(x[self.x[k]], 4.0))
            capacity[k * places + self.origin, k * places + self.to] = drives
            if k + 1 < sols:
                stays = k * places + np.arange(places)
                capacity[stays, stays + places] = np.rint(SCALE * np.minimum(x[self.e[k]], 4.0))
        made = x[self.y]
        found: list[Row] = []
        for k, m in np.argwhere(made > VIOLATED).tolist():
            node = k * places + int(self.path.model.obs_place[m])
            for inside in self._cuts(capacity, node, float(made[k, m])):
                found += [self._entries(inside.reshape(sols, places), self.y[[k], m])]
        return found

    def _cuts(self, capacity: np.ndarray[Any, Any], to: int, made: float) -> list[np.ndarray[Any, Any]]:
        """Return the smallest and the largest set round a node into which less flows from the start."""
        if made < VIOLATED:
            return []
        graph = sparse.csr_matrix(capacity)
        flow = maximum_flow(graph, 0, to)
        spend(Step.CALL, len(capacity))
        if float(flow.flow_value) / SCALE >= made - VIOLATED:
            return []
        residual = capacity - flow.flow.toarray()
        largest = np.ones(len(capacity), np.bool_)
        largest[list(reached(residual, 0))] = False
        smallest = np.zeros(len(capacity), np.bool_)
        smallest[list(reached(residual.T, to))] = True
        return [smallest] if np.array_equal(smallest, largest) else [smallest, largest]
