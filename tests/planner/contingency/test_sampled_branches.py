"""Branches grown on sampled futures: conditions, growth, and the answer on problems that no table holds."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
import pytest

from planner.contingency.long_routes import long_routes, plan_long, widened
from planner.contingency.reduction import live_sets_of
from planner.contingency.sampled.branches import better_by_branches, grow_branches
from planner.contingency.sampled.conditions import Arrivals, fitted_condition
from planner.contingency.sampled.futures import SCANNED, Change, Growth, Sampler
from planner.contingency.sampled.polish import Polisher, reordered
from planner.evaluate.grid import Grid
from planner.evaluate.model import MAX_BITS, Model
from planner.evaluate.monte_carlo import resume, simulate
from planner.evaluate.program import compile_plan
from planner.large_plans import plan_large
from planner.notes import annotate, annotate_sampled
from planner.plan_edits import options_of, steps_at, without_option
from planner.plan_tree import (
    Branch,
    Comparison,
    Condition,
    EnergyCondition,
    Navigate,
    Observe,
    Option,
    Path,
    Plan,
    PlanTree,
    TimeCondition,
    TrackedCondition,
    TrackStart,
    count_branches,
    planned_observations,
    walk,
)
from planner.problem import Problem
from planner.solve import solve
from planner.tally import Step, tallied
from tests.planner.examples import example, observation, visits


def _many(targets: int = 16, **more: object) -> Problem:
    rng = np.random.default_rng(4)
    places = [(float(rng.uniform(1, 14)), float(rng.uniform(-7, 7))) for _ in range(targets)]
    rows = [
        [observation(f"I{k}", utility=2.0 + k % 5), observation(f"P{k}", "place", utility=3.0 + k % 7)]
        for k in range(targets)
    ]
    return example(
        places=places,
        observations=rows,
        time_s=9000.0,
        loss=0.05,
        energy_j=1e6,
        **{"overrun_penalty": 15.0, **more},
    )


def _holds(when: tuple[Condition, ...], arrivals: Arrivals, model: Model) -> np.ndarray:
    mask = np.ones(len(arrivals.time_s), bool)
    for condition in when:
        match condition:
            case TimeCondition(comparison, value):
                mask &= (arrivals.time_s >= value) == (comparison is Comparison.GE)
            case EnergyCondition(comparison, value):
                mask &= (arrivals.energy_j >= value) == (comparison is Comparison.GE)
            case TrackedCondition(target, value):
                mask &= arrivals.kept(model.place_of[target]) == value
            case _:
                raise AssertionError
    return mask


@pytest.mark.parametrize("seed", range(6))
def test_a_fitted_condition_collects_what_it_says_and_no_single_test_much_more(seed: int) -> None:
    model = Model.of(example())
    rng = np.random.default_rng(seed)
    time_s, energy = rng.uniform(0, 5000, 300), rng.uniform(0, 4e5, 300)
    tracked = rng.integers(0, 2, 300) << 1
    gains = np.where(time_s > rng.uniform(0, 5000), 1.0, -1.0) + rng.normal(0, 0.3, 300)
    gains += np.where(tracked == 0, 0.6, -0.6)
    arrivals = Arrivals(time_s, energy, tracked)
    choice = fitted_condition(model, arrivals, gains, [1])
    assert choice.gain == pytest.approx(float(gains[_holds(choice.when, arrivals, model)].sum()), rel=1e-6)
    for threshold in np.sort(time_s):
        late = float(gains[time_s >= threshold].sum())
        assert max(late, float(gains.sum()) - late) <= choice.gain * 1.05 + 1e-9


def test_what_is_seen_at_a_step_is_what_the_plan_up_to_there_ends_with() -> None:
    problem = example(loss=0.3)
    model = Model.of(problem)
    plan = visits(problem, "O1", "O2", "O3")
    program = compile_plan(model, plan)
    whole = simulate(model, program, 3000, seed=5, watch=True)
    assert whole.seen is not None
    for k in range(1, len(plan)):
        part = simulate(model, plan[:k], 3000, seed=5)
        seen = whole.seen.time_s[:, program.step_row[(k,)]]
        there = ~np.isnan(seen)
        assert there.any()
        assert np.array_equal(seen[there], part.time_s[there])
        assert part.overrun[~there].all()


def test_a_changed_ending_earns_what_the_whole_changed_plan_earns() -> None:
    problem = _many(5)
    model = Model.of(problem)
    start = long_routes(problem, seed=1)[0]
    assert start is not None
    plan = grow_branches(model, start.plan, Growth(2, 1, iterations=900))[-1][1]
    assert count_branches(plan)
    sampler = Sampler(model, Growth(2, 5), lambda: False)
    line = sampler.line(plan)
    changes = [Change((*path[:-1], k), steps_at(plan, path)[j:]) for path, k, j in _later_parts(plan)]
    assert len(changes) > 5
    again = tuple(step for step in plan if not isinstance(step, TrackStart))
    changes += [Change(change.path, again) for change in changes]  # what is done cannot be done again
    for change in changes:
        whole = simulate(model, line.changed(change), 2000, seed=5).utility
        assert np.allclose(sampler.utility(line, change, 2000), whole, rtol=0.0, atol=1e-9)


def test_what_was_worked_out_before_another_change_is_what_the_whole_plan_earns() -> None:
    problem = _many(6)
    model = Model.of(problem)
    start = long_routes(problem, seed=1)[0]
    plan = grow_branches(model, start.plan, Growth(3, 1, iterations=2500))[-1][1]
    assert count_branches(plan) > 1
    sampler = Sampler(model, Growth(3, 5), lambda: False)
    for path, _ in reversed(list(options_of(plan))):  # the plan with fewer and fewer options
        line = sampler.line(plan)
        for at, k, j in _later_parts(plan):
            change = Change((*at[:-1], k), steps_at(plan, at)[j:])
            whole = simulate(model, line.changed(change), SCANNED, seed=5).utility
            assert np.allclose(sampler.utility(line, change, SCANNED), whole, rtol=0.0, atol=1e-9)
        plan = without_option(plan, path)


def test_futures_that_are_carried_out_again_and_conditions_count_as_work() -> None:
    model = Model.of(_many(5))
    line = Sampler(model, Growth(0, 5), lambda: False).line(long_routes(_many(5), seed=1)[0].plan)
    row = line.program.step_row[len(line.plan) - 1,]
    with tallied() as tally:
        resume(model, line.plan[-1:], line.standing(row, SCANNED), seed=5)
    assert tally.steps[Step.ACTION] >= len(line.standing(row, SCANNED).number) > 0
    there, arrivals = line.arrivals(row, SCANNED)
    with tallied() as tally:
        fitted_condition(model, arrivals, np.zeros(int(there.sum())), [])
    assert tally.seconds > 0.0


@pytest.mark.parametrize("seed", range(5))
def test_a_condition_takes_the_run_of_largest_sum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    time_s, gains = rng.uniform(0, 5000, 40), rng.normal(0, 1, 40)
    none = np.zeros(40, np.int64)
    choice = fitted_condition(Model.of(example()), Arrivals(time_s, time_s, none), gains, [])
    total = np.concatenate([[0.0], np.cumsum(gains[np.argsort(time_s)])])
    open_end = max(float((total[-1] - total).max()), float(total.max()))
    largest = max(float((total[k:] - total[k]).max()) for k in range(41))
    assert choice.gain == pytest.approx(largest if largest > 1.02 * open_end else open_end)


def test_visits_are_moved_whole_and_what_branches_off_stays() -> None:
    problem = _many(5)
    plan = visits(problem, "I0", "P1", "I2", "P3")
    late = Branch((Option((TimeCondition(Comparison.GE, 5000.0),), ()),))
    plan = (*plan[:6], late, *plan[6:])  # before the third drive
    found = [(*plan[:k], *rest) for k, rest in reordered(plan)]
    assert len(found) == len(set(found)) > 8
    assert plan not in found
    for changed in found:
        assert sorted(map(str, changed)) == sorted(map(str, plan))
        for k, step in enumerate(changed):
            if isinstance(step, Observe):
                before = changed[k - 1]
                assert isinstance(before, Navigate)
                assert before.to == step.target
    orders = {tuple(s.observation for s in changed if isinstance(s, Observe)) for changed in found}
    assert ("P3", "I0", "P1", "I2") in orders
    assert ("P1", "I2", "P3", "I0") in orders


def test_two_stops_in_the_wrong_order_are_turned_round() -> None:
    problem = example(
        places=[(2.0, 0.0), (4.0, 0.0), (6.0, 0.0), (8.0, 0.0)],
        observations=[[observation(f"O{k}", utility=5.0)] for k in range(4)],
        time_s=6000.0,
        loss=0.0,
        overrun_penalty=5.0,
    )
    model = Model.of(problem)
    sampler = Sampler(model, Growth(0, 5), lambda: False)
    line = sampler.line(visits(problem, "O0", "O2", "O1", "O3"))
    found = Polisher(sampler).polished(line, thoroughly=True)
    assert found.value > line.value * 1.02
    assert [s.observation for s in found.plan if isinstance(s, Observe)] == ["O0", "O1", "O2", "O3"]


def _later_parts(plan: Plan) -> Iterator[tuple[Path, int, int]]:
    """Yield a step, its place in its list, and how many steps from it on are left out."""
    for path, _ in walk(plan):
        left = len(steps_at(plan, path))
        for j in range(1, min(3, left) + 1):
            yield path, path[-1], j


def test_sampled_notes_agree_with_those_from_a_grid() -> None:
    problem = _many(3)
    model = Model.of(problem)
    start = long_routes(problem, seed=1)[0]
    assert start is not None
    plan = grow_branches(model, start.plan, Growth(2, 1, iterations=1500))[-1][1]
    sampled = annotate_sampled(model, PlanTree("x", plan), seed=3)
    exact = annotate(model, Grid(model, 61, 37), PlanTree("x", plan))
    for path, note in exact.step_notes.items():
        if note.p_reached > 0.05:
            assert sampled.step_notes[path].p_reached == pytest.approx(note.p_reached, abs=0.02)
            assert sampled.step_notes[path].time_s[2] == pytest.approx(
                note.time_s[2], rel=0.03, abs=150.0
            )  # a grid node
    for path, option in exact.option_notes.items():
        assert sampled.option_notes[path].p_taken == pytest.approx(option.p_taken, abs=0.02)
        assert sampled.option_notes[path].gain == pytest.approx(option.gain, abs=0.1)


def test_branches_grow_and_win_on_fresh_futures() -> None:
    problem = _many()
    assert live_sets_of(problem) is None
    found = plan_long(problem, Growth(1, 7, iterations=1500))
    assert found is not None
    fresh = [simulate(found.model, plan, 100_000, seed=99).utility.mean() for _, plan in found.curve]
    assert [count_branches(plan) <= k for k, (_, plan) in enumerate(found.curve)] == [True] * len(found.curve)
    assert count_branches(found.curve[-1][1]) > 0
    assert fresh[-1] > fresh[0] * 1.005
    again = plan_long(problem, Growth(1, 7, iterations=1500))
    assert again is not None
    assert again.curve == found.curve


def test_a_problem_that_no_table_holds_gets_branches_notes_and_a_bound() -> None:
    problem = _many()
    result = solve(problem, max_branches=1, iterations=500)
    assert result.status == "planned"
    assert result.evaluator == "monte-carlo"
    assert result.branches <= 1
    assert result.lower <= result.expected_utility <= result.upper < 0.9 * problem.utility_sum
    assert list(result.curve) == sorted(result.curve)
    assert len(result.curve) == 2
    assert result.tree.step_notes
    assert len(result.tree.option_notes) == result.branches


def test_a_large_plan_keeps_to_a_chance_of_overruns() -> None:
    free = _many(12, overrun_penalty=0.0)
    strict = dataclasses.replace(free, max_overrun_probability=0.02)
    found = [
        plan_large(
            problem,
            Growth(1, 3, iterations=60),
            most=1,
            fresh_seed=1,
            first_price=0.1 * problem.utility_sum,
            warm=(),
            should_stop=lambda: False,
            told=lambda plan, value: None,
        )
        for problem in (free, strict)
    ]
    assert found[0] is not None
    assert found[1] is not None
    assert found[0].check.overrun > 0.1
    assert simulate(found[1].model, found[1].plan, 100_000, seed=77).overrun.mean() <= 0.021
    assert found[1].check.mean > 0.5 * found[0].check.mean


def test_a_part_of_a_very_large_problem_holds_the_route_and_as_much_else_as_fits() -> None:
    problem = _many(40)
    names = {o.id for o in problem.observations[70:]}
    part = widened(problem, names)
    assert len(part.observations) == MAX_BITS
    assert names <= {o.id for o in part.observations}
    assert planned_observations(()) == set()


def test_routes_come_in_order_and_the_better_plan_of_each_number_of_branches_is_kept() -> None:
    routes = long_routes(_many(5), seed=1)
    assert len({route.plan for route in routes}) == len(routes) > 1
    assert [route.value for route in routes] == sorted((route.value for route in routes), reverse=True)
    a, b = routes[0].plan, routes[1].plan
    assert better_by_branches([(1.0, a), (2.0, a)], [(1.5, b)]) == [(1.5, b), (2.0, a)]
    assert better_by_branches([(1.0, a)], [(1.0, b), (3.0, b)]) == [(1.0, a), (3.0, b)]
