"""A short limit leaves time for branches, and a plan without them says when the limit is the cause."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from planner.contingency.reduction import reduce_problem
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.options import PlannerOptions
from planner.plan_tree import Observe, Visit, planned_observations
from planner.problem import Problem, problem_from_dict
from planner.solve import PlanStatus, solve
from planner.strategies import Found, Task, optimal
from tests.planner.examples import observation, problem_document, visits


def _day(count: int) -> Problem:
    rows = [[observation(f"O{k}", "image", utility=4.0 + k)] for k in range(count)]
    places = [(4.0 * k - 10.0, 6.0 * (-1) ** k) for k in range(count)]
    document = problem_document(places=places, observations=rows, spread=0.5, time_s=9000.0, energy_j=1e8)
    return dataclasses.replace(problem_from_dict(document), overrun_penalty=30.0)


def test_a_table_that_the_limit_has_no_time_for_is_made_of_a_part() -> None:
    problem = _day(12)
    whole, part = reduce_problem(problem), reduce_problem(problem, most_live_sets=100)
    assert whole.exact
    assert not whole.hurried
    assert part.hurried
    assert not part.exact
    assert part.live_sets < whole.live_sets
    assert "than the limit allows" in part.notes[0]


def test_a_small_problem_stays_whole_at_any_limit() -> None:
    assert reduce_problem(_day(4), most_live_sets=1.0).exact


@pytest.mark.parametrize(("limit_s", "said"), [(0.02, True), (4.0, False)])
def test_a_plan_says_that_the_limit_left_no_time_for_branches(limit_s: float, said: bool) -> None:
    result = solve(_day(5), time_limit_s=limit_s)
    assert result.status is PlanStatus.PLANNED
    assert (result.branches == 0) is said
    assert any(why.startswith("no branches were tried: the limit") for why in result.reasons) is said
    assert (result.searched < 1.0) or not said
    assert (f"{limit_s:g} s" in " ".join(result.reasons)) is said


def test_without_branches_asked_for_nothing_is_missing() -> None:
    result = solve(_day(5), time_limit_s=0.02, max_branches=0)
    assert not [why for why in result.reasons if "branch" in why]


def _many(count: int = 12, **more: Any) -> dict[str, Any]:
    """Return a document of images that a table holds whole, were there the time for it."""
    rows = [[observation(f"O{k + 1}", "image", utility=4.0 + k)] for k in range(count)]
    places = [(4.0 * k - 10.0, 6.0 * (-1) ** k) for k in range(count)]
    return problem_document(
        **{"places": places, "observations": rows, "time_s": 9000.0, "energy_j": 1e8, "spread": 0.5, **more}
    )


def test_what_must_be_done_is_planned_with_what_comes_before_it() -> None:
    document = _many(precedence=[["O11", "O5"]])
    document["targets"][4]["observations"][0]["must_do"] = True
    document["targets"][10]["observations"][0]["utility"] = 0.01
    result = solve(problem_from_dict(document), time_limit_s=0.5)
    if result.status is PlanStatus.PLANNED:
        made = [str(step.observation) for step in result.tree.plan if isinstance(step, Observe | Visit)]
        assert made.index("O11") < made.index("O5")
    else:
        assert result.reasons


@pytest.mark.parametrize("live_sets", [1.0, 100.0, 1e9])
@pytest.mark.parametrize("count", [12, 40])
def test_a_part_holds_nothing_without_what_comes_before_it(count: int, live_sets: float) -> None:
    rng = np.random.default_rng(count)
    for _ in range(4):
        pairs = [sorted(rng.choice(count, 2, replace=False).tolist()) for _ in range(count)]
        document = _many(count, precedence=[[f"O{a + 1}", f"O{b + 1}"] for a, b in pairs], time_s=14_000.0)
        for k in rng.choice(count, 3, replace=False):
            document["targets"][k]["observations"][0]["must_do"] = True
        part = reduce_problem(problem_from_dict(document), most_live_sets=live_sets).problem
        names = {o.id for o in part.observations}
        assert names
        assert all(f"O{a + 1}" in names for a, b in pairs if f"O{b + 1}" in names)


def test_what_no_way_leads_to_is_no_reason_to_do_what_comes_after_it() -> None:
    document = _many(4, precedence=[["O1", "O2"]])
    document["legs"] = [leg for leg in document["legs"] if leg["to"] != "T1"]
    result = solve(problem_from_dict(document), time_limit_s=1.0)
    assert result.status is PlanStatus.PLANNED
    assert not {"O1", "O2"} & {str(o) for o in planned_observations(result.tree.plan)}
    document["targets"][1]["observations"][0]["must_do"] = True
    result = solve(problem_from_dict(document), time_limit_s=1.0)
    assert result.status is PlanStatus.INFEASIBLE
    assert "O2 must be done" in result.reasons[0]


def test_a_visit_that_only_pays_by_luck_is_planned_at_a_short_limit() -> None:
    document = _many(spread=0.8, loss=0.0)
    cheapest = min(leg["time_s"]["mean"] for leg in document["legs"] if leg["from"] == "start") + 300.0
    document["budget"]["time_s"] = 0.7 * cheapest
    result = solve(problem_from_dict(document), time_limit_s=0.5)
    assert result.status is PlanStatus.PLANNED, result.reasons
    assert result.lower > 0.0


def test_a_replan_at_a_short_limit_earns_what_its_warm_plan_earns() -> None:
    problem = _day(12)
    problem = dataclasses.replace(problem, budget=dataclasses.replace(problem.budget, time_s=60_000.0))
    warm = visits(problem, *(f"O{k}" for k in (0, 2, 4, 6, 8, 10, 11, 9, 7, 5, 3, 1)))
    earned = simulate(Model.of(problem), warm, 20_000, seed=7).estimate()
    again = solve(problem, time_limit_s=0.2, max_branches=0, warm=(warm,))
    assert again.check is not None
    assert again.check.mean >= earned.mean - 3.0 * earned.standard_error
    assert again.lower <= again.expected_utility <= again.upper
    assert again.reasons[0].startswith("the plan from before is kept")
    assert {str(o) for o in planned_observations(again.tree.plan)} == {f"O{k}" for k in range(12)}


@pytest.mark.parametrize("first", [("O5",), ("O5", "O11")])
def test_a_warm_plan_that_misses_what_must_come_before_is_not_kept(first: tuple[str, ...]) -> None:
    document = _many(precedence=[["O11", "O5"]], time_s=60_000.0)
    document["targets"][4]["observations"][0]["must_do"] = True
    problem = problem_from_dict(document)
    others = (o.id for o in problem.observations if o.id not in ("O5", "O11"))
    result = solve(problem, time_limit_s=0.2, max_branches=0, warm=(visits(problem, *first, *others),))
    assert result.status is PlanStatus.PLANNED
    made = [str(step.observation) for step in result.tree.plan if isinstance(step, Observe | Visit)]
    assert made.index("O11") < made.index("O5")


def test_a_large_table_gives_no_less_than_a_part_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """With 20 s for a table of all the demo's plan was worth less than with 5 s for ten observations."""

    def poor_on_all(task: Task) -> Found:
        if len(task.model.problem.observations) > 10:
            return Found([(0.0, visits(task.model.problem, "O1"))])
        return optimal.search(task)

    problem, options = problem_from_dict(_many()), PlannerOptions(many_live_sets=100, check_futures=20_000)
    part = solve(reduce_problem(problem, most_live_sets=0.0).problem, time_limit_s=0.6, options=options)
    monkeypatch.setattr("planner.solve.strategy_named", lambda name: poor_on_all)
    whole = solve(problem, time_limit_s=8.0, options=options)
    assert part.expected_utility > 10.0
    assert whole.expected_utility >= 0.99 * part.expected_utility
    assert whole.lower <= whole.expected_utility <= whole.upper


@pytest.mark.parametrize(("count", "futures"), [(8, 20_000), (9, 80_000)])
def test_a_plan_of_many_targets_is_checked_in_more_futures(count: int, futures: int) -> None:
    options = PlannerOptions(check_futures=20_000, long_check_futures=80_000)
    result = solve(_day(count), time_limit_s=0.5, options=options)
    assert result.check is not None
    drawn = (result.check.standard_deviation / result.check.standard_error) ** 2
    assert drawn == pytest.approx(futures, rel=1e-3)
    assert result.lower == pytest.approx(
        min(result.check.mean - 2.576 * result.check.standard_error, result.expected_utility)
    )
