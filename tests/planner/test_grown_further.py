"""Plans of a search that leave much to the optimal policy are grown further on sampled futures."""

from __future__ import annotations

import math

import numpy as np
import pytest

from planner.contingency.seeding import route_plan
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.evaluate.propagate import Evaluator
from planner.options import PlannerOptions
from planner.plan_tree import Plan, count_branches
from planner.progress import Watch
from planner.solve import solve
from planner.stages import Order, grown_further
from planner.strategies import Found
from planner.strategies.registry import strategy_named
from planner.tally import Step, spend, tallied
from studies.common.planner_days import day


def _poor(model: Model) -> tuple[float, Plan, float]:
    """Return the single visit that is worth least, with its value and that of the best one."""
    worth = Evaluator(model)
    value = {m: worth.value(route_plan(model, (m,))).value for m in range(model.m)}
    poor = route_plan(model, (min(value, key=lambda m: value[m]),))
    return worth.value(poor).value, poor, max(value.values())


def _grown(found: Found, *, limit_s: float = 60.0, iterations: int | None = None) -> Found:
    problem = day(np.random.default_rng(4), least=5, most=5)
    with tallied() as tally:
        watch = Watch(limit_s, tally, lambda _: None, begun_s=0.0)
        order = Order(
            problem, "optimal", strategy_named("optimal"), 2, iterations, 0, 0.0, (), False,
            PlannerOptions(), watch, False,
        )  # fmt: skip
        spend(Step.CALL)
        return grown_further(order, Model.of(problem), found)


def test_a_search_that_ends_short_of_the_optimal_policy_is_grown_further() -> None:
    problem = day(np.random.default_rng(27), least=5, most=5)
    result = solve(problem, max_branches=2, time_limit_s=20.0, plan_only=True)
    earned = simulate(Model.of(problem), result.tree.plan, 200_000, seed=987).utility
    assert result.branches <= 2
    assert result.searched == 1.0
    assert float(earned.mean()) > 10.65  # the search alone ends with 10.54; the error is 0.01


def test_a_main_line_that_is_not_the_best_is_polished_where_much_is_left_to_win() -> None:
    model = Model.of(day(np.random.default_rng(4), least=5, most=5))
    begun, poor, best = _poor(model)
    found = _grown(Found([(begun, poor)], optimum=2.0 * abs(begun) + 1.0))
    assert found.done == 1.0
    assert found.curve[-1][0] >= best
    assert all(count_branches(plan) <= most for most, (_, plan) in enumerate(found.curve))
    for told, plan in found.curve:
        assert math.isclose(told, Evaluator(model).value(plan).value, rel_tol=1e-9)


@pytest.mark.parametrize("why", ["good enough", "counts its steps", "no time left"])
def test_what_needs_or_may_have_no_more_is_left_alone(why: str) -> None:
    begun, poor, _ = _poor(Model.of(day(np.random.default_rng(4), least=5, most=5)))
    optimum = begun if why == "good enough" else 2.0 * abs(begun) + 1.0
    found = Found([(begun, poor)], optimum=optimum)
    left = _grown(
        found,
        limit_s=1e-9 if why == "no time left" else 60.0,
        iterations=50 if why == "counts its steps" else None,
    )
    assert left.curve == found.curve
    assert left.done == (0.5 if why == "no time left" else 1.0)  # and so a longer limit may give more
