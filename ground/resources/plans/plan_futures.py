"""Fly a stored plan through many futures, without the rover."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sqlalchemy.orm import Session

from ground.resources.plans.read_plan import tree_of
from ground.resources.plans.row import PlanRow
from ground.resources.plans.study_value import Histogram
from ground.resources.problems.row import ProblemRow

if TYPE_CHECKING:
    from planner.evaluate.model import Floats
    from planner.evaluate.monte_carlo import Futures
    from planner.plan_tree import Plan, PlanTree
    from planner.problem import Problem

FUTURES = 20_000
"""Enough for a standard error of about a hundredth of a plan's value, in about a second."""
BINS = 32
"""Bars of a histogram."""


def stored(session: Session, plan: PlanRow) -> tuple[Problem, PlanTree]:
    """Return problem and tree of a computed plan; raises `StateError` if it has no tree."""
    from planner.plan_tree import plan_tree_from_dict
    from planner.problem import problem_from_dict

    assert plan.problem_id is not None
    problem = problem_from_dict(session.get_one(ProblemRow, plan.problem_id).document)
    return problem, plan_tree_from_dict(tree_of(plan), problem)


def fly(problem: Problem, plan: Plan, seed: int) -> tuple[Futures, dict[str, float]]:
    """Return what a plan earns and uses in each future, and how often each of its observations was begun."""
    from planner.evaluate.model import Model
    from planner.evaluate.monte_carlo import simulate
    from planner.evaluate.program import compile_plan
    from planner.what_if import begun

    model = Model.of(problem)
    program = compile_plan(model, plan)
    flown = simulate(model, program, FUTURES, seed=seed, count_visits=True)
    return flown, begun(program, plan, flown.row_visits, FUTURES)


def bin_edges(low: float, high: float) -> Floats:
    """Return the edges of `BINS` bins over a range, widened where it is a point."""
    import numpy as np

    if high - low < 1e-9:
        low, high = low - 0.5, high + 0.5
    return np.linspace(low, high, BINS + 1)


def histogram(values: Floats) -> Histogram:
    """Return the shares of the futures by value; `values` [futures], in any unit, has one of each."""
    import numpy as np

    counts, edges = np.histogram(values, bin_edges(float(values.min()), float(values.max())))
    return Histogram(rounded(edges), rounded(counts / len(values)))


def rounded(values: Floats) -> list[float]:
    """Return numbers [n] as they are sent: to six decimals."""
    return [round(float(value), 6) for value in values]
