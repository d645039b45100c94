"""Orders of observations judged in futures that all of them share."""

from __future__ import annotations

import dataclasses
import itertools

import pytest

from planner.contingency.order_in_futures import SCANNED, best_routes, line_of
from planner.contingency.seeding import route_plan, routes_of
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.plan_tree import Navigate, OnFail, Plan
from planner.solve import solve
from studies.planner_small import with_must, worse_than_an_order
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
    found = best_routes(model, [(0,)], seed=1)
    every = [order for k in range(1, model.m + 1) for order in itertools.permutations(range(model.m), k)]
    earned = [simulate(model, route_plan(model, o), SCANNED, seed=1).utility.mean() for o in every]
    assert simulate(model, found[0], SCANNED, seed=1).utility.mean() >= 0.999 * max(earned)


@pytest.mark.parametrize(
    ("family", "number", "spread"),
    [
        ("twice", 633634925, 0.0),
        ("tracking", 320951744, 0.0),
        ("tracking", 436638792, 0.0),
        ("plain", 29845565, 0.0),
        ("failing", 851352120, 0.0),
        ("failing", 971198877, 0.0),
        ("failing", 352185768, 0.0),
        ("failing", 697948536, 0.0),
        ("twice", 76650376, 0.05),
        ("hub", 6581725, 0.2),
        ("precedence", 14945362, 0.5),
    ],
)
def test_a_quick_plan_earns_what_the_best_order_does(family: str, number: int, spread: float) -> None:
    problem = generated(family, number, spread=spread)
    result = solve(problem, max_branches=3, time_limit_s=1.0, quick=True)
    assert not worse_than_an_order(problem, result.tree.plan, number)


def test_a_plan_earns_what_the_best_order_does() -> None:
    problem = generated("twice", 94464244, spread=0.05)
    result = solve(problem, max_branches=3, time_limit_s=5.0)
    assert not worse_than_an_order(problem, result.tree.plan, 94464244)


@pytest.mark.parametrize(
    ("family", "number", "spread"), [("fading", 366054373, 0.0), ("twice", 660181379, 0.2)]
)
def test_what_must_be_done_costs_a_plan_no_more_than_an_order(
    family: str, number: int, spread: float
) -> None:
    problem = with_must(generated(family, number, spread=spread))
    result = solve(problem, max_branches=3, time_limit_s=1.0, quick=True)
    must = {o.id for o in problem.observations if o.must_do}
    assert must
    assert must <= set(line_of(result.tree.plan))
    assert not worse_than_an_order(problem, result.tree.plan, number)


@pytest.mark.parametrize(("family", "number"), [("failing", 480275424), ("through", 547293162)])
def test_a_limit_on_overruns_costs_a_plan_no_more_than_an_order(family: str, number: int) -> None:
    problem = dataclasses.replace(generated(family, number, spread=0.2), max_overrun_probability=0.02)
    result = solve(problem, max_branches=3, time_limit_s=1.0, quick=True)
    assert result.check is not None
    assert result.check.overrun <= 0.02
    assert not worse_than_an_order(problem, result.tree.plan, number)


def test_a_drive_that_nothing_leads_to_is_left_out_or_goes_round() -> None:
    model = Model.of(generated("failing", 851352120))
    assert not model.has_leg[1, 3]
    order = tuple(model.number_of[name] for name in ("A1", "A3"))
    ways = [[str(step.to) for step in plan if isinstance(step, Navigate)] for plan in routes_of(model, order)]
    assert ways == [["T1", "T2", "T3"], ["T1", "T3"]]
    assert len(routes_of(model, order[::-1])) == 1
