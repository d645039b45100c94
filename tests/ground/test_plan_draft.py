"""The best plan so far, as whoever watches the search reads it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, cast

import pytest

from ground.app.warm_up import small_day
from ground.day.prepare import PreparedDay
from ground.resources.plans import draft
from planner.plan_result import Progress
from planner.problem import problem_from_dict
from planner.solve import solve


def test_what_is_drawn_is_never_worth_less_than_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A part of the search that begins anew tells of its own first plan: that one is not drawn."""
    monkeypatch.setattr(draft, "network_geometry", lambda _day: {})
    monkeypatch.setattr(draft, "AT_MOST", 0.0)
    problem = problem_from_dict(small_day())
    plan = solve(problem, max_branches=1, iterations=1, seed=1).tree.plan
    file = tmp_path / "plan"
    drawing = draft.Drawing(str(file), PreparedDay(problem, cast("Any", None), {}, ()))
    drawn = []
    for value, told in ((5.0, plan), (3.0, plan[:-1]), (6.0, plan[:-1])):
        drawing.show(Progress(0.5, "branching", value, None, 0, told))
        drawn.append(json.loads(file.read_bytes())["value"])
    assert drawn == [5.0, 5.0, 6.0]


def test_a_plan_found_soon_after_another_one_is_drawn_when_it_may_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The search may find nothing more for long: the page must not go on showing the plan before."""
    now = [100.0]
    monkeypatch.setattr(draft, "network_geometry", lambda _day: {})
    monkeypatch.setattr(draft.time, "monotonic", lambda: now[0])
    problem = problem_from_dict(small_day())
    plan = solve(problem, max_branches=1, iterations=1, seed=1).tree.plan
    file = tmp_path / "plan"
    drawing = draft.Drawing(str(file), PreparedDay(problem, cast("Any", None), {}, ()))

    def drawn() -> tuple[int, float]:
        document = json.loads(file.read_bytes())
        return document["number"], document["value"]

    drawing.show(Progress(0.5, "branching", 5.0, None, 0, plan))
    assert drawn() == (1, 5.0)
    drawing._not_before = now[0] + draft.LONGEST_WAIT_S  # as after a drawing that took long
    drawing.show(Progress(0.5, "branching", 6.0, None, 0, plan[:-1]))
    drawing.show(Progress(0.5, "branching", 5.5, None, 0, plan[:-2]))
    drawing.catch_up()
    assert drawn() == (1, 5.0)
    now[0] += 1.1 * draft.LONGEST_WAIT_S
    drawing.catch_up()
    assert drawn() == (2, 6.0), "the best of those that waited"
    drawing.catch_up()
    assert drawn() == (2, 6.0)
