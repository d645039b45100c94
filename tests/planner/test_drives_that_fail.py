"""Drives that end short, with one meaning in documents, evaluators, policy, CRL and executive."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.common.draws import draw_table, earned
from benchmarks.executive_equality import compare
from planner.contingency.bounds import flow_bound, relaxed_bound
from planner.contingency.policy import Moves, Policy
from planner.errors import ProblemError
from planner.evaluate.grid import Grid, Rounding
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import estimate, resume, simulate
from planner.evaluate.program import compile_plan
from planner.evaluate.propagate import Evaluator, State, forward, run_in
from planner.plan_tree import Navigate, Observe, OnFail, PlanTree
from planner.problem import Problem, TargetId, problem_from_dict, problem_to_dict
from planner.solve import solve
from tests.planner.examples import example, observation, problem_document, problems, visits
from tests.planner.reference.optimum import optimum
from tests.planner.reference.problems import generated

SKIP = OnFail.SKIP


def failing(p_fail: float = 0.3, **more: Any) -> Problem:
    """Return the example with drives that fail with this chance."""
    problem = example(**more)
    legs = tuple(dataclasses.replace(leg, p_fail=p_fail) for leg in problem.legs)
    return dataclasses.replace(problem, legs=legs)


def test_a_problem_says_the_oldest_format_that_can_say_all_of_it() -> None:
    document = problem_document()
    assert problem_to_dict(problem_from_dict(document))["format"] == "problem/1"
    sure = problem_from_dict({**document, "format": "problem/2"})
    assert problem_to_dict(sure)["format"] == "problem/1"
    assert sure.digest() == problem_from_dict(document).digest()
    document["legs"][0]["p_fail"] = 0.25
    with pytest.raises(
        ProblemError, match=r"legs\[start -> T1\].p_fail is 0.25; .* need the format problem/2"
    ):
        problem_from_dict(document)
    read = problem_from_dict({**document, "format": "problem/2"})
    assert read.legs[0].p_fail == 0.25
    written = problem_to_dict(read)
    assert written["format"] == "problem/2"
    assert problem_from_dict(written) == dataclasses.replace(read, source_format="problem/2")
    assert read.digest() != sure.digest()
    document["legs"][0]["p_fail"] = 1.5
    with pytest.raises(ProblemError, match=r"p_fail is 1.5; it must be at most 1"):
        problem_from_dict({**document, "format": "problem/2"})


def test_grid_samples_and_table_agree_on_a_plan_that_goes_on_after_a_failure() -> None:
    problem = failing(0.3, loss=0.1, time_s=9000.0)
    model, plan = Model.of(problem), visits(problem, "O1", "O2", "O3")
    value = Evaluator(model).value(plan).value
    sampled = estimate(model, plan, 200_000, seed=3)
    assert abs(value - sampled.mean) < 4.0 * sampled.standard_error + 0.0005 * abs(value)
    table = earned(problem, plan, draw_table(problem, 20_000, seed=4))
    assert abs(float(table.utility.mean()) - value) < 4.0 * float(np.std(table.utility)) / 20_000**0.5
    assert value < 0.9 * Evaluator(Model.of(failing(0.0, loss=0.1, time_s=9000.0))).value(plan).value


def test_a_place_to_which_a_drive_failed_is_not_driven_to_again() -> None:
    """T2 lies on the way out and back: the second drive to it takes nothing, and finds nothing."""
    problem = failing(1.0, spread=0.0, loss=0.0, time_s=20_000.0, energy_j=5e6)
    sure = {("start", "T1")}
    legs = tuple(
        dataclasses.replace(leg, p_fail=0.0) if (leg.origin, leg.to) in sure else leg for leg in problem.legs
    )
    problem = dataclasses.replace(problem, legs=legs)
    to = {k: TargetId(f"T{k}") for k in (1, 2)}
    o1, o2 = (problem.targets[k].observations[0].id for k in (0, 1))
    once = (Navigate(to[2], False, SKIP), Observe(o2, to[2], SKIP), Navigate(to[1], False, SKIP))
    twice = (*once, Navigate(to[2], False, SKIP), Observe(o2, to[2], SKIP), Observe(o1, to[1], SKIP))
    model = Model.of(problem)
    one, both = (simulate(model, plan, 4, seed=1) for plan in (once, twice))
    leg = {(leg.origin, leg.to): leg for leg in problem.legs}
    expected = leg["start", "T2"].time_s.mean + leg["start", "T1"].time_s.mean
    assert one.time_s == pytest.approx(np.full(4, expected))
    assert both.time_s == pytest.approx(one.time_s)  # `place` needs a track: nothing is made
    program = compile_plan(model, twice)
    flow = forward(Grid(model, 61, 37), program)
    (end,) = flow[0]
    assert end == State(1, 0, 0, 1 << 2)
    assert Evaluator(model).value(twice).value == pytest.approx(0.0, abs=1e-9)
    assert run_in(model, program, program.entry).state == State(0, 0, 0)


def test_futures_that_go_on_from_a_row_know_where_a_drive_has_failed() -> None:
    problem = failing(0.5, loss=0.0, time_s=20_000.0, energy_j=5e6)
    model = Model.of(problem)
    to = TargetId("T2")
    o2 = problem.targets[1].observations[0].id
    head = (Navigate(to, False, SKIP), Navigate(TargetId("T3"), False, SKIP))
    rest = (Navigate(to, False, SKIP), Observe(o2, to, SKIP))
    whole = compile_plan(model, (*head, *rest), mark_ends=True)
    futures = simulate(model, whole, 2000, seed=9, watch=True)
    assert futures.seen is not None
    standing = futures.seen.at(whole.step_row[(2,)], 2000)
    again = resume(model, rest, standing, seed=9)
    assert np.array_equal(again, futures.utility[standing.number])
    assert 0 < np.count_nonzero(standing.closed) < len(standing.closed)


@pytest.mark.parametrize("seed", range(4))
def test_the_policy_is_worth_what_trying_every_choice_earns(seed: int) -> None:
    problem = generated("failing", seed)
    best = optimum(problem)
    assert best < optimum(
        dataclasses.replace(problem, legs=tuple(dataclasses.replace(leg, p_fail=0.0) for leg in problem.legs))
    )
    for nodes in ((9, 8), (33, 38)):
        down = Policy(Grid(Model.of(problem), *nodes, Rounding.DOWN), moves=Moves.ALL).best()
        up = Policy(Grid(Model.of(problem), *nodes, Rounding.UP), moves=Moves.TO_WORK).best()
        assert up - 1e-4 <= best <= down + 1e-4


def test_bounds_without_a_table_know_how_seldom_a_place_is_come_to() -> None:
    """Enough of everything, and one drive in two to each target fails whatever way is taken: who goes to each
    in turn earns half of all, and nobody more.
    """
    problem = failing(0.5, spread=0.0, loss=0.0, time_s=50_000.0, energy_j=2e7)
    model, half = Model.of(problem), 0.5 * problem.utility_sum
    plan = visits(problem, *(str(o.id) for o in problem.observations))
    assert estimate(model, plan, 100_000, seed=2).mean == pytest.approx(half, rel=0.01)
    for found in (flow_bound(model, limit_s=1.0), relaxed_bound(model).value):
        assert half - 1e-6 <= found <= 1.02 * half


def test_the_planner_reckons_with_them_and_the_executive_earns_what_it_says() -> None:
    rows = [[observation(f"O{k}", "place" if k % 2 else "image", utility=5.0 + k)] for k in range(4)]
    places = [(4.0, 1.0), (6.0, -2.0), (3.0, -4.0), (-3.0, 2.0)]
    for p_fail, seed in itertools.product((0.1, 0.4), (1, 2)):
        problem = failing(p_fail, places=places, observations=rows, overrun_penalty=8.0)
        found = solve(problem, max_branches=4, time_limit_s=4.0, seed=seed)
        assert found.check is not None
        gap = abs(found.expected_utility - found.check.mean)
        assert gap < 4.0 * found.check.standard_error + 0.002 * found.upper
        assert found.lower <= found.upper
        assert not compare(problem_to_dict(problem), found.tree, 150, seed)


@settings(max_examples=15, deadline=None)
@given(
    problems(),
    st.lists(st.floats(0.0, 1.0, width=16), min_size=16, max_size=16),
    st.booleans(),
    st.integers(0, 99),
)
def test_any_plan_means_the_same_to_evaluator_and_executive(
    problem: Problem, chances: list[float], stop: bool, seed: int
) -> None:
    legs = [
        dataclasses.replace(leg, p_fail=p)
        for leg, p in zip(problem.legs, itertools.cycle(chances), strict=False)
    ]
    problem = dataclasses.replace(problem, legs=tuple(legs))
    names = [str(o.id) for o in problem.observations][:4]
    plan = visits(problem, *names, *names[:1], on_fail=OnFail.STOP if stop else SKIP)
    assert not compare(problem_to_dict(problem), PlanTree(problem.name, plan), 40, seed)
