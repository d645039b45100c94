"""Branches where the optimal policy says that most is to be won (`contingency/branching.py`)."""

from __future__ import annotations

import numpy as np

from planner.contingency.branching import SearchLimits, plan_optimal
from planner.contingency.policy import Policy
from planner.contingency.reduction import mean_route_of, moves_of
from planner.contingency.seeding import mean_seed, route_plan
from planner.evaluate.grid import Grid, Rounding
from planner.evaluate.model import Model
from planner.evaluate.program import compile_plan
from planner.evaluate.propagate import Backward
from planner.plan_edits import fitted
from planner.plan_tree import Plan
from planner.strategies.registry import Found, Task

USUAL_BRANCHES, USUAL_TARGETS = 6, 8
"""For these `PlannerOptions.search_s` is meant."""


def search(task: Task) -> Found:
    """Return the best plans found with 0, 1, 2, ... branches, and the value of the optimal policy."""
    model, options, watch = task.model, task.options, task.watch
    early = routes_cut_short(task)
    policy = Policy(
        Grid(model, task.grid.nt, task.grid.ng, Rounding.MID, np.float32),
        moves=moves_of(model, quick=task.quick),
        should_stop=lambda: watch.stop(0.6),
    )
    limits = SearchLimits(
        max_branches=task.max_branches,
        iterations=task.iterations,
        main_lines=1 if task.quick else options.main_lines,
        tolerance=options.quick_tolerance if task.quick else options.tolerance,
    )
    allowed_s = options.search_s * max(1.0, task.max_branches / USUAL_BRANCHES)
    allowed_s += options.search_s_per_target * max(0, model.n - USUAL_TARGETS)
    until = watch.work_s() + (options.quick_search_s if task.quick else allowed_s)
    counted = task.iterations is not None
    found = plan_optimal(
        policy,
        task.grid,
        limits,
        should_stop=lambda: not counted and (watch.stop(0.6) or watch.work_s() > until),
        report=watch.told,
        extra=(*(fitted(model.problem, plan) for plan in task.warm), *early),
    )
    if not policy.complete:
        return Found(found.curve, None, 0.0)
    return Found(found.curve, found.optimum, found.done, found.lines, policy)


def routes_cut_short(task: Task) -> tuple[Plan, ...]:
    """Return plans that need no table, best first: the route on mean values, cut short at every length.

    Where no route fits on mean values, they are single visits, which may end in time by luck.
    They are there before the table of the optimal policy is, and on problems that are large for the time
    limit they are what the search begins with.
    """
    model, grid = task.model, task.grid
    # Who waits for an answer to a changed day brings a plan, so a route that reckons with tracks as carried
    # in the mean does beside it: 7 ms instead of 45 with ten targets.
    order = _hasty_route(model) if task.quick and task.warm else mean_seed(model)
    routes = [order[:length] for length in range(len(order), 0, -1)] or single_visits(model)
    plans: list[tuple[float, Plan]] = []
    for route in routes:
        plan = route_plan(model, route)
        plans.append((Backward(grid, compile_plan(model, plan)).total(), plan))
    plans.sort(key=lambda pair: -pair[0])
    if plans and plans[0][0] > task.watch.best_value:
        task.watch.told(plans[0][1], plans[0][0])
    return tuple(plan for _, plan in plans[: task.options.quick_plans])


def _hasty_route(model: Model) -> tuple[int, ...]:
    return tuple(model.number_of[name] for name in mean_route_of(model.problem, 1.0))


def single_visits(model: Model) -> list[tuple[int, ...]]:
    """Return routes of one observation that is worth something and may be made first."""
    return [
        (m,)
        for m in range(model.m)
        if model.utility[m] > 0.0
        and not model.predecessors[m]
        and model.hops(0, int(model.obs_place[m]))
        and model.admits(1 << m)
    ]
