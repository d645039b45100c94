"""The optimal policy, its bounds, and the plans that are grown towards it."""

from __future__ import annotations

import dataclasses
import itertools
import json

import numpy as np
import pytest
from hypothesis import given, settings

from planner.contingency.bounds import GRIDS, relaxed_bound, trivial_bound, upper_bound
from planner.contingency.branching import SearchLimits, plan_optimal
from planner.contingency.conditions import Bins, best_condition
from planner.contingency.growing import Grower
from planner.contingency.option_fitting import OptionFitter
from planner.contingency.policy import LiveSets, Moves, Policy
from planner.contingency.reduction import reduce_problem
from planner.contingency.seeding import mean_route, mean_seed
from planner.contingency.settling import Settler
from planner.contingency.valued_plan import ValuedPlan
from planner.evaluate.grid import Grid, Rounding
from planner.evaluate.model import Model
from planner.evaluate.propagate import Evaluator, State
from planner.plan_tree import TimeCondition, TrackedCondition, count_branches
from planner.problem import Amount, Problem, load_problem
from planner.solve import PlanStatus, solve
from planner.strategies.pico2005 import plan_pico2005
from planner.tally import tallied
from tests.planner.examples import example, observation, problem_document, problems, visits
from tests.shared import shared

INSTANCES = ["dev-reserve-4", "dev-windows-4", "dev-mixed-5", "dev-resource-4"]


def _results() -> dict[str, dict[str, float]]:
    found: dict[str, dict[str, float]] = json.loads(
        shared("contingency/results.json").read_text(encoding="utf-8")
    )
    return found


@pytest.mark.parametrize("name", INSTANCES)
def test_the_table_finds_the_published_optimum_and_brackets_it(name: str) -> None:
    model = Model.of(load_problem(shared(f"contingency/instances/{name}.json")))
    optimum = _results()[name]["dp_mid"]
    middle = Policy(Grid(model, 97, 57, Rounding.MID, np.float32)).best()
    low = Policy(Grid(model, 193, 113, Rounding.UP, np.float32)).best()
    high = Policy(Grid(model, 193, 113, Rounding.DOWN, np.float32)).best()
    assert middle == pytest.approx(optimum, rel=0.003)
    assert low < optimum < high
    assert high - low < 0.06 * optimum


@given(problems(targets=2))
@settings(max_examples=8, deadline=None)
def test_no_unbranched_plan_beats_the_upper_bounds(problem: Problem) -> None:
    model = Model.of(problem)
    names = [str(o.id) for o in problem.observations]
    evaluator = Evaluator(model)
    best = 0.0
    for count in range(1, len(names) + 1):
        for order in itertools.permutations(names, count):
            best = max(best, evaluator.value(visits(problem, *order)).value)
    slack = 0.003 * (1.0 + problem.utility_sum)
    assert best <= upper_bound(model, limit_s=2.0).value + slack
    assert best <= relaxed_bound(model).value + slack
    assert relaxed_bound(model).value <= trivial_bound(model).value * 1.00001 or best <= slack


@given(problems(targets=3))
@settings(max_examples=6, deadline=None)
def test_more_budget_never_lowers_the_optimum(problem: Problem) -> None:
    # Without a hotel load the axis of time ends at the budget, so that both grids have the same cells.
    problem = dataclasses.replace(problem, hotel_w=0.0)
    budget = dataclasses.replace(problem.budget, time_s=problem.budget.time_s * 1.25)
    more = dataclasses.replace(problem, budget=budget)
    # The wider problem on a grid with the same cells: whatever fits the smaller one fits it too.
    small = Policy(Grid(Model.of(problem), 41, 25, Rounding.DOWN)).best()
    large = Policy(Grid(Model.of(more), 51, 25, Rounding.DOWN)).best()
    assert large >= small - 1e-6


def test_one_stay_tables_agree_where_nothing_calls_a_rover_back() -> None:
    rows = [
        [observation("A", "place", 8.0), observation("B", "image", 3.0)],
        [observation("C", "place", 5.0)],
    ]
    model = Model.of(example(places=[(4.0, 1.0), (6.0, -2.0)], observations=rows))
    grid = Grid(model, 41, 25)
    assert Policy(grid, moves=Moves.ONE_STAY).best() == pytest.approx(Policy(grid).best(), abs=1e-9)


def test_giving_up_an_observation_gives_up_what_depends_on_it() -> None:
    rows = [[observation("A", "place"), observation("B")], [observation("C")]]
    problem = example(
        places=[(4.0, 1.0), (6.0, -2.0)], observations=rows, precedence=[["A", "B"], ["B", "C"]]
    )
    sets = LiveSets(Model.of(problem), 0b111)
    live = sets.initial(0b10)
    assert live.bits == 0b111
    assert sets.without(live, 0b001).bits == 0
    assert not sets.open(live, 1)
    assert sets.open(sets.after(live, 0), 1)


@pytest.mark.parametrize("name", ["dev-reserve-4", "dev-windows-4"])
def test_branches_close_the_gap_to_the_optimum(name: str) -> None:
    model = Model.of(load_problem(shared(f"contingency/instances/{name}.json")))
    results = _results()[name]
    grid = Grid(model, 49, 29)
    search = plan_optimal(
        Policy(Grid(model, 49, 29, Rounding.MID, np.float32)), grid, SearchLimits(max_branches=6)
    )
    evaluator = Evaluator(model)
    values = [evaluator.value(plan).value for _, plan in search.curve]
    assert all(count_branches(plan) <= k for k, (_, plan) in enumerate(search.curve))
    assert all(b >= a - 0.001 * abs(a) for a, b in itertools.pairwise(values))
    unbranched = max(results["unbranched_stop"]["mean"], results["unbranched_skip"]["mean"])  # type: ignore[index]
    assert values[0] >= 0.997 * unbranched
    assert values[-1] >= 0.995 * results["dp_mid"]


def test_a_search_cut_short_is_narrower_but_has_all_its_branches() -> None:
    model = Model.of(load_problem(shared("contingency/instances/dev-reserve-5.json")))
    policy = Policy(Grid(model, 49, 29, Rounding.MID, np.float32))
    limits = SearchLimits(max_branches=6, iterations=400)
    search = plan_optimal(policy, Grid(model, 49, 29), limits)
    value, plan = search.best(6)
    assert search.done < 1.0
    assert count_branches(plan) == 6
    assert value >= 0.982 * search.optimum


def test_the_search_is_the_same_every_time() -> None:
    model = Model.of(load_problem(shared("contingency/instances/dev-mixed-5.json")))
    plans = []
    for _ in range(2):
        policy = Policy(Grid(model, 33, 21, Rounding.MID, np.float32))
        limits = SearchLimits(max_branches=3, iterations=60)
        plans.append(plan_optimal(policy, Grid(model, 33, 21), limits).curve)
    assert plans[0] == plans[1]


def test_a_condition_finds_the_region_where_another_plan_wins() -> None:
    model = Model.of(example())
    grid = Grid(model, 41, 25)
    late = np.where(grid.t[:, None] > 3000.0, 1.0, -1.0) * np.ones(grid.shape)
    mass = np.ones(grid.shape)
    state, lost = State(1, 0, 0b1000), State(1, 0, 0)
    choice = best_condition(model, Bins(grid), {state: -mass, lost: late}, {state: mass, lost: mass})
    tests = [c for c in choice.when if isinstance(c, TrackedCondition)]
    times = [c for c in choice.when if isinstance(c, TimeCondition)]
    assert [(t.target, t.value) for t in tests] == [("T3", False)]
    assert len(times) == 1
    assert times[0].value_s == pytest.approx(3000.0, abs=grid.step_t)
    assert choice.gain == pytest.approx(float(np.maximum(late, 0.0).sum()))


def test_the_2004_planner_is_as_good_as_the_reference_reading_of_it() -> None:
    ratios = []
    for name in ("dev-reserve-4", "dev-resource-4", "dev-windows-4", "dev-mixed-5", "dev-tracking-5"):
        model = Model.of(load_problem(shared(f"contingency/instances/{name}.json")))
        plan = plan_pico2005(model, Grid(model, 49, 29), max_branches=12)
        assert count_branches(plan) <= 12
        published = _results()[name]["pico"]["mean"]  # type: ignore[index]
        ratios.append(Evaluator(model).value(plan).value / published)
    assert min(ratios) > 0.94
    assert sum(ratios) / len(ratios) > 0.98


@given(problems(targets=3, constant=True))
@settings(max_examples=8, deadline=None)
def test_the_seed_on_mean_values_is_the_best_of_all_orders(problem: Problem) -> None:
    model = Model.of(problem)

    def sure(order: tuple[int, ...]) -> float:
        return earned_once(model, problem, [str(model.observation_ids[m]) for m in order])

    best = 0.0
    for count in range(1, min(model.m, 4) + 1):
        for order in itertools.permutations(range(model.m), count):
            best = max(best, sure(order))
    assert sure(mean_seed(model)) >= best - 1e-9


def earned_once(model: Model, problem: Problem, names: list[str]) -> float:
    from planner.evaluate.monte_carlo import simulate

    return float(simulate(model, visits(problem, *names), 1, seed=0).utility[0])


def test_a_route_from_a_branch_point_uses_tracked_targets_only() -> None:
    model = Model.of(example(loss=0.0))
    order = mean_route(model, State(2, 0b010, 0b1000), 1500.0, 50_000.0)
    assert 0 not in order
    assert 1 not in order


def test_a_large_problem_is_reduced_to_its_promising_targets() -> None:
    places = [(3.0 + (k % 8), -6.0 + 1.6 * (k // 8)) for k in range(40)]
    rows = [[observation(f"O{k + 1}", utility=1.0 + (k % 7))] for k in range(40)]
    problem = example(places=places, observations=rows)
    reduction = reduce_problem(problem)
    assert 0 < len(reduction.problem.observations) <= 12
    assert not reduction.exact
    assert "of 40 observations" in reduction.notes[0]


def test_what_the_finest_table_leaves_is_for_the_other() -> None:
    """Where drives hardly scatter both tables fit; the one that rounds down is closer on its finest grid."""
    problem = load_problem("examples/first_plan/three-rocks.json")
    steady = []
    for leg in problem.legs:
        time_s = dataclasses.replace(leg.time_s, sd=0.3 * leg.time_s.sd)
        steady.append(dataclasses.replace(leg, time_s=time_s, energy_j=Amount(leg.energy_j.mean)))
    with tallied():
        bound = upper_bound(Model.of(dataclasses.replace(problem, legs=tuple(steady))), limit_s=2.8)
    assert bound.nodes == GRIDS[-1]


@pytest.mark.parametrize("time_s", [20.0, 40.0, 60.0, 80.0, 200.0])
def test_a_day_shorter_than_the_tracks_of_a_drive_has_a_plan_and_a_bound(time_s: float) -> None:
    problem = dataclasses.replace(load_problem(problem_document(time_s=time_s)), overrun_penalty=1.0)
    result = solve(problem, max_branches=2, iterations=2)
    assert result.status in {PlanStatus.EMPTY, PlanStatus.PLANNED}
    assert max(0.0, result.lower, result.expected_utility) <= result.upper + 1e-9


def test_a_beginning_promises_what_the_policy_can_still_earn_after_its_first_half() -> None:
    problem = example(
        places=[(2.0, 0.0), (4.0, 0.0), (6.0, 0.0), (8.0, 0.0)],
        observations=[[observation(f"O{k}", utility=5.0)] for k in range(4)],
        time_s=6000.0,
        loss=0.0,
        overrun_penalty=5.0,
    )
    model = Model.of(problem)
    grid = Grid(model, 49, 29)
    policy = Policy(Grid(model, 49, 29, Rounding.MID, np.float32))
    fitter = OptionFitter(policy, grid, None, lambda: False)
    grower = Grower(fitter, Settler(fitter, 2e-4, 4), 2e-4)

    def promise(*names: str) -> float:
        plan = ValuedPlan(fitter.tails, visits(problem, *names))
        assert plan.value <= grower.promise(plan) <= policy.best() * (1.0 + 1e-4)
        return grower.promise(plan)

    assert promise("O0", "O1", "O2", "O3") > 0.999 * policy.best()
    assert promise("O0", "O1", "O3") > 0.999 * policy.best()  # what comes late can be won back
    assert promise("O0", "O3", "O2", "O1") < 0.99 * policy.best()  # the second drive is already wrong
