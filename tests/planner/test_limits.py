"""Limits count work: the same order gives the same plan at any load, a stop is heard wherever the work is."""

from __future__ import annotations

import itertools
import time
from typing import Any

import numpy as np
import pytest

from planner.contingency.bounds import Bound, drives_of, rounded_down, tables_above
from planner.contingency.policy import LiveSets, Moves, Policy
from planner.evaluate.grid import Grid
from planner.evaluate.model import Model
from planner.evaluate.program import compile_plan
from planner.evaluate.propagate import Backward
from planner.notes import sketch
from planner.options import PlannerOptions
from planner.orienteering import solve as solve_routing
from planner.orienteering.engines import warm_up_exact
from planner.orienteering.problem import Experiment, RoutingProblem
from planner.plan_tree import plan_tree_to_dict
from planner.problem import problem_from_dict
from planner.progress import Watch
from planner.solve import PlanStatus, solve
from planner.stages import LEFT_SHARE, Order, bounded
from planner.strategies import Found
from planner.tally import SECONDS, Step, StoppedError, spend, tallied
from tests.planner.examples import example, observation, problem_document, visits


def _large(targets: int) -> Any:
    rng = np.random.default_rng(3)
    places = [(float(x), float(y)) for x, y in rng.uniform(-12.0, 12.0, (targets, 2))]
    rows = [
        [observation(f"I{k}", utility=float(k % 7 + 1)), observation(f"P{k}", "place", 4.0)]
        for k in range(targets)
    ]
    return problem_from_dict(
        problem_document(places=places, observations=rows, time_s=20_000.0, energy_j=2e6)
    )


def test_a_clock_that_runs_away_leaves_a_plan_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = example(time_s=4000.0)
    calm = solve(problem, time_limit_s=0.5)
    ticks = itertools.count(0.0, 1000.0)
    for clock in ("monotonic", "perf_counter", "thread_time", "process_time"):
        monkeypatch.setattr(time, clock, lambda: next(ticks))
    hectic = solve(problem, time_limit_s=0.5)
    assert hectic.work_s == calm.work_s
    assert plan_tree_to_dict(hectic.tree, problem) == plan_tree_to_dict(calm.tree, problem)
    assert (hectic.upper, hectic.curve) == (calm.upper, calm.curve)


def test_what_is_done_once_a_process_is_not_counted() -> None:
    problem = example(time_s=4000.0)
    solve(problem, time_limit_s=0.5)
    later = solve(problem, time_limit_s=0.5)
    warm_up_exact.cache_clear()
    assert solve(problem, time_limit_s=0.5).work_s == later.work_s


def test_a_search_that_is_cut_short_says_how_much_was_done() -> None:
    problem = example(spread=0.9, overrun_penalty=10.0, time_s=4500.0)
    whole, cut = solve(problem, time_limit_s=60.0), solve(problem, time_limit_s=0.2)
    assert whole.searched == 1.0
    assert cut.searched < 1.0
    assert cut.status is PlanStatus.PLANNED
    assert cut.work_s < whole.work_s


@pytest.mark.parametrize("after", [0, 5, 40, 100])
def test_a_stop_is_answered_within_a_second_of_work_wherever_it_comes(after: int) -> None:
    asked = 0

    def stop() -> bool:
        nonlocal asked
        asked += 1
        return asked > after

    with tallied() as tally:
        at_stop: list[float] = []

        def stop_and_note() -> bool:
            if stop():
                at_stop.append(tally.seconds)
                return True
            return False

        result = solve(_large(12), time_limit_s=600.0, should_stop=stop_and_note)
    assert at_stop, "it ended before it was stopped"
    assert tally.seconds - at_stop[0] < 1.0
    assert result.status in (PlanStatus.PLANNED, PlanStatus.TIMEOUT)
    assert result.lower <= result.expected_utility <= result.upper
    assert after < 100 or result.status is PlanStatus.PLANNED


def test_a_survey_keeps_to_a_limit_that_a_bound_would_break() -> None:
    """200 nodes: the table of the exact engine alone took 15 s of 1 s."""
    rng = np.random.default_rng(200)
    xy = rng.uniform(0.0, 1000.0, (201, 2))
    roads = np.ceil(np.linalg.norm(xy[:, None] - xy[None], axis=2)).astype(np.int64)
    prizes = tuple(Experiment(k, k, int(rng.integers(1, 100))) for k in range(1, 200))
    problem = RoutingProblem(roads, 0 * roads, prizes, 5000, end_site=200)
    with tallied() as tally:
        first = solve_routing(problem, time_limit_s=1.0, seed=1)
        assert 0.8 < tally.seconds < 1.2
    again = solve_routing(problem, time_limit_s=1.0, seed=1)
    assert (again.route, again.upper) == (first.route, first.upper)


def test_steps_are_counted_once_in_the_outermost_tally_and_a_stop_is_raised_once() -> None:
    spend(Step.LABEL)  # where no tally is kept, nothing is
    with tallied() as outer:
        with tallied() as inner:
            spend(Step.LABEL, 10)
        assert inner is outer
        assert outer.seconds == pytest.approx(10 * SECONDS[Step.LABEL])
        outer.stop = lambda: True
        with pytest.raises(StoppedError):
            spend(Step.LABEL)
        spend(Step.LABEL)


def _failing(targets: int, p_fail: float) -> Any:
    places = [(4.0 * np.cos(k), 4.0 * np.sin(k)) for k in range(targets)]
    rows = [[observation(f"O{k}", "place")] for k in range(targets)]
    document = problem_document(places=places, observations=rows, time_s=12_000.0, overrun_penalty=5.0)
    for leg in document["legs"]:
        leg["p_fail"] = p_fail
    return problem_from_dict({**document, "format": "problem/2"})


def test_a_plan_is_reckoned_by_the_ways_in_which_its_drives_may_end() -> None:
    """Where drives may fail, a limit of 10 s took 24 s: an action counted the same however it might end."""
    spent = []
    for p_fail in (0.0, 0.01):
        problem = _failing(5, p_fail)
        model = Model.of(problem)
        program = compile_plan(model, visits(problem, *(o.id for o in problem.observations)))
        with tallied() as tally:
            Backward(Grid(model, 25, 15), program).total()
        spent.append((tally.seconds, tally.steps[Step.WAY]))
    assert spent[1][1] > 1.8 * spent[0][1]
    assert spent[1][0] > 1.5 * spent[0][0]


@pytest.mark.parametrize("p_fail", [0.0, 0.01])
@pytest.mark.parametrize("kind", ["down", "above"])
def test_a_table_takes_about_what_it_was_chosen_by(kind: str, p_fail: float) -> None:
    model = Model.of(_failing(4, p_fail))
    sets = LiveSets(model, (1 << model.m) - 1)
    every = sets.all_from([sets.initial(0b11110)])
    tables = {"down": rounded_down, "above": tables_above}[kind](model, drives_of(model, every))
    nodes = (25, 29) if kind == "above" else (49, 28)
    with tallied() as tally:
        Policy(tables.grid(*nodes), moves=Moves.ALL)
    assert 0.4 < tally.seconds / tables.seconds(*nodes) < 1.5


@pytest.mark.parametrize("limit_s", [0.05, 0.5])
def test_a_day_that_is_cut_to_fit_a_table_has_a_plan_at_the_smallest_limit(limit_s: float) -> None:
    found = solve(_large(8), time_limit_s=limit_s)
    assert found.status is PlanStatus.PLANNED
    assert found.expected_utility > 0.0


def test_looking_at_a_plan_on_the_way_counts_as_no_work() -> None:
    problem = _large(4)
    plan = solve(problem, iterations=1, quick=True).tree.plan
    with tallied() as before:
        spent = before.seconds
        tree = sketch(problem, plan)
        assert before.seconds == spent
    assert tree.plan == plan
    assert all(0.0 < notes.p_reached <= 1.0 for notes in tree.step_notes.values())


def test_a_wide_bound_of_many_targets_is_asked_for_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """With what the limit has left; never where the plan lies near, nor with few targets."""
    asked: list[float] = []

    def bound(model: Any, *, limit_s: float) -> Bound:
        asked.append(limit_s)
        return Bound(upper - len(asked), "as the test says")

    monkeypatch.setattr("planner.stages.upper_bound", bound)
    order, model = _order(limit_s=20.0), Model.of(_large(9))
    for upper, lower, times in ((102.0, 99.0, 1), (110.0, 99.0, 2)):
        asked.clear()
        assert bounded(order, model, [0.0], lower) == upper - times
        assert len(asked) == times
        assert asked[-1] <= LEFT_SHARE * 20.0
    asked.clear()
    bounded(order, Model.of(_large(8)), [0.0], 0.0)
    assert len(asked) == 1


def _order(*, limit_s: float) -> Order:
    with tallied() as tally:
        watch = Watch(limit_s, tally, lambda _: None)
    return Order(
        _large(2), "optimal", lambda _: Found([]), 6, None, 0, 0.0, (), False, PlannerOptions(), watch
    )
