"""From a problem to a plan: limits, bounds, what is said when there is none."""

from __future__ import annotations

import dataclasses
import json
import math
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

import pytest
from typer.testing import CliRunner

from executive.crl import parse
from ground.cli.main import app, register_all
from planner.contingency.reduction import mean_route_of
from planner.errors import PlannerError
from planner.explain import compare_plans, why_not
from planner.plan_edits import fitted
from planner.plan_tree import TrackStart, planned_observations
from planner.problem import ObservationId, Problem, load_problem, problem_from_dict, problem_to_dict
from planner.solve import PlanStatus, Progress, solve
from planner.tally import StoppedError
from tests.planner.examples import example, observation, problem_document, visits
from tests.planner.reference.optimum import optimum
from tests.planner.reference.problems import generated
from tests.shared import shared

register_all()
QUICK: dict[str, Any] = {"time_limit_s": 20.0, "iterations": 40, "max_branches": 2}


def _instance(name: str) -> Problem:
    return load_problem(shared(f"contingency/instances/{name}.json"))


def test_a_plan_lies_between_its_bounds_and_near_the_optimum() -> None:
    results = json.loads(shared("contingency/results.json").read_text(encoding="utf-8"))["dev-reserve-4"]
    seen: list[Progress] = []
    result = solve(_instance("dev-reserve-4"), time_limit_s=60.0, report=seen.append)
    assert result.status is PlanStatus.PLANNED
    assert result.lower <= result.expected_utility <= result.upper
    assert result.upper >= results["dp_mid"]
    assert (result.upper - result.lower) / result.upper < 0.03
    assert result.expected_utility >= 0.99 * results["dp_mid"]
    assert result.branches <= 6
    assert list(result.curve) == sorted(result.curve)
    assert [p.fraction for p in seen] == sorted(p.fraction for p in seen)
    assert seen[-1].phase == "done"


def test_the_same_seed_and_iterations_give_the_same_plan() -> None:
    problem = _instance("dev-mixed-5")
    assert solve(problem, seed=3, **QUICK).tree == solve(problem, seed=3, **QUICK).tree


def test_a_cancelled_search_hands_in_the_best_plan_so_far() -> None:
    told: list[Progress] = []
    result = solve(
        _instance("dev-reserve-4"),
        time_limit_s=600.0,
        report=told.append,
        should_stop=lambda: len([p for p in told if p.plan]) >= 6,
    )
    assert result.status is PlanStatus.PLANNED
    best = max(p.value or 0.0 for p in told if p.phase == "branching")
    assert result.expected_utility >= 0.99 * best
    assert result.upper < 1.1 * result.expected_utility
    assert result.lower <= result.expected_utility


def test_a_cancelled_search_still_answers() -> None:
    result = solve(_instance("dev-reserve-5"), time_limit_s=60.0, should_stop=lambda: True)
    assert result.status in (PlanStatus.PLANNED, PlanStatus.EMPTY, PlanStatus.TIMEOUT)
    assert result.upper >= result.expected_utility


def test_limits_out_of_range_are_refused() -> None:
    problem = example()
    with pytest.raises(PlannerError, match='unknown strategy "best"; known are optimal, pico2005'):
        solve(problem, strategy="best")
    with pytest.raises(PlannerError, match="max_branches is -1"):
        solve(problem, max_branches=-1)
    with pytest.raises(PlannerError, match="time_limit_s is 0; it must be more than 0"):
        solve(problem, time_limit_s=0.0)
    with pytest.raises(PlannerError, match="iterations is 0"):
        solve(problem, iterations=0)


EMPTY: list[tuple[str, dict[str, Any], str]] = [
    ("no target", {"places": []}, "the problem has no observation"),
    (
        "worthless",
        {"observations": [[observation("A", utility=0.0)]], "places": [(4.0, 0.0)]},
        "worth anything",
    ),
    ("no time", {"time_s": 0.0}, "the budget of 0 s and 600000 J is too small"),
    ("no energy", {"energy_j": 0.0}, "the budget of 6000 s and 0 J is too small"),
    ("too small", {"time_s": 60.0}, "the budget of 60 s and 600000 J is too small"),
    (
        "past",
        {"observations": [[observation("A", window_s=[-500.0, -100.0])]], "places": [(4.0, 0.0)]},
        "every window is in the past: the last, of A, closed 100 s before the plan",
    ),
]


@pytest.mark.parametrize(("name", "change", "reason"), EMPTY, ids=[n for n, _, _ in EMPTY])
@pytest.mark.parametrize("strategy", ["optimal", "pico2005"])
def test_an_empty_plan_says_why(name: str, change: dict[str, Any], reason: str, strategy: str) -> None:
    result = solve(example(**change), strategy=strategy, **QUICK)
    assert result.status is PlanStatus.EMPTY
    assert result.tree.plan == ()
    assert any(reason in r for r in result.reasons)


def test_one_target_is_planned() -> None:
    result = solve(example(places=[(4.0, 1.0)]), **QUICK)
    assert planned_observations(result.tree.plan) == {"O1"}


def test_an_observation_whose_window_is_past_is_left_out() -> None:
    rows = [[observation("A", window_s=[-500.0, -100.0])], [observation("B")]]
    problem = example(places=[(4.0, 1.0), (5.0, -1.0)], observations=rows)
    result = solve(problem, **QUICK)
    assert planned_observations(result.tree.plan) == {"B"}
    assert "closed 100 s before the plan begins" in why_not(problem, result.tree.plan, "A").reason


def test_targets_that_no_way_leads_to_are_left_out() -> None:
    document = problem_document()
    document["legs"] = [leg for leg in document["legs"] if leg["to"] != "T2"]
    problem = problem_from_dict(document)
    result = solve(problem, **QUICK)
    assert "O2" not in planned_observations(result.tree.plan)
    assert "no path leads from the start to target T2" in why_not(problem, result.tree.plan, "O2").reason
    document["legs"] = []
    nothing = solve(problem_from_dict(document), **QUICK)
    assert nothing.status is PlanStatus.EMPTY
    assert "no target can be reached" in nothing.reasons[0]


def test_what_must_be_done_is_done_or_the_problem_is_infeasible() -> None:
    rows = [[observation("A", utility=9.0)], [observation("B", utility=0.5, must_do=True)]]
    near = example(places=[(4.0, 1.0), (7.0, -3.0)], observations=rows, time_s=3300.0, loss=0.0, spread=0.2)
    result = solve(near, **QUICK)
    assert "B" in planned_observations(result.tree.plan)
    far = example(places=[(4.0, 1.0), (60.0, -3.0)], observations=rows, time_s=3300.0)
    none = solve(far, **QUICK)
    assert none.status is PlanStatus.INFEASIBLE
    assert "observation B must be done, but no route on mean values" in none.reasons[0]


def test_a_chance_constraint_is_kept() -> None:
    problem = example(spread=0.6, time_s=4200.0)
    free = solve(problem, **QUICK)
    bound = dataclasses.replace(problem, max_overrun_probability=0.02)
    careful = solve(bound, **QUICK)
    assert free.check is not None
    assert careful.check is not None
    assert free.check.overrun > 0.02
    assert careful.check.overrun <= 0.02
    assert careful.expected_utility > 0.0


def test_precedence_and_several_observations_of_a_target_are_planned() -> None:
    rows = [
        [observation("A", "image", 2.0), observation("B", "place", 9.0)],
        [observation("C", "image", 4.0)],
    ]
    problem = example(
        places=[(4.0, 1.0), (5.0, -1.0)], observations=rows, precedence=[["A", "B"]], loss=0.02, spread=0.2
    )
    result = solve(problem, **QUICK)
    assert planned_observations(result.tree.plan) == {"A", "B", "C"}


def test_a_long_day_makes_more_than_a_table_holds() -> None:
    places = [(3.0 + 0.2 * (k % 5), 0.2 * (k // 5)) for k in range(16)]
    rows = [[observation(f"O{k + 1}", utility=3.0)] for k in range(16)]
    problem = example(places=places, observations=rows, time_s=20_000.0, energy_j=6e6, spread=0.2)
    result = solve(problem, max_branches=1, iterations=5)
    made = planned_observations(result.tree.plan)
    assert len(made) > 12
    assert f"from a route that makes {len(made)} of 16 observations" in result.reasons[0]
    assert result.evaluator == "monte-carlo"
    assert result.lower <= result.expected_utility <= result.upper
    assert result.expected_utility > 0.9 * 3.0 * len(made)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("time_s", [5e-324, 1e-200, 1e-12, 1e-6])
@pytest.mark.parametrize("energy_j", [5e-324, 1e-310, 1e-100, 1e-6, 1e12])
def test_a_budget_too_small_for_anything_plans_nothing(time_s: float, energy_j: float) -> None:
    result = solve(example(time_s=time_s, energy_j=energy_j), iterations=2, max_branches=1)
    assert result.status is PlanStatus.EMPTY
    assert "too small" in result.reasons[0]
    assert result.expected_utility == 0.0
    assert result.upper is not None
    assert result.upper >= 0.0


@pytest.mark.slow
def test_two_hundred_identical_targets_still_give_a_plan() -> None:
    places = [(4.0 + 0.01 * (k % 20), 0.01 * (k // 20)) for k in range(200)]
    rows = [[observation(f"O{k + 1}")] for k in range(200)]
    document = problem_document(places=[places[0]], observations=[rows[0]])
    document["targets"] = [{"id": f"T{k + 1}", "observations": rows[k]} for k in range(200)]
    first = document["legs"][0]
    names = ["start", *(f"T{k + 1}" for k in range(200))]
    document["legs"] = [
        {**first, "from": a, "to": b, "p_lose": {}} for a in names for b in names[1:] if a != b
    ]
    result = solve(problem_from_dict(document), time_limit_s=5.0, max_branches=2)
    assert result.status is PlanStatus.PLANNED
    assert 5.0 < result.expected_utility <= result.upper


def test_a_large_problem_is_planned_again_though_other_targets_are_chosen() -> None:
    places = [(3.0 + (k % 6), -4.0 + 1.6 * (k // 6)) for k in range(18)]
    rows = [[observation(f"O{k + 1}", utility=1.0 + (k % 5))] for k in range(18)]
    problem = example(places=places, observations=rows, time_s=9000.0)
    before = solve(problem, max_branches=0, iterations=5)
    worth = {f"O{k + 1}": 1.0 + ((k + 2) % 5) for k in range(18)}
    changed = dataclasses.replace(
        problem,
        targets=tuple(
            dataclasses.replace(
                t, observations=tuple(dataclasses.replace(o, utility=worth[o.id]) for o in t.observations)
            )
            for t in problem.targets
        ),
    )
    warm = (fitted(changed, before.tree.plan),)
    again = solve(changed, warm=warm, quick=True, time_limit_s=60.0, max_branches=0)
    assert again.status is PlanStatus.PLANNED
    assert again.expected_utility <= again.upper


def test_a_plan_is_compared_explained_and_made_again() -> None:
    problem = _instance("dev-reserve-4")
    result = solve(problem, **QUICK)
    assert result.branches > 0
    without = solve(problem, time_limit_s=20.0, iterations=40, max_branches=0)
    comparison = compare_plans(problem, result.tree.plan, without.tree.plan, futures=50_000)
    assert comparison.difference > 3.0 * comparison.standard_error
    assert comparison.worst_a <= comparison.value_a
    shorter = dataclasses.replace(
        problem, budget=dataclasses.replace(problem.budget, time_s=0.9 * problem.budget.time_s)
    )
    again = solve(shorter, warm=(fitted(shorter, result.tree.plan),), quick=True, time_limit_s=20.0)
    assert again.expected_utility > 0.9 * solve(shorter, **QUICK).expected_utility
    left = [t for t in problem.targets if t.id != problem.targets[0].id]
    fewer = dataclasses.replace(
        problem,
        targets=tuple(left),
        legs=tuple(x for x in problem.legs if problem.targets[0].id not in (x.to, x.origin)),
    )
    assert problem.targets[0].id not in {
        s.target for s in fitted(fewer, result.tree.plan) if isinstance(s, TrackStart)
    }
    held = planned_observations(result.tree.plan)
    for name in {o.id for o in problem.observations} - held:
        found = why_not(problem, result.tree.plan, name, futures=20_000)
        assert found.change <= 3.0 * found.standard_error
    with pytest.raises(PlannerError, match="is in the plan"):
        why_not(problem, result.tree.plan, next(iter(held)))
    with pytest.raises(PlannerError, match='no observation "X"'):
        why_not(problem, result.tree.plan, "X")


def _wider(problem: Problem, time: float, energy: float) -> Problem:
    budget = problem.budget
    wider = dataclasses.replace(budget, time_s=time * budget.time_s, energy_j=energy * budget.energy_j)
    return dataclasses.replace(problem, budget=wider)


def test_what_takes_more_of_both_budgets_is_not_said_to_be_out_of_reach() -> None:
    problem = example(places=[(4.0, 1.0)], time_s=900.0, energy_j=60_000.0, spread=0.05)
    found = why_not(problem, (), "O1", futures=1000)
    assert found.relaxation is not None
    assert found.relaxation.what == "time budget and energy budget"
    assert f"with {found.relaxation.factor:g} times the time budget and energy budget" in found.reason
    assert ObservationId("O1") in planned_observations(found.relaxation.plan)

    def held(time: float, energy: float) -> bool:
        return "O1" in planned_observations(solve(_wider(problem, time, energy), **QUICK).tree.plan)

    assert held(found.relaxation.factor, found.relaxation.factor)
    assert not held(3.0, 1.0)
    assert not held(1.0, 3.0)


def test_what_no_budget_lets_in_is_told_with_what_was_tried() -> None:
    found = why_not(example(places=[(4.0, 1.0)], time_s=90.0), (), "O1", futures=1000)
    assert found.relaxation is None
    assert "found no way with up to 3 times the budgets and the window, each and all together" in found.reason


def test_a_window_and_the_downlink_volume_are_relaxed_too() -> None:
    """The window of O1 is over when the rover comes; O2 leaves no volume for O3."""
    rows = [
        [observation("O1", utility=9.0, window_s=[200.0, 900.0])],
        [observation("O2", utility=9.0, data_mbit=6.0)],
        [observation("O3", utility=2.0, data_mbit=5.0)],
    ]
    problem = example(observations=rows, spread=0.05, time_s=8000.0, energy_j=1e6)
    problem = dataclasses.replace(problem, budget=dataclasses.replace(problem.budget, data_mbit=10.0))
    plan = visits(problem, "O2")
    late, large = (why_not(problem, plan, name, futures=2000) for name in ("O1", "O3"))
    assert [r.what for r in late.relaxations] == ["window"]
    assert [r.what for r in large.relaxations] == ["downlink volume"]
    assert large.relaxations[0].factor == pytest.approx(1.1, rel=0.02)
    for found in (late, large):
        assert found.observation in planned_observations(found.relaxations[0].plan)


# ------------------------------------------------------------------------------------- the command


def _run(*arguments: object) -> Any:
    return CliRunner().invoke(app, ["plan", *map(str, arguments)])


def test_the_command_writes_plan_tree_and_summary(tmp_path: Path) -> None:
    file = shared("contingency/instances/dev-reserve-4.json")
    out = tmp_path / "a"
    done = _run(file, "--iterations", 60, "--max-branches", 3, "--out", out)
    assert done.exit_code == 0, done.output
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    for key in (
        "format",
        "status",
        "strategy",
        "evaluator",
        "expected_utility",
        "standard_error",
        "lower",
        "upper",
        "branches",
        "wall_s",
        "seed",
        "problem_sha256",
        "crl_sha256",
    ):
        assert key in summary
    low, middle, high = (summary[f"utility_p{p}"] for p in ("05", "50", "95"))
    assert low <= middle <= high
    assert low < summary["expected_utility"] < high
    assert f"90 % of days earn {low:.4g} to {high:.4g}, half at least {middle:.4g}" in done.output
    tree = json.loads((out / "plan_tree.json").read_text(encoding="utf-8"))
    assert tree["format"] == "plan-tree/1"
    assert parse((out / "plan.crl").read_text(encoding="utf-8")).name == "dev-reserve-4"
    again = tmp_path / "b"
    _run(file, "--iterations", 60, "--max-branches", 3, "--out", again)
    for name in ("plan.crl", "plan_tree.json"):
        assert (out / name).read_bytes() == (again / name).read_bytes()


def test_the_command_writes_the_new_form_for_a_new_problem(tmp_path: Path) -> None:
    file = tmp_path / "problem.json"
    file.write_text(json.dumps(problem_to_dict(example())), encoding="utf-8")
    done = _run(file, "--iterations", 20, "--strategy", "pico2005", "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    tree = json.loads((tmp_path / "out/plan_tree.json").read_text(encoding="utf-8"))
    assert tree["format"] == "plan-tree/2"
    jsonschema = pytest.importorskip("jsonschema")
    schema = Path(__file__).parents[2] / "docs/formats/plan-tree-2.schema.json"
    jsonschema.validate(tree, json.loads(schema.read_text(encoding="utf-8")))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "is not JSON"),
        ("[]", "must be an object"),
        (json.dumps({**problem_document(), "hotel_w": -1}), "hotel_w is -1; it must be at least 0"),
        (json.dumps({k: v for k, v in problem_document().items() if k != "legs"}), "legs is missing"),
    ],
)
def test_bad_input_ends_with_one_line_and_exit_status_two(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "problem.json"
    file.write_text(text, encoding="utf-8")
    done = _run(file, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert message in done.output
    assert "Traceback" not in done.output
    assert not (tmp_path / "out").exists()


def test_an_infeasible_problem_ends_with_exit_status_three(tmp_path: Path) -> None:
    rows = [[observation("B", must_do=True)]]
    file = tmp_path / "problem.json"
    document = problem_document(places=[(60.0, -3.0)], observations=rows, time_s=3300.0)
    file.write_text(json.dumps(document), encoding="utf-8")
    done = _run(file, "--out", tmp_path / "out")
    assert done.exit_code == 3
    assert "observation B must be done" in done.output
    assert not (tmp_path / "out/plan.crl").exists()


def test_an_empty_plan_is_a_plan(tmp_path: Path) -> None:
    file = tmp_path / "problem.json"
    file.write_text(json.dumps(problem_document(time_s=60.0)), encoding="utf-8")
    done = _run(file, "--out", tmp_path / "out")
    assert done.exit_code == 0
    assert "too small" in done.output
    assert json.loads((tmp_path / "out/plan_tree.json").read_text(encoding="utf-8"))["plan"] == []
    assert "wait" in (tmp_path / "out/plan.crl").read_text(encoding="utf-8")


def test_the_best_route_on_mean_values_is_told_before_anything_larger_is_worked_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Who waits for a plan has one to look at while the table is made."""
    told: list[Progress] = []

    def late(*_: object, **__: object) -> NoReturn:
        raise StoppedError("the table would be made now")

    monkeypatch.setattr(import_module("planner.solve"), "reduce_problem", late)
    problem = example()
    result = solve(problem, report=told.append)
    plans = [progress.plan for progress in told if progress.plan and progress.phase == "branching"]
    assert planned_observations(plans[0]) == set(mean_route_of(problem, 1.0))
    assert result.status is PlanStatus.PLANNED, "it is also what is left of a search that is stopped"


def test_a_plan_alone_has_neither_bound_nor_notes() -> None:
    problem = example()
    whole, alone = solve(problem, iterations=20), solve(problem, iterations=20, plan_only=True)
    assert planned_observations(alone.tree.plan) == planned_observations(whole.tree.plan)
    assert math.isfinite(whole.upper)
    assert alone.upper == math.inf
    assert whole.tree.step_notes
    assert not alone.tree.step_notes


@pytest.mark.parametrize(
    ("family", "number"),
    [("penalty", 1042672941), ("penalty", 759329973), ("twice", 724271341), ("plain", 342190994)],
)
@pytest.mark.parametrize("quick", [False, True])
def test_an_order_that_ends_close_to_a_budget_is_not_passed_over(
    family: str, number: int, quick: bool
) -> None:
    """All amounts are constant: between its nodes a grid takes such an end for a likely overrun."""
    problem = generated(family, number)
    best = optimum(problem)
    found = solve(problem, max_branches=3, time_limit_s=1.0, quick=quick)
    assert found.check is not None
    assert found.check.mean > 0.995 * best - 4.0 * found.check.standard_error
    assert found.lower <= best + 1e-6
    assert best <= found.upper + 1e-6
