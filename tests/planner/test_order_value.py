"""The compiled values of orders are those of the evaluator; all orders counted and drawn futures agree."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from planner.contingency.seeding import route_plan
from planner.contingency.why_not.limits import OF_ENERGY, OF_TIME, WINDOW, widened
from planner.contingency.why_not.order_layers import PASSES, layers_of
from planner.contingency.why_not.order_run import steps_of
from planner.contingency.why_not.order_value import HARDLY, QUICK, SELDOM, OrderValues, _kernels
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.evaluate.propagate import FINE, Evaluator
from studies.common.all_orders import AllOrders
from studies.common.planner_days import day
from studies.planner_why_not import drawn
from tests.planner.reference.problems import ALL_FAMILIES, generated


@pytest.mark.parametrize("family", ALL_FAMILIES)
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("share", [0.4, 1.0])
def test_an_order_is_worth_what_the_evaluator_says(family: str, seed: int, share: float) -> None:
    problem = generated(family, seed, spread=0.4)
    budget = dataclasses.replace(problem.budget, time_s=share * problem.budget.time_s)
    model = Model.of(dataclasses.replace(problem, budget=budget))
    values, evaluator, rng = OrderValues(model), Evaluator(model), np.random.default_rng(seed)
    for count in range(model.m + 1):
        order = tuple(int(m) for m in rng.permutation(model.m)[:count])
        wanted = evaluator.value(route_plan(model, order)).value
        assert values[order] == pytest.approx(wanted, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_an_order_of_eight_with_windows_is_worth_what_the_evaluator_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = Model.of(day(rng, least=8, most=8))
    order = tuple(int(m) for m in rng.permutation(model.m)[: 5 + seed % 4])
    wanted = Evaluator(model).value(route_plan(model, order)).value
    assert OrderValues(model)[order] == pytest.approx(wanted, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_short_numbers_and_nodes_left_out_change_a_value_by_a_millionth_of_a_day(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = Model.of(day(rng, least=8, most=8))
    order = tuple(int(m) for m in rng.permutation(model.m)[:6])
    quick, exact = OrderValues(model, quick=True), OrderValues(model)
    within = 1e-6 * (float(model.utility @ model.p_success) + model.penalty)
    assert quick.evaluated(order) == pytest.approx(exact[order], abs=within)
    for nodes in QUICK:
        short, long = (values._on(nodes, order, values._kinds) for values in (quick, exact))
        assert short == pytest.approx(long, abs=within)


def test_of_the_nodes_of_a_dear_order_few_are_worked_out_and_its_value_stays() -> None:
    """Its 543 states that act took half of the time of the dearest of 173 questions."""
    problem = drawn(616_263, 13, [8, 8])
    wide = widened(problem, problem.observations[5], (OF_TIME, OF_ENERGY, WINDOW), 2.4)
    order, (nt, ng) = (0, 4, 6, 5, 1, 2, 7, 3), FINE
    values = OrderValues(Model.of(wide), quick=True)
    ((_, costs, world, windows),) = values._kinds
    steps = steps_of(np.array(order), world.obs_place, world.is_place, values._ways)
    placed = [m for m in order if world.is_place[m]]
    plan = layers_of(steps, sum(1 << int(world.obs_place[m]) for m in placed), world, windows, costs)
    start = [
        len(placed) * costs.track_t / costs.t_max * (nt - 1),
        len(placed) * costs.track_e / costs.e_max * (ng - 1),
    ]
    kernels = _kernels(plan, steps, costs, world, windows, nt, ng, np.array(start), HARDLY, SELDOM)
    first, past, left, right = kernels.met[: plan.first[len(steps)]][
        plan.what[: plan.first[len(steps)]] != PASSES
    ].T
    assert len(first) == 543
    assert ((past - first) * (right - left)).mean() < 0.15 * nt * ng
    long = OrderValues(values.model)._on(FINE, order, values._kinds)
    assert values._on(FINE, order, values._kinds) == pytest.approx(long, rel=3e-6)


@pytest.mark.parametrize("seed", range(4))
def test_the_chance_of_an_observation_is_the_share_of_futures_that_make_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = Model.of(day(rng, least=6, most=6))
    order = tuple(int(m) for m in rng.permutation(model.m)[:5])
    asked = order[-1]
    only = dataclasses.replace(model, utility=np.eye(model.m)[asked], p_success=np.ones(model.m), penalty=0.0)
    share = float(simulate(only, route_plan(model, order), 40_000, seed=1).utility.mean())
    assert OrderValues(model, quick=True).chance(order, asked) == pytest.approx(share, abs=0.01)


@pytest.mark.parametrize("seed", range(4))
def test_the_best_order_is_that_of_the_evaluator_though_few_are_asked_of_its_grid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = day(rng, least=6, most=6)
    budget = dataclasses.replace(problem.budget, time_s=0.5 * problem.budget.time_s)
    model = Model.of(dataclasses.replace(problem, budget=budget))
    orders = list(itertools.permutations(rng.permutation(6)[:4].tolist()))
    exact, quick = OrderValues(model), OrderValues(model, quick=True)
    best = quick.best(orders)
    most = max(exact[order] for order in orders)
    assert exact[best] >= most - 1e-3 * abs(most)
    assert quick[best] == pytest.approx(exact[best], rel=1e-3)
    behind = [order for order in orders if quick.behind(order, best) > 0.02]
    assert behind
    assert all(exact[order] < most - 0.01 * abs(most) for order in behind)


def test_larger_grids_are_asked_of_no_order_that_is_surely_behind_nor_of_ends_that_no_day_comes_to() -> None:
    model = Model.of(day(np.random.default_rng(2), least=6, most=6))
    values = OrderValues(model, quick=True)
    assert not values._may_be_better((9.0, 9.1), (10.0, 10.3))  # may be 0.2 more at most
    assert values._may_be_better((9.9, 9.8), (10.0, 10.3))  # grids say otherwise of either
    assert not values._may_be_better((10.0, 9.9), (10.00001, 9.90001))
    assert values._may_be_better((9.99, 9.8), (10.0, 9.9))


@pytest.mark.parametrize("seed", range(3))
def test_all_orders_that_are_counted_are_worth_what_grids_say(seed: int) -> None:
    problem = day(np.random.default_rng(seed), least=4, most=4)
    values, futures = OrderValues(Model.of(problem)), 20_000
    worths = AllOrders(problem, futures, seed=seed).worths()
    assert len(worths) == 64
    spread = sum(o.utility for o in problem.observations) + problem.overrun_penalty
    for order, worth in worths.items():
        assert worth == pytest.approx(values[order], abs=2.5 * spread / futures**0.5)
