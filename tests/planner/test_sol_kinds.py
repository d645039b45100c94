"""Kinds of sols that a plan cannot tell: one meaning in documents, evaluators, bounds, CRL and executive."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.common.draws import draw_table, earned
from benchmarks.executive_equality import compare
from planner.amounts_of_sol import mixed, on_kind
from planner.contingency.bounds import MARGIN, flow_bound, relaxed_bound, upper_bound
from planner.contingency.policy import Moves, Policy
from planner.contingency.priced_bound import priced_bound
from planner.contingency.sampled.branches import grow_branches
from planner.contingency.sampled.futures import Growth
from planner.errors import PlannerError, ProblemError
from planner.evaluate.grid import Grid
from planner.evaluate.majorant import Majorant
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import estimate, resume, simulate
from planner.evaluate.program import compile_plan
from planner.evaluate.propagate import Evaluator
from planner.evaluate.rollout import kinds_of
from planner.plan_tree import (
    Branch,
    Comparison,
    EnergyCondition,
    OnFail,
    Option,
    PlanTree,
    TimeCondition,
    count_branches,
)
from planner.problem import Problem, problem_from_dict, problem_to_dict
from planner.sol_kind import SolKind, all_kinds
from planner.solve import solve
from tests.planner.examples import example, observation, problem_document, problems, visits
from tests.planner.reference.optimum import optimum
from tests.planner.reference.problems import generated

SLOW = SolKind("slow", 0.25, drive_time_factor=1.8, drive_energy_factor=1.3)
HUNGRY = SolKind("hungry", 0.2, energy_factor=1.5)
STATED = [
    {"name": "slow", "p": 0.25, "drive_time_factor": 1.8, "drive_energy_factor": 1.3},
    {"name": "hungry", "p": 0.2, "energy_factor": 1.5},
]


def hidden(*kinds: SolKind, **more: Any) -> Problem:
    """Return the example with these kinds of sols, or a slow and a hungry one."""
    return dataclasses.replace(example(**more), sol_kinds=kinds or (SLOW, HUNGRY))


def four_targets() -> Problem:
    rows = [[observation(f"O{k}", "place" if k % 2 else "image", utility=5.0 + k)] for k in range(4)]
    places = [(4.0, 1.0), (6.0, -2.0), (3.0, -4.0), (-3.0, 2.0)]
    return hidden(places=places, observations=rows, overrun_penalty=8.0)


def test_a_problem_with_kinds_says_format_2_and_one_without_is_as_before() -> None:
    plain = problem_from_dict(problem_document())
    document = {**problem_document(), "format": "problem/2"}
    assert problem_from_dict({**document, "sol_kinds": []}).digest() == plain.digest()
    assert problem_from_dict({**document, "sol_kinds": None}).digest() == plain.digest()
    read = problem_from_dict({**document, "sol_kinds": STATED})
    assert read.sol_kinds == (SLOW, HUNGRY)
    written = problem_to_dict(read)
    assert written["format"] == "problem/2"
    assert problem_from_dict(written) == dataclasses.replace(read, source_format="problem/2")
    assert read.digest() != plain.digest()


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ([{**STATED[0], "p": 0.9}, STATED[1]], r"sol_kinds\[\].p sum to 1.1; the sum must be at most 1"),
        ([STATED[0], STATED[0]], 'sol kind "slow" is given twice'),
        ([{"name": "ordinary", "p": 0.1}], 'sol kind "ordinary" is kept'),
        ([{**STATED[0], "drive_time_factor": 0.0}], "drive_time_factor is 0.0?; it must be at least 0.1"),
        ([{**STATED[1], "energy_factor": 11.0}], "energy_factor is 11.0?; it must be at most 10"),
        ([{**STATED[1], "p": -0.1}], "p is -0.1; it must be at least 0"),
        ([{"name": f"k{k}", "p": 0.01} for k in range(13)], "sol_kinds"),
    ],
)
def test_what_is_wrong_with_kinds_is_said_in_a_line(stated: list[dict[str, Any]], said: str) -> None:
    with pytest.raises(ProblemError, match=said) as err:
        problem_from_dict({**problem_document(), "format": "problem/2", "sol_kinds": stated})
    assert "\n" not in str(err.value)


def test_older_formats_are_refused_with_kinds() -> None:
    with pytest.raises(ProblemError, match="sol_kinds states 2; kinds of sols need the format problem/2"):
        problem_from_dict({**problem_document(), "sol_kinds": STATED})


def test_the_ordinary_sol_has_the_rest_of_the_probability() -> None:
    assert [(k.name, round(k.p, 12)) for k in all_kinds((SLOW, HUNGRY))] == [
        ("slow", 0.25), ("hungry", 0.2), ("ordinary", 0.55),
    ]  # fmt: skip
    thirds = tuple(SolKind(name, p, 1.0) for name, p in (("a", 1 / 6), ("b", 2 / 3), ("c", 1 / 6)))
    assert [k.name for k in all_kinds(thirds)] == ["a", "b", "c"]
    assert [k.name for k in all_kinds((SolKind("never", 0.0, 9.0),))] == ["ordinary"]


def test_mixed_amounts_have_mean_and_deviation_over_the_kinds() -> None:
    problem = hidden(spread=0.3)
    rng = np.random.default_rng(3)
    leg, there = problem.legs[0], mixed(problem).legs[0]
    factor = rng.choice([1.8, 1.0], 400_000, p=[0.25, 0.75])
    sigma = math.sqrt(math.log1p((leg.time_s.sd / leg.time_s.mean) ** 2))
    drawn = factor * leg.time_s.mean * np.exp(sigma * rng.standard_normal(400_000) - sigma**2 / 2)
    assert there.time_s.mean == pytest.approx(drawn.mean(), rel=0.005)
    assert there.time_s.sd == pytest.approx(drawn.std(), rel=0.01)
    assert mixed(problem).hotel_w == pytest.approx(1.1 * problem.hotel_w)
    known = on_kind(problem, HUNGRY)
    assert known.sol_kinds == ()
    assert known.targets[0].observations[0].energy_j.mean == pytest.approx(
        1.5 * problem.targets[0].observations[0].energy_j.mean
    )


def test_grid_samples_and_table_agree_on_a_plan_that_reads_its_progress() -> None:
    problem = hidden(SLOW, HUNGRY, loss=0.1, time_s=5200.0, energy_j=450e3)
    model = Model.of(problem)
    line = visits(problem, "O1", "O2", "O3")
    late = Option((TimeCondition(Comparison.GE, 1800.0),), line[-2:], "late")
    spent = Option((EnergyCondition(Comparison.GE, 170e3),), (), "spent")
    plan = (*line[:-4], Branch((late, spent)), *line[-4:])
    value = Evaluator(model).value(plan).value
    sampled = estimate(model, plan, 200_000, seed=3)
    assert abs(value - sampled.mean) < 4.0 * sampled.standard_error + 0.002 * abs(value)
    table = earned(problem, plan, draw_table(problem, 20_000, seed=4))
    error = float(np.std(table.utility)) / 20_000**0.5
    assert abs(float(table.utility.mean()) - sampled.mean) < 4.0 * math.hypot(error, sampled.standard_error)
    parts = [p * Evaluator(known).value(plan).value for p, known in model.by_kind]
    assert value == pytest.approx(sum(parts))


@pytest.mark.parametrize("kind", [SLOW, HUNGRY, SolKind("mild", 0.5, energy_factor=0.5)])
def test_a_kind_that_is_sure_to_come_is_the_problem_with_its_amounts(kind: SolKind) -> None:
    """The hotel load alone uses up the energy here before the time is over, on a mild sol later."""
    sure = hidden(dataclasses.replace(kind, p=1.0), time_s=9000.0, energy_j=250e3)
    known = Model.of(on_kind(sure, kind))
    plan = visits(sure, "O1", "O2", "O3")
    one, two = (simulate(model, plan, 4000, seed=2) for model in (Model.of(sure), known))
    assert one.utility == pytest.approx(two.utility)
    assert one.energy_j == pytest.approx(two.energy_j)
    assert Model.of(sure).within_reach().t_max_s == pytest.approx(known.within_reach().t_max_s)
    assert Evaluator(Model.of(sure)).value(plan).value == pytest.approx(Evaluator(known).value(plan).value)


def test_the_factor_is_shared_by_all_drives_of_a_sol() -> None:
    """Independent drives with the same means and deviations spread less than those of one slow sol."""
    problem = hidden(SolKind("slow", 0.5, 3.0), loss=0.0, time_s=50_000.0, energy_j=2e7)
    plan = visits(problem, "O1", "O2", "O3")
    shared = simulate(Model.of(problem), plan, 50_000, seed=1).time_s
    apart = simulate(Model.of(mixed(problem)), plan, 50_000, seed=1).time_s
    assert shared.mean() == pytest.approx(apart.mean(), rel=0.02)
    assert shared.std() > 1.3 * apart.std()


def test_futures_that_go_on_from_a_row_keep_their_kind() -> None:
    problem = hidden(loss=0.1, time_s=9000.0)
    model = Model.of(problem)
    plan = visits(problem, "O1", "O2", "O3")
    whole = compile_plan(model, plan, mark_ends=True)
    futures = simulate(model, whole, 3000, seed=9, watch=True)
    assert futures.seen is not None
    at = len(plan) - 2
    standing = futures.seen.at(whole.step_row[(at,)], 3000)
    again = resume(model, plan[at:], standing, seed=9)
    assert again == pytest.approx(futures.utility[standing.number])
    kind = kinds_of(model.sols.chance, 9, np.arange(3000))
    shares = np.bincount(kind, minlength=3) / 3000
    assert shares == pytest.approx(model.sols.chance, abs=0.03)
    there = kind[standing.number]
    assert standing.time_s[there == 0].mean() > 1.2 * standing.time_s[there == 2].mean()


def test_bounds_of_one_kind_refuse_a_model_that_hides_it() -> None:
    model = Model.of(hidden())
    for made in (
        lambda: Grid(model, 9, 8),
        lambda: relaxed_bound(model),
        lambda: flow_bound(model, limit_s=0.1),
    ):
        with pytest.raises(PlannerError, match="holds one kind of sol; the model has 3"):
            made()


@pytest.mark.parametrize("seed", range(6))
def test_the_bound_is_above_the_best_policy_that_remembers_its_history(seed: int) -> None:
    problem = generated("sols", seed)
    best = optimum(problem)
    model = Model.of(problem)
    bound = upper_bound(model, limit_s=0.2)
    assert "kind of sol told at the start" in bound.method
    assert bound.value >= best - 1e-6
    told = sum(kind.p * optimum(on_kind(problem, kind)) for kind in all_kinds(problem.sol_kinds))
    assert best <= told + 1e-9
    result = solve(problem, max_branches=3, time_limit_s=1.0, quick=True, seed=seed)
    assert result.lower <= best + 1e-6


@pytest.mark.parametrize("seed", [6, 7])
def test_each_bound_is_one_where_it_is_made_for_each_kind(seed: int) -> None:
    problem = generated("sols", seed)
    model, best = Model.of(problem), optimum(problem)
    for bound in (
        lambda known: Policy(Majorant(known, 9, 8), moves=Moves.ALL).best() * (1.0 + MARGIN),
        lambda known: relaxed_bound(known).value,
        lambda known: flow_bound(known, limit_s=0.5),
        lambda known: priced_bound(known, limit_s=0.3),
    ):
        assert sum(chance * bound(known) for chance, known in model.by_kind) >= best - 1e-6


def test_the_best_policy_is_worth_less_where_only_observations_tell_the_kind() -> None:
    """Two kinds with the same drives: told at the start, more is earned than when it is learned."""
    rows = [[observation("O1", utility=5.0)], [observation("O2", utility=4.0)]]
    document = problem_document(
        places=[(3.0, 0.0), (-3.0, 0.0)], observations=rows, spread=0.0, time_s=9000.0
    )
    problem = problem_from_dict(document)
    trip = problem.legs[0].energy_j.mean + problem.targets[0].observations[0].energy_j.mean
    budget = dataclasses.replace(problem.budget, energy_j=1.05 * trip)
    problem = dataclasses.replace(
        problem, hotel_w=0.0, budget=budget, overrun_penalty=6.0,
        sol_kinds=(SolKind("cold", 0.5, 1.0, 1.0 / 1.5, 1.5),),
    )  # fmt: skip
    told = sum(kind.p * optimum(on_kind(problem, kind)) for kind in all_kinds(problem.sol_kinds))
    assert optimum(problem) < told - 0.1
    assert optimum(problem) <= upper_bound(Model.of(problem), limit_s=0.5).value


def test_the_planner_reckons_with_kinds_and_the_executive_earns_what_it_says() -> None:
    problem = four_targets()
    for seed in (1, 2):
        found = solve(problem, max_branches=3, time_limit_s=3.0, seed=seed)
        assert found.check is not None
        assert found.lower <= found.expected_utility <= found.upper
        assert found.evaluator == "monte-carlo"
        assert any("kind of sol" in reason for reason in found.reasons)
        assert found.branches > 0
        assert not compare(problem_to_dict(problem), found.tree, 150, seed)
        value = Evaluator(Model.of(problem)).value(found.tree.plan).value
        assert abs(value - found.expected_utility) < 4.0 * found.check.standard_error + 0.01 * value
    blind = solve(dataclasses.replace(problem, sol_kinds=()), max_branches=3, time_limit_s=3.0, seed=1)
    model = Model.of(problem)
    more = (simulate(model, plan, 100_000, seed=7).utility for plan in (found.tree.plan, blind.tree.plan))
    won, lost = more
    assert float((won - lost).mean()) > 0.5


def test_branches_grown_in_common_futures_react_to_progress() -> None:
    """A slow sol is late after its first drive, and the rest of it is slow: the plan gives the rest up."""
    problem = hidden(SolKind("slow", 0.4, 2.5), spread=0.1, loss=0.0, time_s=5500.0, overrun_penalty=20.0)
    model = Model.of(problem)
    plan = visits(problem, "O1", "O2", "O3")
    curve = grow_branches(model, plan, Growth(2, seed=5))
    assert count_branches(curve[-1][1]) > 0
    kinds = kinds_of(model.sols.chance, 6, np.arange(20_000))
    earned_more = (
        simulate(model, curve[-1][1], 20_000, seed=6).utility - simulate(model, plan, 20_000, seed=6).utility
    )
    assert earned_more[kinds == 0].mean() > 1.0


def test_a_chance_constraint_is_kept_over_all_kinds() -> None:
    problem = dataclasses.replace(four_targets(), overrun_penalty=0.0, max_overrun_probability=0.05)
    found = solve(problem, max_branches=2, time_limit_s=4.0, seed=3)
    assert found.check is not None
    assert found.check.overrun <= 0.05
    assert found.lower <= found.upper
    assert float(simulate(Model.of(problem), found.tree.plan, 200_000, seed=99).overrun.mean()) <= 0.05


def test_what_must_be_done_is_in_the_main_line() -> None:
    problem = four_targets()
    first, *others = problem.targets
    demanded = dataclasses.replace(first.observations[0], must_do=True)
    first = dataclasses.replace(first, observations=(demanded,))
    problem = dataclasses.replace(problem, targets=(first, *others))
    found = solve(problem, max_branches=2, time_limit_s=4.0, seed=3)
    assert demanded.id in {getattr(step, "observation", None) for step in found.tree.plan}


def test_the_same_order_gives_the_same_plan() -> None:
    problem = four_targets()
    one, two = (solve(problem, max_branches=1, iterations=60, seed=4) for _ in range(2))
    assert one.tree == two.tree


FACTOR = st.floats(0.25, 4.0, width=16)


@settings(max_examples=15, deadline=None)
@given(
    problems(),
    st.lists(st.tuples(FACTOR, FACTOR, FACTOR), min_size=1, max_size=3),
    st.floats(0.0625, 0.625, width=16),
    st.integers(0, 99),
)
def test_any_plan_means_the_same_to_evaluator_and_executive(
    problem: Problem, factors: list[tuple[float, float, float]], spent: float, seed: int
) -> None:
    kinds = tuple(SolKind(f"kind {k}", 0.3, *three) for k, three in enumerate(factors))
    problem = dataclasses.replace(problem, sol_kinds=kinds)
    names = [str(o.id) for o in problem.observations][:4]
    plan = visits(problem, *names, *names[:1], on_fail=OnFail.SKIP)
    hungry = EnergyCondition(Comparison.GE, spent * problem.budget.usable_energy_j)
    plan = (*plan[:-2], Branch((Option((hungry,), (), "hungry"),)), *plan[-2:])
    assert not compare(problem_to_dict(problem), PlanTree(problem.name, plan), 40, seed)
