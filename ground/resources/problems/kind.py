"""How planning problems are stored and shown."""

from __future__ import annotations

from collections.abc import Sequence

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.records.show import value_of
from ground.resources.problems.row import ProblemRow
from ground.resources.problems.value import Problem


def show_problems(_session: object, rows: Sequence[ProblemRow]) -> list[Problem]:
    return [value_of(Problem, r) for r in rows]


PROBLEM = Kind("problem", "planning problem", "prb", "problems", ProblemRow, show_problems, Action.PLAN)
