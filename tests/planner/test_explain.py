"""Why-not: the cost of an observation against every order that makes it, and budgets that let it in."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from planner.evaluate.model import Model
from planner.evaluate.propagate import Evaluator
from planner.explain import why_not
from planner.plan_tree import planned_observations
from planner.problem import Problem
from planner.solve import solve
from studies.common.planner_days import day
from tests.planner.examples import visits
from tests.planner.reference.problems import generated


def _best_orders(problem: Problem, name: str) -> tuple[float, float]:
    """Return the value of the best order of all, and of the best that goes for an observation."""
    evaluator = Evaluator(Model.of(problem))
    names = [str(o.id) for o in problem.observations]
    values = {
        order: evaluator.value(visits(problem, *order)).value
        for k in range(1, len(names) + 1)
        for order in itertools.permutations(names, k)
    }
    return max(values.values()), max(v for order, v in values.items() if name in order)


@pytest.mark.parametrize("seed", range(6))
def test_what_an_observation_would_cost_is_what_the_best_order_with_it_loses(seed: int) -> None:
    problem = generated("plain", seed, spread=0.3)
    budget = dataclasses.replace(problem.budget, time_s=0.55 * problem.budget.time_s)
    problem = dataclasses.replace(problem, budget=budget)
    plan = solve(problem, iterations=40, max_branches=0).tree.plan
    for o in problem.observations:
        if o.id in planned_observations(plan):
            continue
        found = why_not(problem, plan, str(o.id), futures=50_000)
        free, forced = _best_orders(problem, str(o.id))
        assert o.id in planned_observations(found.forced)
        assert found.change == pytest.approx(forced - free, abs=0.01 * free + 3.0 * found.standard_error)
        if found.relaxation is not None:
            assert 1.0 < found.relaxation.factor <= 3.0


def test_what_gives_way_is_in_the_plan_that_was_asked_about() -> None:
    """The plan holds one observation only: another best plan may hold more, and nobody loses those."""
    problem = generated("plain", 1, spread=0.3)
    budget = dataclasses.replace(problem.budget, time_s=0.55 * problem.budget.time_s)
    problem = dataclasses.replace(problem, budget=budget)
    first, *others = problem.observations
    plan = visits(problem, str(first.id))
    for o in others:
        found = why_not(problem, plan, str(o.id), futures=2_000)
        assert set(found.displaced) == {first.id} - planned_observations(found.forced)


def test_a_forced_observation_is_made_in_the_best_order_that_holds_it() -> None:
    """A beam that the optimal policy leads passed by this order, and asked 11 % of the value too much."""
    rng = np.random.default_rng(164)
    problem = day(rng, least=4, most=4)
    budget = dataclasses.replace(problem.budget, time_s=0.6 * problem.budget.time_s)
    problem = dataclasses.replace(problem, budget=budget)
    _, best = _best_orders(problem, "A3")
    plan = solve(problem, iterations=40, max_branches=0).tree.plan
    assert "A3" not in planned_observations(plan)
    found = why_not(problem, plan, "A3")
    assert Evaluator(Model.of(problem)).value(found.forced).value == pytest.approx(best, rel=1e-3)
