"""Goal selection as a constraint model for CP-SAT: side limits, and an opinion that shares no code with the
exact engine.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

from planner.orienteering.check import checked
from planner.orienteering.problem import RoutingProblem, RoutingSolution

ENGINE = "cp-sat"


def solve_cp_sat(
    problem: RoutingProblem,
    *,
    time_limit_s: float = 10.0,
    iterations: int | None = None,
    seed: int = 0,
    threads: int = 1,
    hint: Sequence[int] = (),
    upper: int | None = None,
    neighbours: int | None = None,
) -> RoutingSolution:
    """Return the best route that CP-SAT finds, with its bound.

    Parameters
    ----------
    iterations
        Limit in units of a thousandth of deterministic time; with one thread it makes the answer repeatable.
    hint
        A feasible route to start from.
    upper
        A known bound on the value, base prize included; it is handed to the solver as a constraint.
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
    a = p.arrays
    model = cp_model.CpModel()
    count = len(p.experiments)
    horizon = p.time_budget
    depot = count
    if p.start_time > horizon or (p.energy_budget is not None and p.energy_used > p.energy_budget):
        return RoutingSolution(None, None, True, (), ENGINE, seed, time.perf_counter() - begin)
    site = [*a.site.tolist(), p.start_site]
    visit = []
    start = []
    for i in range(count):
        low, high = int(a.earliest_start[i]), int(a.latest_end[i] - a.duration[i])
        possible = i not in p.done and high >= max(low, p.start_time)
        visit.append(model.new_bool_var(f"do{i}"))
        if not possible:
            model.add(visit[i] == 0)
        low = max(low, p.start_time)
        start.append(model.new_int_var(min(low, max(high, 0)), max(high, min(low, horizon), 0), f"start{i}"))

    def road(i: int, j: int) -> tuple[int, int]:
        if site[i] == site[j]:
            return 0, 0
        return int(p.travel_time[site[i], site[j]]), int(p.travel_energy[site[i], site[j]])

    arcs = [(i, i, visit[i].Not()) for i in range(count)]
    travel_terms = []
    energy_terms = []
    empty = model.new_bool_var("empty")
    arcs.append((depot, depot, empty))
    near = _nearest(p, site, neighbours)
    for i in range(count + 1):
        for j in range(count):
            if i == j or (near is not None and i != depot and j not in near[i]):
                continue
            seconds, joules = road(i, j)
            if seconds < 0:
                continue
            leave = (
                p.start_time if i == depot else int(max(a.earliest_start[i], p.start_time) + a.duration[i])
            )
            if leave + seconds > a.latest_end[j] - a.duration[j]:
                continue
            arc = model.new_bool_var(f"r{i}_{j}")
            arcs.append((i, j, arc))
            if i == depot:
                model.add(start[j] >= p.start_time + seconds).only_enforce_if(arc)
            else:
                model.add(start[j] >= start[i] + int(a.duration[i]) + seconds).only_enforce_if(arc)
            if seconds:
                travel_terms.append(seconds * arc)
            if joules:
                energy_terms.append(joules * arc)
    feasible_empty = True
    for i in range(count + 1):
        seconds, joules = 0, 0
        if p.end_site is not None and site[i] != p.end_site:
            seconds = int(p.travel_time[site[i], p.end_site])
            joules = int(p.travel_energy[site[i], p.end_site])
        if i == depot:
            used = p.energy_used + joules
            feasible_empty = (
                seconds >= 0
                and p.start_time + seconds <= horizon
                and (p.energy_budget is None or used <= p.energy_budget)
            )
            if not feasible_empty:
                model.add(empty == 0)
            continue
        if seconds < 0:
            continue
        arc = model.new_bool_var(f"e{i}")
        arcs.append((i, depot, arc))
        model.add(start[i] + int(a.duration[i]) + seconds <= horizon).only_enforce_if(arc)
        if seconds:
            travel_terms.append(seconds * arc)
        if joules:
            energy_terms.append(joules * arc)
    model.add_circuit(arcs)
    model.add(
        sum(travel_terms) + sum(int(a.duration[i]) * visit[i] for i in range(count)) <= horizon - p.start_time
    )
    if p.energy_budget is not None:
        model.add(
            sum(energy_terms) + sum(int(a.energy[i]) * visit[i] for i in range(count))
            <= p.energy_budget - p.energy_used
        )
    for b, c in p.precedence:
        if b in p.done:
            continue
        model.add_implication(visit[c], visit[b])
        model.add(start[c] >= start[b] + int(a.duration[b])).only_enforce_if(visit[c])
    for limit in p.limits:
        taken = sum(limit.amounts[i] for i in p.done)
        model.add(sum(limit.amounts[i] * visit[i] for i in range(count)) <= limit.capacity - taken)
    for i, e in enumerate(p.experiments):
        if e.must_do and i not in p.done:
            model.add(visit[i] == 1)
    value = sum(int(a.prize[i]) * visit[i] for i in range(count))
    if upper is not None:
        model.add(value <= upper - p.base_prize)
    chosen = set(hint)
    if hint:
        for i in range(count):
            model.add_hint(visit[i], i in chosen)
    model.maximize(value)
    solver = cp_model.CpSolver()
    solver.parameters.max_time_in_seconds = max(0.01, time_limit_s - (time.perf_counter() - begin))
    if iterations is not None:
        solver.parameters.max_deterministic_time = iterations / 1000.0
    solver.parameters.num_workers = max(1, threads)
    solver.parameters.random_seed = seed
    solver.parameters.linearization_level = 2
    status = solver.solve(model)
    wall = time.perf_counter() - begin
    if status == cp_model.INFEASIBLE:
        return RoutingSolution(None, None, neighbours is None, (), ENGINE, seed, wall)
    bound = None
    if neighbours is None and math.isfinite(solver.best_objective_bound):
        bound = math.floor(solver.best_objective_bound + 1e-6) + p.base_prize
    if status not in (cp_model.OPTIMAL, cp_model.FEASIBLE):
        return RoutingSolution(None, bound, False, (), ENGINE, seed, wall)
    follow = {i: j for i, j, literal in arcs if i != j and solver.boolean_value(literal)}
    route = []
    at = follow.get(depot, depot)
    while at != depot:
        route.append(at)
        at = follow[at]
    earned = p.base_prize + sum(int(a.prize[i]) for i in route)
    proven = status == cp_model.OPTIMAL and neighbours is None
    return checked(
        p, RoutingSolution(earned, earned if proven else bound, proven, tuple(route), ENGINE, seed, wall)
    )


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
