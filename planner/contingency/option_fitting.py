"""What an option at a point of a plan may hold, and the condition under which it wins most.

Plans for options come from the beam search over the mass in which the policy would do something else; their
conditions from `conditions.best_condition`. Every value is the grid's, without sampling.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any

import numpy as np

from planner.contingency.conditions import Bins, best_condition
from planner.contingency.policy import Policy
from planner.contingency.sequences import Masses, Sequence, best_sequences, sequence_steps, total
from planner.contingency.valued_plan import Point, ValuedPlan
from planner.evaluate.grid import Grid
from planner.evaluate.program import compile_plan
from planner.evaluate.propagate import Backward, State, TailValues
from planner.plan_edits import lists_of, steps_at
from planner.plan_tree import Branch, Condition, Navigate, Observe, Path, Plan, TrackStop, Visit
from planner.tally import Step, spend

HASHED, SPLIT = 15, 30
"""Passes over a mass that its digest takes, and passes and rows of a plan (`Step`) that splitting it by what
the policy does next takes. By hand."""

FOLLOWED = 2e-4
"""Share of the mass that a state needs to be looked at when a branch is fitted."""


class OptionFitter:
    """Points, plans and conditions of options under one policy, with what was worked out before.

    `iterations` counts fitted candidates; at `most` of them, or when told to stop, the work is over.
    """

    def __init__(self, policy: Policy, grid: Grid, most: int | None, should_stop: Callable[[], bool]) -> None:
        self.policy, self.grid, self.most = policy, grid, most
        self.model = grid.model
        self.bins = Bins(grid)
        self.tails = TailValues(grid)
        self.iterations = 0
        self.should_stop = should_stop
        m = self.model
        ends = (m.window[:, 1] < m.t_max_s) & (m.predecessors == 0)
        self.closing = sum(1 << int(k) for k in np.flatnonzero(ends))
        self._optimal: dict[State, Any] = {}
        self._sequences: dict[bytes, Sequence] = {}
        self._choices: dict[tuple[int, int], Any] = {}

    def over(self) -> bool:
        return (self.most is not None and self.iterations >= self.most) or self.should_stop()

    def optimal(self, state: State) -> Any:
        """Return V* in a state, in the precision of the grid."""
        value = self._optimal.get(state)
        if value is None:
            value = self._optimal[state] = self.policy.value(state).astype(np.float64)
        return value

    def sequence(self, masses: Masses, width: int, before: int) -> Sequence:
        """Return the best unbranched plan found from a distribution; the same distribution is met often.

        `before` are the observations (bits) on the way there: they use downlink volume, and one whose window
        ends is not tried again.
        """
        tried = before & self.closing
        if not self.policy.sets.voluminous:
            before = 0
        spend(Step.ROW, len(masses))
        spend(Step.PASS, HASHED * len(masses) * self.grid.nt * self.grid.ng)
        digest = hashlib.blake2b(repr((before, tried)).encode(), digest_size=16)
        for state, mass in masses.items():
            digest.update(repr((width, *state)).encode())
            digest.update(mass.tobytes())
        key = digest.digest()
        known = self._sequences.get(key)
        if known is None:
            found = best_sequences(self.policy, masses, width=width, before=before, tried=tried)
            known = self._sequences[key] = found[0]
        return known

    def made_before(self, plan: Plan, path: Path) -> int:
        """Return the observations (bits) on the way to a step."""
        bits = 0
        for depth in range(0, len(path), 2):
            for step in plan[: path[depth]]:
                if isinstance(step, Observe | Visit):
                    bits |= 1 << self.model.number_of[step.observation]
            if depth + 2 < len(path):
                branch = plan[path[depth]]
                assert isinstance(branch, Branch)
                plan = branch.options[path[depth + 1]].plan
        return bits

    def regret(self, plan: ValuedPlan, row: int, masses: Masses) -> float:
        """Return what the optimal policy would earn more than a plan from a row on, met with these masses."""
        return sum(
            float(np.vdot(m, np.maximum(self.optimal(s) - plan.backward.value(row, s), 0.0)))
            for s, m in masses.items()
        )

    def points(self, plan: ValuedPlan) -> list[Point]:
        """Return where an option may be put, by falling regret (the most that any option there can win)."""
        found = []
        for owner, steps in lists_of(plan.plan):
            for k in range(len(steps) + 1):
                path = (*owner, k)
                if k < len(steps) and not isinstance(steps[k], Navigate | Observe | TrackStop):
                    continue
                if k and isinstance(steps[k - 1], TrackStop):
                    continue  # the option before the tracks are given up can do all that one after can
                row = plan.program.step_row.get(path)
                masses = plan.flow.get(row) if row else None
                if not row or not masses:
                    continue
                weight = total(masses)
                kept = {
                    s: m
                    for s, m in masses.items()
                    if float(m.sum()) >= FOLLOWED * max(weight, 0.01) and (s.place or s.closed)
                }
                if not kept:
                    continue
                found.append(Point(path, row, kept, self.regret(plan, row, kept)))
        found.sort(key=lambda p: (-p.regret, p.path))
        return found

    def candidates(self, plan: ValuedPlan, point: Point, going_on: dict[State, Any]) -> list[Plan]:
        """Return plans that an option at a point might hold.

        They are the ends of the plan itself from each drive on, and sequences for the regions of the mass in
        which most is to be won.
        """
        floor = 1e-4 * max(1.0, abs(plan.value))
        advantage = {s: np.maximum(self.optimal(s) - going_on[s], 0.0) for s in point.masses}

        def weight(masses: Masses) -> float:
            return sum(float(np.vdot(m, advantage[s])) for s, m in masses.items())

        regions = [(weight(part), part) for part in self._by_action(point, advantage, floor)]
        regions += [(weight(part), part) for part in self._by_track(point)]
        worth = {s: np.where(advantage[s] > floor, m, 0.0) for s, m in point.masses.items()}
        regions.append((point.regret, worth))
        regions.sort(key=lambda r: -r[0])
        found: dict[Plan, None] = {(): None}
        before = self.made_before(plan.plan, point.path)
        rest = steps_at(plan.plan, point.path)
        for k, step in enumerate(rest):
            if k and isinstance(step, Navigate) and not any(isinstance(x, Branch) for x in rest[k:]):
                found.setdefault(rest[k:])
        for won, region in regions[:7]:
            masses = {s: m for s, m in region.items() if float(m.sum()) > 0.0}
            if won < 0.02 * point.regret or won <= floor * 0.1 or not masses:
                continue
            for order in self.shortened(self.sequence(masses, 2, before).order):
                found.setdefault(sequence_steps(self.policy, order, point.masses))
        return list(found)

    def _by_action(self, point: Point, advantage: dict[State, Any], floor: float) -> list[Masses]:
        """Return the mass by what the policy would do next (-1: nothing), where that wins something."""
        found: dict[int, Masses] = {}
        for s, mass in point.masses.items():
            index = self.policy.index_of(s)
            if index is None:
                continue
            choice = self._choice(s.place, index)
            spend(Step.ROW, SPLIT)
            spend(Step.PASS, SPLIT * self.grid.nt * self.grid.ng)
            if choice is None:
                found.setdefault(-1, {})[s] = mass
                continue
            worthwhile = (advantage[s] > floor) & (mass > 0.0)
            for m in np.flatnonzero(np.bincount(choice[worthwhile] + 1)) - 1:
                found.setdefault(int(m), {})[s] = np.where((choice == m) & worthwhile, mass, 0.0)
        return list(found.values())

    def _choice(self, place: int, index: int) -> Any:
        """Return what the policy goes for next, (nt, ng), -1 for nothing; None where nothing is left."""
        key = (place, index)
        if key not in self._choices:
            names, values = self.policy.actions(place, index)
            self._choices[key] = None
            if names:
                best = np.argmax(values, axis=0)
                stops = values[best, np.arange(values.shape[1])] <= 1e-9
                choice = np.where(stops, -1, np.array(names)[best])
                self._choices[key] = choice.reshape(self.grid.shape)
        return self._choices[key]

    def _by_track(self, point: Point) -> list[Masses]:
        """Return the mass parted by whether a target is tracked, for each target of which both occur."""
        found = []
        for p in range(1, self.model.n + 1):
            for truth in (False, True):
                part = {s: m for s, m in point.masses.items() if bool((s.tracked >> p) & 1) is truth}
                if 0 < len(part) < len(point.masses):
                    found.append(part)
        return found

    def shortened(self, order: tuple[int, ...]) -> list[tuple[int, ...]]:
        """Return a sequence and its beginnings that need fewer tracks, which makes every drive shorter."""
        model = self.model
        found = [order]
        found += (
            order[:length]
            for length in range(len(order) - 1, 0, -1)
            if any(model.is_place[m] for m in order[length:])
        )
        return found[:3]

    def values_of(self, steps: Plan, masses: Masses) -> dict[State, Any]:
        """Return the value of carrying out steps, per state."""
        program = compile_plan(self.model, steps)
        backward = Backward(self.grid, program, self.tails)
        return {s: backward.value(program.entry, s) for s in masses}

    def fit(
        self, point: Point, going_on: dict[State, Any], steps: Plan
    ) -> tuple[float, tuple[Condition, ...]]:
        """Return the gain of an option with these steps and the condition that gives it."""
        self.iterations += 1
        value = self.values_of(steps, point.masses)
        spend(Step.ROW, len(point.masses))
        spend(Step.PASS, 4 * len(point.masses) * self.grid.nt * self.grid.ng)
        gains = {s: m * (value[s] - going_on[s]) for s, m in point.masses.items()}
        choice = best_condition(self.model, self.bins, gains, point.masses)
        return choice.gain, choice.when
