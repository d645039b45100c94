"""A plan with its value and distributions on one grid, and the points where it may branch."""

from __future__ import annotations

from dataclasses import dataclass

from planner.contingency.sequences import Masses
from planner.evaluate.program import Program, compile_plan
from planner.evaluate.propagate import Backward, Flow, TailValues, forward
from planner.plan_tree import Path, Plan, count_branches


@dataclass(frozen=True, eq=False)
class Point:
    """A place in a list of steps where an option may be put: before the step at `path` (or at the list's
    end).
    """

    path: Path
    row: int
    masses: Masses
    regret: float


class ValuedPlan:
    """A plan with its program, value and distributions on one grid."""

    def __init__(self, tails: TailValues, plan: Plan):
        self.grid, self.plan = tails.grid, plan
        self.program: Program = compile_plan(self.grid.model, plan, mark_ends=True)
        self.backward = Backward(self.grid, self.program, tails)
        self.value = self.backward.total()
        self._flow: Flow | None = None

    @property
    def flow(self) -> Flow:
        if self._flow is None:
            self._flow = forward(self.grid, self.program)
        return self._flow

    @property
    def branches(self) -> int:
        return count_branches(self.plan)
