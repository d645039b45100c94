"""Goal selection as a constraint model for CP-SAT: side limits, and an opinion that shares no code with the
exact engine.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from planner.orienteering.check import checked
from planner.orienteering.problem import RoutingProblem, RoutingSolution

if TYPE_CHECKING:
    from ortools.sat.python import cp_model

ENGINE = "cp-sat"

PER_S = 1.0
"""Units of its deterministic time to a second of a processor, as its makers mean them."""


def solve_cp_sat(
    problem: RoutingProblem,
    *,
    time_limit_s: float = 10.0,
    iterations: int | None = None,
    seed: int = 0,
    threads: int = 1,
    hint: Sequence[int] = (),
    neighbours: int | None = None,
) -> RoutingSolution:
    """Return the best route that CP-SAT finds, with its bound.

    Parameters
    ----------
    iterations
        Limit in units of a thousandth of deterministic time; with one thread it makes the answer repeatable.
    hint
        A feasible route to start from.
    neighbours
        Keep only the roads to so many nearest experiments; the bound is then withheld.

    Notes
    -----
    A circuit through the chosen experiments, optional nodes as loops on themselves; start times with
    big-M-free implications on the roads; energy and a redundant time row as sums; `linearization_level` 2.
    """
    from ortools.sat.python import cp_model

    begin = time.perf_counter()
    p = problem
    if p.start_time > p.time_budget or (p.energy_budget is not None and p.energy_used > p.energy_budget):
        return RoutingSolution(None, None, True, (), ENGINE, seed, time.perf_counter() - begin)
    route_model = _RouteModel(p, hint, neighbours)
    solver = cp_model.CpSolver()
    allowed = max(0.01, time_limit_s) * PER_S
    if iterations is not None:
        allowed = min(allowed, iterations / 1000.0)
    solver.parameters.max_deterministic_time = allowed
    solver.parameters.num_workers = max(1, threads)
    solver.parameters.random_seed = seed
    solver.parameters.linearization_level = 2
    status = solver.solve(route_model.model)
    wall = time.perf_counter() - begin
    if status == cp_model.INFEASIBLE:
        return RoutingSolution(None, None, neighbours is None, (), ENGINE, seed, wall)
    bound = None
    if neighbours is None and math.isfinite(solver.best_objective_bound):
        bound = math.floor(solver.best_objective_bound + 1e-6) + p.base_prize
    if status not in (cp_model.OPTIMAL, cp_model.FEASIBLE):
        return RoutingSolution(None, bound, False, (), ENGINE, seed, wall)
    route = route_model.route(solver)
    earned = p.base_prize + sum(int(p.arrays.prize[i]) for i in route)
    proven = status == cp_model.OPTIMAL and neighbours is None
    return checked(p, RoutingSolution(earned, earned if proven else bound, proven, route, ENGINE, seed, wall))


class _RouteModel:
    """The constraint model of a problem: nodes 0..count-1 are experiments, `count` is start and end."""

    def __init__(self, problem: RoutingProblem, hint: Sequence[int], neighbours: int | None) -> None:
        from ortools.sat.python import cp_model

        p = self.problem = problem
        self.model = cp_model.CpModel()
        self.depot = len(p.experiments)
        self.site = [*p.arrays.site.tolist(), p.start_site]
        self.visit: list[cp_model.IntVar] = []
        self.start: list[cp_model.IntVar] = []
        self.arcs: list[tuple[int, int, cp_model.LiteralT]] = []
        self.travel: list[cp_model.LinearExprT] = []
        self.energy: list[cp_model.LinearExprT] = []
        self._experiments()
        self._roads(_nearest(p, self.site, neighbours))
        self._ends()
        self.model.add_circuit(self.arcs)
        self._budgets()
        self._rules()
        if hint:
            for i in range(self.depot):
                self.model.add_hint(self.visit[i], i in set(hint))
        self.model.maximize(sum(int(p.arrays.prize[i]) * self.visit[i] for i in range(self.depot)))

    def _experiments(self) -> None:
        p, a, horizon = self.problem, self.problem.arrays, self.problem.time_budget
        for i in range(self.depot):
            low, high = int(a.earliest_start[i]), int(a.latest_end[i] - a.duration[i])
            possible = i not in p.done and high >= max(low, p.start_time)
            self.visit.append(self.model.new_bool_var(f"do{i}"))
            if not possible:
                self.model.add(self.visit[i] == 0)
            low = max(low, p.start_time)
            first, last = min(low, max(high, 0)), max(high, min(low, horizon), 0)
            self.start.append(self.model.new_int_var(first, last, f"start{i}"))
        self.arcs += [(i, i, self.visit[i].Not()) for i in range(self.depot)]

    def _arc(self, i: int, j: int, name: str, cost: tuple[int, int]) -> cp_model.IntVar:
        """Return a new arc that takes so many seconds and joules."""
        arc = self.model.new_bool_var(name)
        self.arcs.append((i, j, arc))
        seconds, joules = cost
        if seconds:
            self.travel.append(seconds * arc)
        if joules:
            self.energy.append(joules * arc)
        return arc

    def _cost(self, i: int, site: int) -> tuple[int, int]:
        """Return time and energy from a node to a site; a negative time means that there is no road."""
        p, origin = self.problem, self.site[i]
        if origin == site:
            return 0, 0
        return int(p.travel_time[origin, site]), int(p.travel_energy[origin, site])

    def _roads(self, near: list[set[int]] | None) -> None:
        p, a = self.problem, self.problem.arrays
        empty = self.model.new_bool_var("empty")
        self.arcs.append((self.depot, self.depot, empty))
        if not self._may_be_empty():
            self.model.add(empty == 0)
        for i in range(self.depot + 1):
            at_start = i == self.depot
            leave = p.start_time if at_start else int(max(a.earliest_start[i], p.start_time) + a.duration[i])
            for j in range(self.depot):
                if i == j or (near is not None and not at_start and j not in near[i]):
                    continue
                cost = self._cost(i, self.site[j])
                if cost[0] < 0 or leave + cost[0] > a.latest_end[j] - a.duration[j]:
                    continue
                arc = self._arc(i, j, f"r{i}_{j}", cost)
                left = p.start_time if at_start else self.start[i] + int(a.duration[i])
                self.model.add(self.start[j] >= left + cost[0]).only_enforce_if(arc)

    def _may_be_empty(self) -> bool:
        p = self.problem
        seconds, joules = (0, 0) if p.end_site is None else self._cost(self.depot, p.end_site)
        in_time = seconds >= 0 and p.start_time + seconds <= p.time_budget
        return in_time and (p.energy_budget is None or p.energy_used + joules <= p.energy_budget)

    def _ends(self) -> None:
        p, a = self.problem, self.problem.arrays
        for i in range(self.depot):
            cost = (0, 0) if p.end_site is None else self._cost(i, p.end_site)
            if cost[0] >= 0:
                arc = self._arc(i, self.depot, f"e{i}", cost)
                over = self.start[i] + int(a.duration[i]) + cost[0]
                self.model.add(over <= p.time_budget).only_enforce_if(arc)

    def _budgets(self) -> None:
        p, a, visit = self.problem, self.problem.arrays, self.visit
        busy = sum(int(a.duration[i]) * visit[i] for i in range(self.depot))
        self.model.add(sum(self.travel) + busy <= p.time_budget - p.start_time)
        if p.energy_budget is not None:
            used = sum(int(a.energy[i]) * visit[i] for i in range(self.depot))
            self.model.add(sum(self.energy) + used <= p.energy_budget - p.energy_used)

    def _rules(self) -> None:
        p, a, visit = self.problem, self.problem.arrays, self.visit
        for b, c in p.precedence:
            if b not in p.done:
                self.model.add_implication(visit[c], visit[b])
                over = self.start[b] + int(a.duration[b])
                self.model.add(self.start[c] >= over).only_enforce_if(visit[c])
        for limit in p.limits:
            taken = sum(limit.amounts[i] for i in p.done)
            held = sum(limit.amounts[i] * visit[i] for i in range(self.depot))
            self.model.add(held <= limit.capacity - taken)
        for i, e in enumerate(p.experiments):
            if e.must_do and i not in p.done:
                self.model.add(visit[i] == 1)

    def route(self, solver: cp_model.CpSolver) -> tuple[int, ...]:
        """Return the experiments in the order in which a solution does them."""
        follow = {i: j for i, j, literal in self.arcs if i != j and solver.boolean_value(literal)}
        route, at = [], follow.get(self.depot, self.depot)
        while at != self.depot:
            route.append(at)
            at = follow[at]
        return tuple(route)


def _nearest(p: RoutingProblem, site: list[int], neighbours: int | None) -> list[set[int]] | None:
    if neighbours is None or neighbours >= len(p.experiments):
        return None
    kept = []
    for i in range(len(p.experiments)):
        lengths = sorted(
            (0 if site[i] == site[j] else int(p.travel_time[site[i], site[j]]), j)
            for j in range(len(p.experiments))
            if j != i and (site[i] == site[j] or p.travel_time[site[i], site[j]] >= 0)
        )
        kept.append({j for _, j in lengths[:neighbours]})
    return kept
