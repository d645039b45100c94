"""An observation starts within its window: early means waiting, late means that the step fails."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

from mission import Constraint, Sky, Window
from planner.constraints.rule import Before, Chances, Columns, Emission, Obstacle, Reads, Rule, Span, Stated
from planner.problem import Observation, Problem

FOREVER_S = 1e9
"""Later than any plan ends: a window that only opens is emitted with it."""


@dataclass(frozen=True, slots=True)
class StartWindow(Rule):
    """Spans, both ends inclusive, by the number of their observation."""

    name = "window"
    spans: tuple[tuple[int, Span], ...]

    @classmethod
    def state(cls, value: Constraint, stated: Stated, sky: Sky, day_s: float) -> None:
        del sky, day_s
        assert isinstance(value, Window)
        stated.spans.append((value.opens_s, value.closes_s))

    @classmethod
    def of(cls, problem: Problem) -> Self:
        windows = [(m, o.window_s) for m, o in enumerate(problem.observations)]
        return cls(tuple((m, span) for m, span in windows if span is not None))

    def propagate(self, columns: Columns) -> None:
        for m, (opens_s, closes_s) in self.spans:
            before = columns.window[m]
            columns.window[m] = max(before[0], opens_s), min(before[1], closes_s)

    def relax(self, on: Reads, chances: Chances) -> None:
        chances.most[on.window[:, 1] < 0.0] = 0.0

    def emit(self, on: Reads, m: int, what: Observation, before: Before) -> Emission:
        from executive.crl.values import Or

        del what, before
        opens_s, closes_s = map(float, on.window[m])
        if closes_s < 0.0:
            return Emission((Or(()),))
        if opens_s <= 0.0 and closes_s == math.inf:
            return Emission()
        return Emission(window_s=(max(opens_s, 0.0), min(closes_s, FOREVER_S)))

    def explain(self, problem: Problem, what: Observation) -> Obstacle | None:
        if what.window_s is None:
            return None
        opens_s, closes_s = what.window_s
        if closes_s < 0.0:
            sentence = f"the window of {what.id} closed {-closes_s:g} s before the plan begins"
            return Obstacle("window", sentence)
        limit_s = problem.budget.time_s
        if opens_s >= limit_s:
            return Obstacle(
                "window", f"the window of {what.id} opens at {opens_s:g} s; the time budget is {limit_s:g} s"
            )
        return None
