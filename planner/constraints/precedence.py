"""An observation may be made only after others were made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from mission import After, Constraint, Sky
from planner.constraints.rule import Before, Columns, Emission, Reads, Rule, Stated
from planner.problem import Observation, ObservationId, Problem


@dataclass(frozen=True, slots=True)
class Precedence(Rule):
    """Names of all observations, and pairs of their numbers: the second only after the first."""

    name = "after"
    observations: tuple[ObservationId, ...]
    pairs: tuple[tuple[int, int], ...]

    @classmethod
    def state(cls, value: Constraint, stated: Stated, sky: Sky, day_s: float) -> None:
        del sky, day_s
        assert isinstance(value, After)
        stated.after += (value.request_id,)

    @classmethod
    def of(cls, problem: Problem) -> Self:
        names = tuple(o.id for o in problem.observations)
        number = {name: m for m, name in enumerate(names)}
        return cls(names, tuple((number[a], number[b]) for a, b in problem.precedence))

    def propagate(self, columns: Columns) -> None:
        for first, second in self.pairs:
            columns.precede(first, second)

    def feasible(self, on: Reads, m: int, done: int, tracked: bool) -> bool:
        del tracked
        return not int(on.predecessors[m]) & ~done

    def emit(self, on: Reads, m: int, what: Observation, before: Before) -> Emission:
        del what
        stated = [first for first, second in self.pairs if second == m]
        others = (k for k in range(len(self.observations)) if (int(on.predecessors[m]) >> k) & 1)
        return Emission(tuple(before.done(self.observations[k]) for k in dict.fromkeys((*stated, *others))))
