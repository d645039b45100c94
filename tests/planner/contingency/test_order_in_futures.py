"""Orders of observations judged in futures that all of them share."""

from __future__ import annotations

import itertools

import pytest

from planner.contingency.order_in_futures import SCANNED, best_orders
from planner.contingency.seeding import route_plan
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.plan_tree import Navigate, OnFail, Plan
from planner.solve import solve
from studies.planner_small import worse_than_an_order
from tests.planner.reference.problems import generated


def _asks_for_its_track(plan: Plan) -> list[bool]:
    return [step.require_tracked for step in plan if isinstance(step, Navigate)]


def test_a_drive_asks_for_the_track_of_its_own_stay_where_the_plan_comes_back() -> None:
    model = Model.of(generated("twice", 633634925))
    order = tuple(model.number_of[name] for name in model.observation_ids if name != "A3")
    placed = [bool(model.is_place[m]) for m in order]
    assert placed == [True, False, True, False]
    there_and_back = (order[0], order[2], order[1], order[3])
    assert _asks_for_its_track(route_plan(model, there_and_back)) == [True, True, False, False]
    assert _asks_for_its_track(route_plan(model, order)) == [False, False]
    stopping = route_plan(model, there_and_back, OnFail.STOP)
    assert _asks_for_its_track(stopping) == [False, False, False, False]


def test_of_few_observations_every_order_is_tried() -> None:
    model = Model.of(generated("twice", 7))
    found = best_orders(model, [(0,)], seed=1)
    every = [order for k in range(1, model.m + 1) for order in itertools.permutations(range(model.m), k)]
    earned = {o: simulate(model, route_plan(model, o), SCANNED, seed=1).utility.mean() for o in every}
    assert earned[found[0]] >= 0.999 * max(earned.values())


@pytest.mark.parametrize("number", [633634925])
def test_a_quick_plan_earns_what_the_best_order_does(number: int) -> None:
    problem = generated("twice", number)
    result = solve(problem, max_branches=3, time_limit_s=1.0, quick=True)
    assert not worse_than_an_order(problem, result.tree.plan, number)
