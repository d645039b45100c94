"""Downlink volume and the chance constraint: what a plan may not do, and what no plan earns more than."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest

from planner.constraints.overrun import OverrunChance
from planner.contingency.bounds import relaxed_bound, upper_bound
from planner.contingency.chance import keeps_to, plans_within
from planner.contingency.policy import LiveSets, Policy
from planner.contingency.reduction import only, reduce_problem
from planner.evaluate.grid import Grid, Rounding
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.plan_tree import Branch, Comparison, Observe, Option, Plan, Stop, TimeCondition, Visit, ways
from planner.problem import ObservationId, Problem, TargetId, load_problem
from planner.solve import PlanStatus, solve
from tests.planner.examples import example, observation, visits
from tests.shared import shared

VOLUMES = {"T1": 10.0, "T2": 20.0, "T3": 15.0, "T4": 30.0, "T5": 12.0}
GRID = (33, 21)


def _limited(limit_mbit: float | None) -> Problem:
    """Return dev-tracking-5 with downlink volumes."""
    problem = load_problem(shared("contingency/instances/dev-tracking-5.json"))
    targets = tuple(
        dataclasses.replace(
            t,
            observations=tuple(dataclasses.replace(o, data_mbit=VOLUMES[o.id]) for o in t.observations),
        )
        for t in problem.targets
    )
    budget = dataclasses.replace(problem.budget, data_mbit=limit_mbit)
    return dataclasses.replace(problem, targets=targets, budget=budget, source_format="problem/1")


def _optimum(problem: Problem) -> float:
    return Policy(Grid(Model.of(problem), *GRID, Rounding.MID, np.float32)).best()


def _largest(problem: Problem, plan: Plan) -> float:
    volume = {o.id: o.data_mbit for o in problem.observations}
    return max(sum(volume[name] for name in way) for way in ways(plan))


def _step(name: str) -> Observe:
    return Observe(ObservationId(name), TargetId(name))


def test_a_way_through_a_plan_holds_what_may_be_made_on_it() -> None:
    late = (TimeCondition(Comparison.GE, 100.0),)
    plan: Plan = (
        _step("A"),
        Branch((Option(late, (Visit(ObservationId("B"), TargetId("B")), Stop(), _step("X"))),)),
        _step("C"),
    )
    assert set(ways(plan)) == {frozenset({"A", "B"}), frozenset({"A", "C"})}


@pytest.mark.parametrize("strategy", ["optimal", "pico2005"])
@pytest.mark.parametrize("limit_mbit", [12.0, 30.0, 45.0])
def test_no_way_through_a_plan_exceeds_the_downlink_volume(strategy: str, limit_mbit: float) -> None:
    problem = _limited(limit_mbit)
    result = solve(problem, strategy=strategy, max_branches=3, iterations=150)
    assert result.status is PlanStatus.PLANNED
    assert _largest(problem, result.tree.plan) <= limit_mbit
    assert result.lower <= result.expected_utility <= result.upper


def test_the_table_chooses_what_to_send_as_the_day_goes() -> None:
    problem = _limited(30.0)
    names = list(VOLUMES)
    fixed = max(
        _optimum(dataclasses.replace(only(problem, {ObservationId(x) for x in chosen}), name="part"))
        for count in (1, 2, 3)
        for chosen in itertools.combinations(names, count)
        if sum(VOLUMES[x] for x in chosen) <= 30.0
    )
    free = _optimum(_limited(None))
    limited = _optimum(problem)
    assert fixed * 1.01 < limited < free
    plan = solve(problem, max_branches=4, iterations=400)
    assert plan.expected_utility > fixed * 1.01
    assert plan.upper >= limited * 0.999


def test_more_downlink_volume_never_lowers_the_optimum_or_its_bounds() -> None:
    limits = (0.0, 11.0, 26.0, 43.0, 60.0, 87.0, None)
    optima = [_optimum(_limited(limit)) for limit in limits]
    assert optima == sorted(optima)
    assert optima[0] == 0.0
    for limit, optimum in zip(limits, optima, strict=True):
        model = Model.of(_limited(limit))
        assert relaxed_bound(model).value >= optimum * 0.999
        assert upper_bound(model, limit_s=0.5).value >= optimum * 0.999
    bounds = [relaxed_bound(Model.of(_limited(limit))).value for limit in limits]
    assert bounds == sorted(bounds)
    assert bounds[1] < bounds[-1]


def test_what_no_longer_fits_is_given_up_and_what_fits_needs_no_memory() -> None:
    model = Model.of(_limited(45.0))
    sets = LiveSets(model, 0b11111)
    every = sets.initial(0b111110)
    after = sets.after(every, 3)
    assert after.bits == 0b10101  # 15 Mbit are left: T2 is too large
    model = Model.of(_limited(57.0))
    assert LiveSets(model, 0b11111).after(every, 3).memory == 0b01000
    assert LiveSets(model, 0b10111).voluminous == 0  # 57 Mbit in all


def test_too_many_targets_are_planned_within_the_volume_too() -> None:
    places = [(3.0 + (k % 6), -4.0 + 1.6 * (k // 6)) for k in range(24)]
    rows = [[observation(f"O{k + 1}", utility=1.0 + (k % 7), data_mbit=10.0)] for k in range(24)]
    problem = example(places=places, observations=rows)
    problem = dataclasses.replace(problem, budget=dataclasses.replace(problem.budget, data_mbit=30.0))
    assert not reduce_problem(problem).exact
    result = solve(problem, max_branches=1, iterations=20, time_limit_s=60.0)
    assert 0.0 < _largest(problem, result.tree.plan) <= 30.0
    assert result.expected_utility <= result.upper


# ------------------------------------------------------------------------------------- chance


def test_the_bound_under_a_chance_constraint_is_tighter_and_holds() -> None:
    problem = example(spread=0.6, time_s=4200.0)
    free = solve(problem, max_branches=1, iterations=20)
    values = []
    for allowed in (0.1, 0.01):
        bound = dataclasses.replace(problem, max_overrun_probability=allowed)
        result = solve(bound, max_branches=1, iterations=20)
        assert result.check is not None
        assert result.check.overrun <= allowed
        # each bound is from a grid of its own
        assert result.lower <= result.expected_utility <= result.upper <= free.upper * 1.003
        values.append(result)
    assert [r.expected_utility for r in values] == sorted((r.expected_utility for r in values), reverse=True)
    assert values[-1].upper < 0.95 * free.upper
    assert values[-1].upper >= values[-1].expected_utility


def test_a_chance_of_nothing_leaves_nothing_to_do_and_says_so() -> None:
    problem = dataclasses.replace(example(spread=0.6, time_s=4200.0), max_overrun_probability=0.0)
    result = solve(problem, max_branches=1, iterations=30)
    assert result.status is PlanStatus.EMPTY
    assert "no plan found keeps the chance of ending over a budget within 0" in result.reasons[0]


def test_what_must_be_done_against_the_chance_is_infeasible() -> None:
    rows = [[observation("A")], [observation("B", must_do=True)]]
    problem = example(places=[(4.0, 1.0), (7.0, -3.0)], observations=rows, time_s=2900.0, spread=0.8)
    strict = dataclasses.replace(problem, max_overrun_probability=0.001)
    result = solve(strict, max_branches=1, iterations=30)
    assert result.status is PlanStatus.INFEASIBLE
    assert (
        "observation B must be done, but no plan found does that with a chance of at most 0.001"
        in (result.reasons[0])
    )


def test_a_plan_keeps_to_a_chance_with_room_for_the_error() -> None:
    problem = example(spread=0.6, time_s=4200.0)
    model = Model.of(problem)
    plan = visits(problem, "O1", "O2", "O3")
    share = float(np.mean(simulate(model, plan, 200_000, seed=5).overrun))
    assert not keeps_to(model, plan, OverrunChance(share), seed=5)
    assert keeps_to(model, plan, OverrunChance(share + 0.01), seed=5)


def test_the_price_of_an_overrun_is_closed_in_on() -> None:
    asked: list[tuple[float, bool]] = []

    def find(price: float, quick: bool) -> list[Plan]:
        asked.append((price, quick))
        return [(_step(f"P{price:.3f}"),)]

    def keeps(plan: Plan) -> bool:
        step = plan[0]
        assert isinstance(step, Observe)
        return float(step.observation[1:]) >= 7.0

    plans, prices = plans_within(find, keeps, first_price=1.0, should_stop=lambda: False)
    assert asked[0] == (0.0, False)
    assert asked[-1][1] is False
    assert prices[0] == 0.0
    assert prices[1] < 7.0 <= prices[2] < 7.2
    assert all(keeps(plan) for plan in plans)


@pytest.mark.parametrize("name", ["resource-4", "windows-4"])
def test_a_time_budget_that_energy_never_lets_one_use_makes_no_plan_worse(name: str) -> None:
    problem = load_problem(shared(f"contingency/instances/dev-{name}.json"))

    def planned(times: float) -> float:
        budget = dataclasses.replace(problem.budget, time_s=times * problem.budget.time_s)
        wider = dataclasses.replace(problem, budget=budget)
        result = solve(wider, max_branches=2, iterations=40)
        assert result.check is not None
        assert result.expected_utility == pytest.approx(result.check.mean, rel=3e-3)
        return result.expected_utility

    values = [planned(times) for times in (1.0, 4.0, 30.0, 1e9)]
    assert all(after >= 0.9995 * before for before, after in itertools.pairwise(values))
    assert values[2] == values[3]
