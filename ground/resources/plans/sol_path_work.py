"""Plan several sols, of which the first becomes the plan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ground.errors import JobFailedError
from ground.jobs.queue import WorkStoppedError
from mission.codec import Document

if TYPE_CHECKING:
    from ground.resources.plans.order import Ahead, Search
    from planner.plan_result import PlanResult, Progress
    from planner.problem import Problem
    from planner.sols.solve_path import SolPath


@dataclass(frozen=True, eq=False)
class FirstSol:
    """The first sol's problem and plan, the path as a document, and why each other request is not in it."""

    problem: Problem
    result: PlanResult
    document: Document
    later: dict[str, str]


def plan_first_sol(
    problem: Problem,
    ahead: Ahead,
    search: Search,
    report: Callable[[Progress], None],
    should_stop: Callable[[], bool],
) -> FirstSol:
    """Return the plan of the first sol of a path.

    Raises
    ------
    WorkStoppedError
        If it was stopped before there was one.
    JobFailedError
        If the first sol has nothing to do.
    """
    from planner.sols.path_document import path_to_dict
    from planner.sols.path_problem import same_budgets
    from planner.sols.solve_path import solve_sols

    path = solve_sols(
        problem,
        same_budgets(problem, ahead.sols) if ahead.series is None else ahead.series,
        time_limit_s=search.time_limit_s,
        max_branches=search.max_branches,
        seed=search.seed,
        report=report,
        should_stop=should_stop,
    )
    if path.first_sol is None or path.plan is None:
        if path.stopped:
            raise WorkStoppedError
        raise JobFailedError(
            f"no plan: nothing is worth doing on sol 1 of {ahead.sols}; the path as a whole earns "
            f"{path.mean:.4g}",
            type="plan-empty",
        )
    # the charge that the nights need is not part of what the plan may use
    budget = replace(
        path.first_sol.budget, energy_j=path.first_sol.budget.usable_energy_j, energy_floor_j=0.0
    )
    first = replace(path.first_sol, budget=budget)
    return FirstSol(first, path.plan, path_to_dict(path), _later(problem, path))


def _later(problem: Problem, path: SolPath) -> dict[str, str]:
    """Return for each observation on which later sol it is mostly made, or that no sol holds it."""
    found = {
        str(o.id): f"no sol of {len(path.outline)} makes it likelier than not" for o in problem.observations
    }
    for sol in path.outline:
        for name in sol.observations:
            found[str(name)] = f"planned for sol {sol.sol} of {len(path.outline)}"
    return found
