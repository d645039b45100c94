"""What-if: changes of a day, and what a plan and a new plan are worth in the changed day."""

from __future__ import annotations

import pytest

from planner.changes import Changes, changed_problem, changes_of
from planner.errors import ChangeError
from planner.solve import solve
from planner.what_if import what_if
from tests.planner.examples import example


def test_changes_survive_their_written_form() -> None:
    changes = Changes(
        exclude=("a",), values={"b": 2.0}, loss_factor=0.5, keep_outs=(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)),)
    )
    assert changes_of(changes.as_dict()) == changes
    assert Changes().as_dict() == {}


def test_more_time_and_surer_tracks_never_cost() -> None:
    problem = example()
    plan = solve(problem, iterations=3, max_branches=2).tree.plan
    known = tuple(str(o.id) for o in problem.observations)
    for changes in (Changes(time_budget_s=2.0 * problem.budget.time_s), Changes(loss_factor=0.0)):
        changed = changed_problem(problem, changes)
        found = what_if(problem, plan, changed, known=known, max_branches=2, seed=1, iterations=3)
        assert found.change >= -3.0 * found.change_error
        assert found.replanning >= -1e-9


@pytest.mark.parametrize(
    ("changes", "member", "message"),
    [
        (Changes(values={"X": 3.0}), "values", "request X is not in the plan's problem"),
        (Changes(exclude=("O1",), force=("O1",)), "force", "request O1 is both excluded and demanded"),
    ],
)
def test_an_impossible_change_names_the_member(changes: Changes, member: str, message: str) -> None:
    with pytest.raises(ChangeError, match=message) as raised:
        changed_problem(example(), changes)
    assert raised.value.member == member
