"""Policies that come back to a target, go through places and wait for the light: plans, bounds and CRL."""

from __future__ import annotations

import dataclasses
import itertools

import pytest

from benchmarks.executive_equality import compare
from planner.contingency.bounds import flow_bound, relaxed_bound, upper_bound
from planner.contingency.policy import Moves, Policy
from planner.contingency.reduction import moves_of, only, reduce_problem
from planner.evaluate.grid import Grid, Rounding
from planner.evaluate.model import Model
from planner.evaluate.propagate import Evaluator
from planner.plan_tree import Navigate, planned_observations
from planner.problem import ObservationId, Problem, problem_from_dict, problem_to_dict
from planner.solve import solve
from tests.planner.examples import amount, example, observation, problem_document, visits
from tests.planner.reference.optimum import optimum
from tests.planner.reference.problems import FAMILIES, generated


def hub(spread: float = 0.3) -> Problem:
    """Return a problem whose third target is reached through the first alone."""
    rows = [[observation(name, utility=10.0)] for name in ("H", "B", "C")]
    document = problem_document(observations=rows, spread=spread, loss=0.0, time_s=12_000.0, energy_j=2e6)
    pairs = {("start", "T1"), ("T1", "T2"), ("T2", "T1"), ("T1", "T3"), ("T3", "T1")}
    document["legs"] = [leg for leg in document["legs"] if (leg["from"], leg["to"]) in pairs]
    return problem_from_dict(document)


def light() -> Problem:
    """Return a problem of two rocks, each wanted in the light of the morning and of the evening."""
    rows = [
        [observation(f"{rock}1", utility=8.0, window_s=[0.0, 3000.0]),
         observation(f"{rock}2", utility=9.0, window_s=[6000.0, 9500.0])]
        for rock in "AB"
    ]  # fmt: skip
    places = [(3.0, 0.0), (3.0, 2.0)]
    return example(places=places, observations=rows, spread=0.2, time_s=11_000.0, energy_j=2e6)


def test_a_part_of_a_problem_keeps_the_places_that_lead_to_it() -> None:
    """Two hubs without work lie before the target that is worth most; nine others fill a table."""
    rows = [[observation(f"O{k}", utility=20.0 if k == 2 else 0.0 if k < 2 else 0.1)] for k in range(12)]
    places = [(2.0 + 2.0 * k, 0.0) for k in range(3)] + [(-4.0, -4.0 + k) for k in range(9)]
    document = problem_document(
        places=places, observations=rows, spread=0.2, loss=0.0, time_s=9000.0, energy_j=2e6
    )
    far = {("start", "T1"), ("T1", "T2"), ("T2", "T3")}
    document["legs"] = [
        leg
        for leg in document["legs"]
        if (leg["from"], leg["to"]) in far or not {leg["from"], leg["to"]} & {"T1", "T2", "T3"}
    ]
    problem = problem_from_dict(document)
    part = only(problem, {ObservationId("O2")})
    assert [t.id for t in part.targets if not t.observations] == ["T1", "T2"]
    assert Policy(Grid(Model.of(part), 33, 21), moves=Moves.ALL).best() > 15.0
    reduced = reduce_problem(problem, most_live_sets=10.0).problem
    assert Policy(Grid(Model.of(reduced), 33, 21), moves=Moves.ALL).best() > 15.0


@pytest.mark.parametrize("family", FAMILIES)
def test_no_bound_lies_below_what_the_best_policy_earns(family: str) -> None:
    for seed in range(12):
        problem = generated(family, seed)
        model, best = Model.of(problem), optimum(problem)
        assert upper_bound(model, limit_s=0.2).value >= best - 1e-9
        assert relaxed_bound(model).value >= best - 1e-9
        assert flow_bound(model, limit_s=5.0) >= best - 1e-9


@pytest.mark.parametrize("family", ["twice", "hub", "fading"])
def test_a_plan_earns_at_least_what_the_best_order_does(family: str) -> None:
    for seed in range(3):
        problem = generated(family, seed, spread=0.2)
        result = solve(problem, iterations=60, max_branches=2)
        model = Model.of(problem)
        evaluator = Evaluator(model, (25, 15), (33, 21))
        names = [str(o.id) for o in problem.observations]
        orders = itertools.chain.from_iterable(itertools.permutations(names, k) for k in (3, len(names)))
        best = max((visits(problem, *order) for order in orders), key=lambda p: evaluator.value(p).value)
        assert result.expected_utility >= 0.999 * Evaluator(model).value(best).value
        assert result.expected_utility <= result.upper * 1.001


def test_a_target_behind_another_is_reached_by_going_back_through_it() -> None:
    problem = hub()
    result = solve(problem, iterations=60, max_branches=2)
    assert planned_observations(result.tree.plan) == {"H", "B", "C"}
    assert [s.to for s in result.tree.plan if isinstance(s, Navigate)].count("T1") >= 1  # type: ignore[comparison-overlap]
    assert result.expected_utility == pytest.approx(30.0, rel=0.01)
    assert result.upper >= result.expected_utility * (1.0 - 1e-6)
    bare = dataclasses.replace(problem, name="bare")
    assert optimum(_constant(bare)) == pytest.approx(30.0)


def _constant(problem: Problem) -> Problem:
    document = problem_to_dict(problem)
    for leg in document["legs"]:
        leg["time_s"], leg["energy_j"] = (amount(leg[x]["mean"]) for x in ("time_s", "energy_j"))
    for target in document["targets"]:
        for o in target["observations"]:
            o["observe"] = {x: amount(o["observe"][x]["mean"]) for x in ("time_s", "energy_j")}
    return problem_from_dict(document)


def test_both_rocks_are_imaged_in_the_morning_and_again_in_the_evening() -> None:
    result = solve(light(), iterations=100, max_branches=2)
    assert planned_observations(result.tree.plan) == {"A1", "A2", "B1", "B2"}
    assert result.expected_utility == pytest.approx(34.0, rel=0.02)
    assert result.upper >= result.expected_utility * (1.0 - 1e-6)


@pytest.mark.parametrize("problem", [hub(), light()], ids=["hub", "light"])
def test_the_executive_carries_such_plans_out_as_they_were_valued(problem: Problem) -> None:
    result = solve(problem, iterations=40, max_branches=2)
    assert compare(problem_to_dict(problem), result.tree, 25, seed=3) == []


def test_a_forbidden_drive_is_gone_round() -> None:
    problem = example(places=[(4.0, 0.0), (6.0, 0.0), (8.0, 0.0)], loss=0.0, spread=0.2, time_s=12_000.0)
    legs = tuple(x for x in problem.legs if {x.origin, str(x.to)} not in ({"T1", "T3"}, {"start", "T3"}))
    without = dataclasses.replace(problem, legs=legs)
    result = solve(without, iterations=60, max_branches=2)
    assert "O3" in planned_observations(result.tree.plan)
    assert result.upper <= solve(problem, iterations=60, max_branches=2).upper * 1.01


def test_a_table_of_all_moves_is_worth_no_less_and_searched_where_that_matters() -> None:
    for problem in (light(), hub(), example()):
        model = Model.of(problem)
        grid = Grid(model, 25, 15, Rounding.DOWN)
        every = Policy(grid, moves=Moves.ALL)
        assert every.complete
        assert every.best() >= Policy(grid, moves=Moves.ONE_STAY).best() - 1e-9
    assert moves_of(Model.of(light())) is Moves.ALL
    assert moves_of(Model.of(hub())) is Moves.ALL
    assert moves_of(Model.of(example())) is Moves.TO_WORK


@pytest.mark.parametrize("seed", [0])
def test_a_hundred_times_the_budgets_give_a_plan_that_is_worth_no_less(seed: int) -> None:
    """Grids lay evenly over the budgets: two thirds of the value was lost, and the prediction with it."""
    problem = generated("penalty", seed, spread=0.3)
    found = []
    for factor in (2.0, 200.0):
        budget = problem.budget
        wider = dataclasses.replace(budget, time_s=factor * budget.time_s, energy_j=factor * budget.energy_j)
        found.append(solve(dataclasses.replace(problem, budget=wider), max_branches=1, iterations=30))
    less, more = found
    assert less.check is not None
    assert more.check is not None
    assert more.check.mean >= less.check.mean - 4.0 * less.check.standard_error
    assert more.expected_utility == pytest.approx(more.check.mean, rel=0.01)
