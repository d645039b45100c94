"""What our constraint means to the planner, beyond the windows that it comes to: a reason of its own."""

from __future__ import annotations

from typing import Self

from mission import Constraint, Sky
from mission.constraints import Window
from planner.constraints.rule import Obstacle, Rule, Stated
from planner.problem import Observation, Problem

MARK = "panels-warm-after-s"


class WarmPanels(Rule):
    """Observations that wait for warm panels: their windows are the product's to keep."""

    name = "panel_warm"

    @classmethod
    def state(cls, value: Constraint, stated: Stated, sky: Sky, day_s: float) -> None:
        """Add the windows of the day, and a mark by which `explain` knows the observation again."""
        windows = [w for w in value.reduced(sky, day_s) if isinstance(w, Window)]
        stated.any_of.append([(w.opens_s, w.closes_s) for w in windows])
        stated.refs[MARK] = f"{windows[0].opens_s:g}"

    @classmethod
    def of(cls, problem: Problem) -> Self | None:
        """Return the rule where some observation is marked."""
        return cls() if any(MARK in o.refs for o in problem.observations) else None

    def explain(self, problem: Problem, what: Observation) -> Obstacle | None:
        """Return that the day ends before the panels are warm."""
        warm_s = float(what.refs.get(MARK, 0.0))
        if warm_s < problem.budget.time_s:
            return None
        day_s = problem.budget.time_s
        return Obstacle("panels", f"the panels are warm {warm_s:g} s into the plan; it may take {day_s:g} s")
