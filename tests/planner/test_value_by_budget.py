"""What a plan is told to be worth, where budgets grow and a grid over them becomes coarse."""

from __future__ import annotations

import numpy as np
import pytest

from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.evaluate.propagate import Evaluator
from planner.plan_choice import settled_value
from studies.common.planner_days import day
from studies.planner_budgets import PREDICTED_FALL, falls, found_at
from studies.planner_small import best_orders
from tests.planner.examples import example, visits
from tests.planner.reference.problems import generated


@pytest.mark.parametrize("number", [17, 28])
def test_a_larger_budget_does_not_lower_the_value_told(number: int) -> None:
    problem = day(np.random.default_rng([6002, number]), most=5)
    found = [found_at(problem, factor) for factor in (3.0, 10.0)]
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
    assert settled_value(model, plan, check, lambda: 0.0) is None


def test_where_no_grid_settles_the_check_tells_the_value() -> None:
    problem = generated("twice", 94464244, spread=0.05)
    model, plan = Model.of(problem), best_orders(problem)[0]
    check = simulate(model, plan, 200_000, seed=1).estimate()
    usual = Evaluator(model.within_reach()).value(plan).value
    assert usual < 0.8 * check.mean
    assert settled_value(model, plan, check, lambda: 0.0) == (check.mean, "monte-carlo")
