"""Why-not against all orders: what the study takes for the chance of an observation."""

from __future__ import annotations

from planner.contingency.why_not.limits import OF_TIME, widened
from planner.evaluate.model import Model
from studies.planner_why_not import chance, drawn
from tests.planner.examples import visits


def test_a_chance_near_the_least_that_counts_is_told_by_as_many_futures_as_that_takes() -> None:
    """It is 0.970 %; 50,000 futures told 1.05 %, and the order was taken for one that counts."""
    problem = drawn(848_066_986, 116, [5, 6])
    what = problem.observations[4]
    wide = widened(problem, what, (OF_TIME,), 1.24 / 1.01)
    model, plan = Model.of(wide), visits(wide, *(str(problem.observations[k].id) for k in (1, 2, 4)))
    assert abs(chance(model, plan, what) - 0.00970) < 0.0002
