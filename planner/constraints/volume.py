"""What is observed on one path through a plan is within the downlink volume."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

from planner.constraints.rule import Chances, Columns, Obstacle, Reads, Rule
from planner.problem import Observation, Problem


@dataclass(frozen=True, slots=True)
class Volume(Rule):
    """Volumes of the observations in their order, and what may be sent in all, Mbit."""

    name = "volume"
    data_mbit: tuple[float, ...]
    limit_mbit: float

    @classmethod
    def of(cls, problem: Problem) -> Self | None:
        limit = problem.budget.data_mbit
        return None if limit is None else cls(tuple(o.data_mbit for o in problem.observations), limit)

    def propagate(self, columns: Columns) -> None:
        columns.data_mbit[:] = self.data_mbit
        columns.data_limit_mbit = self.limit_mbit

    def admits(self, on: Reads, made: int) -> bool:
        volume = float(sum(on.data_mbit[m] for m in range(len(on.data_mbit)) if (made >> m) & 1))
        return volume <= on.data_limit_mbit * (1.0 + 1e-12)

    def counted(self, on: Reads) -> int:
        return sum(1 << m for m in range(len(on.data_mbit)) if on.data_mbit[m] > 0.0)

    def side_limit(self) -> tuple[str, tuple[int, ...], int] | None:
        if sum(self.data_mbit) <= self.limit_mbit:
            return None
        amounts = tuple(math.ceil(1000.0 * volume) for volume in self.data_mbit)
        return "data volume", amounts, math.floor(1000.0 * self.limit_mbit)

    def relax(self, on: Reads, chances: Chances) -> None:
        chances.rows.append((on.data_mbit, on.data_limit_mbit))

    def explain(self, problem: Problem, what: Observation) -> Obstacle | None:
        del problem
        if what.data_mbit <= self.limit_mbit:
            return None
        sentence = f"{what.id} needs {what.data_mbit:g} Mbit; the budget is {self.limit_mbit:g} Mbit"
        return Obstacle("data volume", sentence)
