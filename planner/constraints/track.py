"""An observation may be made only while the track of its target is alive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from mission import Constraint, Sky
from planner.constraints.rule import Before, Chances, Columns, Emission, Reads, Rule, Stated
from planner.problem import Observation, Problem, TargetId

if TYPE_CHECKING:
    from executive.crl.values import Comparison


def tracked(target: TargetId) -> Comparison:
    """Return the condition that the track of a target is alive."""
    from executive.crl.values import Comparison, Operator

    return Comparison("trackerstate", (str(target),), Operator.EQ, "tracked")


@dataclass(frozen=True, slots=True)
class Track(Rule):
    """Numbers of the observations that need their target tracked: placements, and images that ask for it."""

    name = "tracked"
    needing: tuple[int, ...]

    @classmethod
    def state(cls, value: Constraint, stated: Stated, sky: Sky, day_s: float) -> None:
        del value, sky, day_s
        stated.tracked = True

    @classmethod
    def of(cls, problem: Problem) -> Self:
        return cls(tuple(m for m, o in enumerate(problem.observations) if o.needs_track))

    def propagate(self, columns: Columns) -> None:
        columns.is_place[list(self.needing)] = True

    def feasible(self, on: Reads, m: int, done: int, tracked: bool) -> bool:
        del done
        return tracked or not on.is_place[m]

    def relax(self, on: Reads, chances: Chances) -> None:
        chances.most[on.is_place] = np.minimum(chances.most, chances.survival)[on.is_place]

    def emit(self, on: Reads, m: int, what: Observation, before: Before) -> Emission:
        from executive.crl.values import Or

        if not on.is_place[m]:
            return Emission()
        return Emission((tracked(what.target) if what.target in before.started else Or(()),))
