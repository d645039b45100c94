"""A short limit leaves time for branches, and a plan without them says when the limit is the cause."""

from __future__ import annotations

import dataclasses

import pytest

from planner.contingency.reduction import reduce_problem
from planner.problem import Problem, problem_from_dict
from planner.solve import PlanStatus, solve
from tests.planner.examples import observation, problem_document


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
