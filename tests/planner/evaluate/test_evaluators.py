"""The evaluators agree with each other, with arithmetic, and with an independent evaluator."""

from __future__ import annotations

import importlib
import json
import sys
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.common.draws import draw_table, earned
from planner.evaluate.grid import Grid
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import Correlation, estimate, simulate
from planner.evaluate.program import compile_plan
from planner.evaluate.propagate import Backward, Evaluator, forward, run_in
from planner.notes import annotate
from planner.plan_tree import (
    Branch,
    Comparison,
    Observe,
    OnFail,
    Option,
    PlanTree,
    TimeCondition,
    TrackedCondition,
    plan_tree_from_dict,
)
from planner.problem import Problem, load_problem, problem_from_dict
from tests.planner.examples import example, observation, problem_document, problems, visits
from tests.shared import shared

PLANS = ["dev-mixed-5.pico", "dev-reserve-8.pico", "dev-windows-6.unbranched_skip", "dev-tracking-7.pico"]


def _reference() -> ModuleType:
    folder = shared("contingency/evaluate.py").parent
    sys.path.insert(0, str(folder))
    try:
        return importlib.import_module("evaluate")
    finally:
        sys.path.remove(str(folder))


@pytest.mark.parametrize("name", PLANS)
def test_all_three_evaluators_agree_on_a_reference_plan(name: str) -> None:
    document = json.loads(shared(f"contingency/plans/{name}.json").read_text(encoding="utf-8"))
    problem = load_problem(shared(f"contingency/instances/{document['instance']}.json"))
    plan = plan_tree_from_dict(document, problem).plan
    model = Model.of(problem)
    sampled = estimate(model, plan, 300_000, seed=5)
    value = Evaluator(model).value(plan).value
    assert abs(value - sampled.mean) < 4.0 * sampled.standard_error + 0.0005 * abs(value)
    table = earned(problem, plan, draw_table(problem, 10_000, seed=5))
    spread = float(np.std(table.utility)) / 100.0
    assert abs(float(table.utility.mean()) - value) < 4.0 * spread
    results = json.loads(shared("contingency/results.json").read_text(encoding="utf-8"))
    published = results[document["instance"]][document["method"]]
    assert abs(value - published["mean"]) < 0.002 * published["mean"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_the_independent_evaluator_gives_the_same_value() -> None:
    reference = _reference()
    for name in PLANS:
        document = json.loads(shared(f"contingency/plans/{name}.json").read_text(encoding="utf-8"))
        instance = shared(f"contingency/instances/{document['instance']}.json")
        problem = load_problem(instance)
        plan = plan_tree_from_dict(document, problem).plan
        theirs = reference.evaluate(reference.Instance.load(instance), document["plan"], 400_000)
        assert Evaluator(Model.of(problem)).value(plan).value == pytest.approx(
            theirs["mean"], abs=4.0 * theirs["se"] + 0.0005 * theirs["mean"]
        )


@given(problems(constant=True), st.permutations([1, 2, 3]))
@settings(max_examples=40, deadline=None)
def test_without_spread_every_future_is_the_sum_of_the_means(problem: Problem, order: list[int]) -> None:
    names = [f"O{k}" for k in order if k <= len(problem.targets)]
    plan = visits(problem, *names)
    model = Model.of(problem)
    t = e = worth = 0.0
    tracked = [o.target for o in problem.observations if o.id in names and o.kind.value == "place"]
    over = False
    t += 20.0 * len(tracked)
    e += 200.0 * len(tracked)
    place = "start"
    by_name = {str(o.id): o for o in problem.observations}
    legs = {(leg.origin, leg.to): leg for leg in problem.legs}
    done: set[str] = set()
    if t > problem.budget.time_s or e + 38.0 * t > problem.budget.energy_j:
        over = True
    for name in names:
        if over:
            break
        o = by_name[name]
        carried = sum(1 for x in tracked if x not in done)
        t += legs[place, o.target].time_s.mean + 45.0 * carried
        e += legs[place, o.target].energy_j.mean
        place = o.target
        if t > problem.budget.time_s or e + 38.0 * t > problem.budget.energy_j:
            over = True
            break
        if o.window_s is not None:
            if t > o.window_s[1]:
                continue
            t = max(t, o.window_s[0])
        t += o.time_s.mean
        e += o.energy_j.mean
        if t > problem.budget.time_s or e + 38.0 * t > problem.budget.energy_j:
            over = True
            break
        worth += o.utility * o.p_success
        if o.kind.value == "place":
            done.add(o.target)
    expected = worth - (problem.overrun_penalty if over else 0.0)
    futures = simulate(model, plan, 3, seed=1)
    assert futures.utility == pytest.approx(np.full(3, expected))


def test_the_answer_does_not_depend_on_the_number_of_threads() -> None:
    model = Model.of(example(spread=0.8))
    plan = visits(example(), "O1", "O2", "O3")
    one = simulate(model, plan, 20_000, seed=3, threads=1)
    two = simulate(model, plan, 20_000, seed=3, threads=2)
    assert np.array_equal(one.utility, two.utility)
    assert one.estimate() == two.estimate()
    assert simulate(model, plan, 100, seed=4).utility.tolist() != one.utility[:100].tolist()


def test_two_plans_with_the_same_beginning_share_their_luck() -> None:
    problem = example(spread=0.8)
    model = Model.of(problem)
    a = simulate(model, visits(problem, "O2", "O1"), 20_000, seed=3)
    b = simulate(model, visits(problem, "O2"), 20_000, seed=3)
    apart = simulate(model, visits(problem, "O2"), 20_000, seed=99)
    assert np.corrcoef(a.time_s, b.time_s)[0, 1] > 0.3
    assert abs(np.corrcoef(a.time_s, apart.time_s)[0, 1]) < 0.05


def test_a_slow_day_makes_the_outcome_more_uncertain() -> None:
    problem = example(spread=0.2, time_s=5000.0)
    model = Model.of(problem)
    plan = visits(problem, "O1", "O2", "O3")
    still = simulate(model, plan, 20_000, seed=1)
    moving = simulate(model, plan, 20_000, seed=1, correlation=Correlation(day_factor_sd=0.3))
    assert float(np.std(moving.time_s)) > 1.1 * float(np.std(still.time_s))
    found = simulate(model, plan, 20_000, seed=1, correlation=Correlation(p_recover=1.0))
    assert found.estimate().mean > still.estimate().mean


@given(problems(), st.integers(0, 3), st.integers(300, 6000))
@settings(max_examples=25, deadline=None)
def test_forward_and_backward_propagation_give_the_same_value(
    problem: Problem, place: int, threshold: int
) -> None:
    model = Model.of(problem)
    plan = visits(problem, *(str(o.id) for o in problem.observations))
    cut = min(place, len(plan) - 1)
    late = Option((TimeCondition(Comparison.GE, float(threshold)),), ())
    first = next((k for k, s in enumerate(plan) if not type(s).__name__.startswith("Track")), 0) + cut
    plan = (*plan[:first], Branch((late,)), *plan[first:])
    grid = Grid(model, 31, 21)
    program = compile_plan(model, plan, mark_ends=True)
    begin = run_in(model, program, program.entry)
    backward = Backward(grid, program)
    if begin.over or begin.row == 0:
        return
    flow = forward(grid, program)
    met = {row: sum(float(m.sum()) for m in masses.values()) for row, masses in flow.items()}
    assert met[begin.row] == pytest.approx(1.0)
    assert all(0.0 <= mass <= 1.0 + 1e-9 for mass in met.values())
    at_first = sum(
        float(np.vdot(mass, backward.value(begin.row, state))) for state, mass in flow[begin.row].items()
    )
    assert at_first == pytest.approx(backward.total(), abs=1e-9)


@given(problems())
@settings(max_examples=15, deadline=None)
def test_grid_and_monte_carlo_agree_on_any_problem(problem: Problem) -> None:
    model = Model.of(problem)
    plan = visits(problem, *(str(o.id) for o in problem.observations))
    sampled = estimate(model, plan, 40_000, seed=2)
    value = Evaluator(model).value(plan).value
    scale = 1.0 + problem.utility_sum + problem.overrun_penalty
    assert abs(value - sampled.mean) < 4.5 * sampled.standard_error + 0.004 * scale


def test_diminishing_value_and_precedence_are_kept_by_both_evaluators() -> None:
    rows = [[observation("A", utility=4.0), observation("B", utility=4.0)], [observation("C")]]
    problem = example(
        places=[(4.0, 1.0), (6.0, -2.0)], observations=rows, precedence=[["B", "A"]], spread=0.1, loss=0.0
    )
    document_targets = tuple(
        type(t)(**{**{f: getattr(t, f) for f in t.__slots__}, "diminishing": 0.5}) for t in problem.targets
    )
    problem = type(problem)(
        **{**{f: getattr(problem, f) for f in problem.__slots__}, "targets": document_targets}
    )
    model = Model.of(problem)
    wrong, right = visits(problem, "A", "B"), visits(problem, "B", "A")
    assert simulate(model, wrong, 100, seed=1).utility.max() == 4.0
    assert simulate(model, right, 100, seed=1).utility.max() == 6.0
    assert Evaluator(model).value(right).value == pytest.approx(6.0, abs=0.01)


def test_no_future_ends_well_over_a_budget_and_the_penalty_is_taken_once() -> None:
    problem = example(time_s=1200.0, overrun_penalty=7.0)
    plan = visits(problem, "O1", "O2", "O3")
    result = earned(problem, plan, draw_table(problem, 500, seed=1))
    over = result.overrun
    assert over.any()
    assert np.all(result.utility[over] < 5.01 - 7.0 + 5.0)
    assert np.all(result.time_s[~over] <= 1200.0)


def test_notes_tell_the_odds_of_an_option_and_what_it_wins() -> None:
    problem = example(loss=0.4, spread=0.2, overrun_penalty=20.0, time_s=3500.0)
    model = Model.of(problem)
    plan = visits(problem, "O1", "O2", "O3", on_fail=OnFail.SKIP)
    k = next(k for k, s in enumerate(plan) if isinstance(s, Observe)) + 1
    option = Option((TimeCondition(Comparison.GE, 2000.0), TrackedCondition("T3", True)), ())  # type: ignore[arg-type]
    plan = (*plan[:k], Branch((option,)), *plan[k:])
    tree = annotate(model, Grid(model, 61, 37), PlanTree("example", plan))
    notes = tree.option_notes[(k, 0)]
    table = earned(problem, plan, draw_table(problem, 20_000, seed=3))
    taken = table.visited[:, table.program.option_entry[(k, 0)]].mean()
    assert notes.p_taken == pytest.approx(float(taken), abs=0.015)
    without = Evaluator(model).value((*plan[:k], *plan[k + 1 :])).value
    assert notes.gain == pytest.approx(Evaluator(model).value(plan).value - without, abs=0.05)
    assert tree.step_notes[(0,)].p_reached == 1.0
    assert list(tree.step_notes[(k,)].time_s) == sorted(tree.step_notes[(k,)].time_s)


@pytest.mark.parametrize("diminishing", [1.0, 0.5])
def test_what_no_step_ahead_asks_for_parts_no_states_and_changes_no_value(
    diminishing: float,
) -> None:
    rows = [[observation(f"O{k}", "place"), observation(f"I{k}")] for k in range(4)]
    document = problem_document(
        places=[(2.0, 1.0), (3.0, -1.0), (1.0, -2.0), (4.0, 2.0)], observations=rows, time_s=6500.0
    )
    for target in document["targets"]:
        target["diminishing"] = diminishing
    document["precedence"] = [["O0", "I3"]]
    problem = problem_from_dict(document)
    model = Model.of(problem)
    program = compile_plan(model, visits(problem, "O0", "I0", "O1", "I2", "O2", "I3", "O3"))
    grid = Grid(model, 41, 25)
    few, all_of_them = Backward(grid, program), Backward(grid, program)
    all_of_them._read = [-1] * len(program)
    assert few.total() == pytest.approx(all_of_them.total(), rel=1e-12)
    assert len(few._tails.known) < len(all_of_them._tails.known)
