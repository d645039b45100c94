"""Options that the optimal policy promises much of, before they have options of their own.

What an option wins is what its list earns, and a list that wants options of its own may earn less without
them than the branched plan beside it. So options are also put in by what the policy would earn from there on:
Q*(s, a) less Q*(s, b), a being what the option goes for first and b what the plan does. Whether one wins is
known once others have grown in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from planner.contingency.conditions import best_condition
from planner.contingency.option_fitting import OptionFitter
from planner.contingency.policy import Policy
from planner.contingency.sequences import Masses, sequence_steps
from planner.contingency.valued_plan import Point, ValuedPlan
from planner.evaluate.grid import Grid
from planner.evaluate.model import Floats
from planner.evaluate.propagate import State
from planner.plan_edits import put_option, steps_at
from planner.plan_tree import Condition, Observe, Option, Plan

LEAST = 5e-4
"""Share of the value that an option must promise. By hand: on 10 targets of seed 8613702 the four that won
promised 0.13 to 0.19 % of it, and won 0.05 to 0.3 %; of 18 others down to 0.04 % none won."""

NOTHING = -1
"""In place of an observation: the plan ends here."""


@dataclass(frozen=True, eq=False)
class _Promise:
    """An option at a point: what it promises, what it goes for first, when, and in which mass."""

    gain: float
    point: Point
    goal: int
    when: tuple[Condition, ...]
    region: Masses


class Promises:
    """Plans with one more option than a plan has, the most promising first; each is given once."""

    def __init__(self, policy: Policy, over: Callable[[], bool]) -> None:
        self.policy, self.model, self.over = policy, policy.model, over
        # values of plans are sums in double precision, on the nodes of the policy
        grid = Grid(policy.model, policy.grid.nt, policy.grid.ng)
        self.fitter = OptionFitter(policy, grid, None, over)
        self._plan: Plan | None = None
        self._left: list[_Promise] = []

    def next(self, plan: Plan) -> Plan | None:
        """Return the plan with the most promising option that was not given yet; None where none is left."""
        if plan != self._plan:
            self._plan = plan
            found = self._promises(ValuedPlan(self.fitter.tails, plan))
            self._left = sorted(found, key=lambda one: (one.gain, one.point.path, one.goal))
        while self._left and not self.over():
            made = self._carried_out(plan, self._left.pop())
            if self.model.admits_plan(made):
                return made
        return None

    def _promises(self, plan: ValuedPlan) -> Iterator[_Promise]:
        least = LEAST * abs(plan.value)
        for point in self.fitter.points(plan):
            if point.regret <= least or self.over():
                return
            values = {s: known for s in point.masses if (known := self._values(s)) is not None}
            planned = [
                self.model.number_of[step.observation]
                for step in steps_at(plan.plan, point.path)
                if isinstance(step, Observe)
            ]
            for goal in sorted({NOTHING, *(m for known in values.values() for m in known)}):
                promise = self._promise(point, values, planned, goal)
                if promise.gain > least:
                    yield promise

    def _values(self, state: State) -> dict[int, Floats] | None:
        """Return what the policy earns that goes for each observation next, on the nodes."""
        index = self.policy.index_of(state)
        if index is None:
            return None
        names, values = self.policy.actions(state.place, index)
        shape = self.policy.grid.shape
        return {m: row.reshape(shape) for m, row in zip(names, values, strict=True)}

    def _promise(
        self, point: Point, values: dict[State, dict[int, Floats]], planned: list[int], goal: int
    ) -> _Promise:
        """Return what is promised by going for an observation where the plan goes for the first of its rest
        that can still be made.
        """
        nothing = np.zeros(self.policy.grid.shape)
        gains: Masses = {}
        region: Masses = {}
        for state, known in values.items():
            usual = next((m for m in planned if m in known), NOTHING)
            if usual != goal:
                more = known.get(goal, nothing) - known.get(usual, nothing)
                gains[state] = point.masses[state] * more
                region[state] = np.where(more > 0.0, point.masses[state], 0.0)
        choice = best_condition(self.model, self.fitter.bins, gains, {s: point.masses[s] for s in gains})
        return _Promise(choice.gain, point, goal, choice.when, region)

    def _carried_out(self, plan: Plan, promise: _Promise) -> Plan:
        steps: Plan = ()
        masses = {s: mass for s, mass in promise.region.items() if float(mass.sum()) > 0.0}
        if promise.goal != NOTHING:
            before = self.fitter.made_before(plan, promise.point.path)
            order = self.fitter.sequence(masses, 2, before).order
            steps = sequence_steps(self.policy, order, promise.point.masses)
        return put_option(plan, promise.point.path, Option(promise.when, steps))
