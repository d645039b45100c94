"""Every plan must contain the observation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from mission import Constraint, Sky
from planner.constraints.rule import Columns, Floats, Rule, Stated, Truths
from planner.problem import Problem


@dataclass(frozen=True, slots=True)
class MustDo(Rule):
    """Numbers of the observations that must be done."""

    name = "must_do"
    demanded: tuple[int, ...]

    @classmethod
    def state(cls, value: Constraint, stated: Stated, sky: Sky, day_s: float) -> None:
        del value, sky, day_s
        stated.must_do = True

    @classmethod
    def of(cls, problem: Problem) -> Self | None:
        demanded = tuple(m for m, o in enumerate(problem.observations) if o.must_do)
        return cls(demanded) if demanded else None

    def propagate(self, columns: Columns) -> None:
        columns.must_do[list(self.demanded)] = True


def pressing(utility: Floats, must_do: Truths) -> Floats:
    """Return utilities under which what must be done is worth more than everything else together.

    Utilities [m], one of each observation; `must_do` [m] is true where it must be done.
    """
    bonus = 2.0 * float(utility.sum()) + 1.0
    return np.where(must_do, utility + bonus, utility)
