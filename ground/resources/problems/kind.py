"""How planning problems are stored and shown."""

from __future__ import annotations

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.problems.row import ProblemRow
from ground.resources.problems.value import Problem

PROBLEM = Kind(
    "problem",
    "prb",
    "problems",
    ProblemRow,
    Problem,
    Action.PLAN,
    "planning problem",
)
