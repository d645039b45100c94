"""What a plan is told to be worth, where budgets grow and a grid over them becomes coarse."""

from __future__ import annotations

import numpy as np
import pytest

from planner.contingency.policy import Policy
from planner.evaluate.grid import Grid, Rounding
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.evaluate.program import compile_plan
from planner.evaluate.propagate import Backward, Evaluator
from planner.plan_choice import settled_value
from studies.common.planner_days import day
from studies.planner_budgets import PREDICTED_FALL, falls, found_at, widened
from studies.planner_small import best_orders
from tests.planner.examples import example, visits
from tests.planner.reference.problems import generated


@pytest.mark.parametrize(
    ("seed", "number", "budgets"),
    [
        (6002, 17, (3.0, 10.0)),
        (757169976, 4, (3.0, 10.0)),
        (11861197, 7, (10.0, 30.0)),
        (11861197, 10, (10.0, 30.0)),
    ],
)
def test_a_larger_budget_does_not_lower_the_value_told(
    seed: int, number: int, budgets: tuple[float, float]
) -> None:
    problem = day(np.random.default_rng([seed, number]), most=5)
    found = [found_at(problem, factor) for factor in budgets]
    _, predicted, fell = falls(found)
    assert not fell
    assert predicted <= PREDICTED_FALL
    for result in found:
        assert result.check is not None
        assert result.expected_utility == pytest.approx(
            result.check.mean, abs=3.0 * result.check.standard_error
        )


def test_a_value_that_has_settled_stays_as_it_is() -> None:
    problem = example()
    model, plan = Model.of(problem), visits(problem, *(str(o.id) for o in problem.observations))
    check = simulate(model, plan, 4_096, seed=1).estimate()
    usual = Evaluator(model.within_reach()).value(plan).value
    assert settled_value(model, plan, check, lambda: 0.0) == (usual, "grid")


def test_where_no_grid_settles_the_check_tells_the_value() -> None:
    problem = generated("twice", 94464244, spread=0.05)
    model, plan = Model.of(problem), best_orders(problem)[0]
    check = simulate(model, plan, 200_000, seed=1).estimate()
    usual = Evaluator(model.within_reach()).value(plan).value
    assert usual < 0.8 * check.mean
    assert settled_value(model, plan, check, lambda: 0.0) == (check.mean, "monte-carlo")


def test_a_table_is_worth_no_less_than_a_plan_on_its_grid_where_a_window_ends_within_a_cell() -> None:
    problem = day(np.random.default_rng([757169976, 4]), most=5)
    model = Model.of(widened(problem, 10.0)).within_reach()
    plan = visits(problem, "A2", "A3", "A1", "A0")
    for nodes in ((49, 29), (97, 29), (145, 29)):
        worth = Backward(Grid(model, *nodes), compile_plan(model, plan)).total()
        assert Policy(Grid(model, *nodes, Rounding.MID)).best() >= worth * (1.0 - 1e-3)
