"""Contingent plans with at most k branches: unbranched plans, and what grows out of them.

Several main lines are grown at once (`growing.py`): an option is added again and again at the point and with
the condition and plan that win most (`option_fitting.py`); after each, the conditions and plans of the
others, the tails of all lists, and what a failed step does are fitted anew (`settling.py`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from planner.contingency.growing import PASSES, Grower
from planner.contingency.option_fitting import OptionFitter
from planner.contingency.policy import Policy
from planner.contingency.sequences import Masses, best_sequences, likely_path, sequence_steps
from planner.contingency.settling import Settler
from planner.contingency.valued_plan import ValuedPlan
from planner.evaluate.grid import Grid
from planner.evaluate.propagate import State
from planner.plan_tree import Plan, TrackStart


@dataclass(frozen=True, slots=True)
class SearchLimits:
    """How far the search goes. `iterations` counts fitted candidates and is the deterministic limit."""

    max_branches: int = 6
    iterations: int | None = None
    main_lines: int = 4
    width: int = 4
    tolerance: float = 2e-4
    enough: float = 2e-4


@dataclass(eq=False)
class Search:
    """What the search found: `curve[k]` is the best (value, plan) with at most k branches."""

    policy: Policy
    optimum: float
    curve: list[tuple[float, Plan]] = field(default_factory=list)
    iterations: int = 0
    done: float = 1.0
    """Share of the passes that were carried out to their end; 1 where nothing more was to be won."""
    lines: tuple[Plan, ...] = ()
    """Unbranched plans that were looked at, those first that promise most with branches."""

    def best(self, branches: int) -> tuple[float, Plan]:
        return self.curve[min(branches, len(self.curve) - 1)]


class _Best:
    """The best (value, plan) with at most k branches, for each k; `report` is told of the best of all."""

    def __init__(self, most: int, report: Callable[[Plan, float], None]) -> None:
        self.curve: list[tuple[float, Plan]] = [(0.0, ())] * (most + 1)
        self.report = report

    def note(self, plan: ValuedPlan) -> None:
        if not plan.grid.model.admits_plan(plan.plan):
            return
        last = len(self.curve) - 1
        for k in range(plan.branches, last + 1):
            if plan.value > self.curve[k][0] + 1e-12:
                self.curve[k] = plan.value, plan.plan
                if k == last:
                    self.report(plan.plan, plan.value)


def _main_lines(
    fitter: OptionFitter, limits: SearchLimits, report: Callable[[Plan, float], None]
) -> tuple[list[Plan], list[Plan]]:
    """Return unbranched plans, best first, and the policy's most likely paths, which want branches to be
    good.
    """
    policy, model = fitter.policy, fitter.model
    starts = sorted(policy.start_values().items(), key=lambda item: (-item[1], item[0]))
    found: dict[Plan, float] = {}
    paths: dict[Plan, None] = {}
    floor = 0.0
    for k, (tracked, bound) in enumerate(starts[:64]):
        if bound <= floor or (found and fitter.over()):
            break
        fitter.iterations += 1
        masses: Masses = {State(0, 0, tracked): policy.grid.point(*policy.start_point(tracked))}
        untracked: Masses = {State(0, 0, 0): np.zeros(())}  # tracks that only options use go on
        head: Plan = tuple(
            TrackStart(model.target_ids[p - 1]) for p in range(1, model.n + 1) if (tracked >> p) & 1
        )
        for sequence in best_sequences(policy, masses, width=limits.width, keep=3 if k < 4 else 1):
            plan = (*head, *sequence_steps(policy, sequence.order, untracked))
            if sequence.order and plan not in found:
                found[plan] = sequence.value
                if sequence.value > floor:
                    floor = sequence.value
                    report(plan, sequence.value)
        if k < limits.main_lines and not fitter.over():
            order = likely_path(policy, masses)
            if order:
                paths.setdefault((*head, *sequence_steps(policy, order, untracked)))
    ranked = sorted(found.items(), key=lambda item: (-item[1], str(item[0])))
    return [plan for plan, _ in ranked], [plan for plan in paths if plan not in dict(ranked[:2])]


def _given_lines(
    fitter: OptionFitter, settler: Settler, given: tuple[Plan, ...], note: Callable[[ValuedPlan], None]
) -> list[ValuedPlan]:
    """Return the plans of an earlier solution, fitted to this problem."""
    lines = []
    for plan in given:
        line = ValuedPlan(fitter.tails, plan)
        note(line)
        if line.branches and not fitter.over():  # its conditions are of another problem
            line = settler.refit(line, plans=False)
            note(line)
            line = settler.pruned(settler.settled(line))
        lines.append(settler.reflag(line))
        note(lines[-1])
    return lines


def plan_optimal(
    policy: Policy,
    grid: Grid,
    limits: SearchLimits,
    *,
    should_stop: Callable[[], bool] = lambda: False,
    report: Callable[[Plan, float], None] = lambda plan, value: None,
    extra: tuple[Plan, ...] = (),
) -> Search:
    """Return the best plans found with 0, 1, ..., `max_branches` branches.

    `policy` and `grid` share their nodes. `report` is told of every better plan. `extra` are plans to begin
    with besides the search's own (from an earlier solution).
    """
    fitter = OptionFitter(policy, grid, limits.iterations, should_stop)
    settler = Settler(fitter, limits.tolerance, limits.width)
    grower = Grower(fitter, settler, limits.tolerance)
    best = _Best(limits.max_branches, report)
    lines = _given_lines(fitter, settler, extra, best.note)
    unbranched, paths = _main_lines(fitter, limits, report)
    for plan in unbranched[: limits.main_lines + 4]:
        line = ValuedPlan(fitter.tails, plan)
        best.note(line)
        lines.append(settler.reflag(line))
        best.note(lines[-1])
    lines.sort(key=lambda p: -p.value)
    likely = [settler.reflag(ValuedPlan(fitter.tails, plan)) for plan in paths]
    promising = sorted((p for p in lines + likely if not p.branches), key=lambda p: -grower.promise(p))
    lines = lines[: limits.main_lines] + likely
    optimum = policy.best()
    enough = limits.enough * max(abs(optimum), 1e-9)
    passed = 0
    for width in PASSES if lines else ():
        grower.grow(
            lines, limits.max_branches, width, best.note, lambda: optimum - best.curve[-1][0] <= enough
        )
        passed += not fitter.over()
    won = not lines or optimum - best.curve[-1][0] <= enough
    done = 1.0 if won else passed / len(PASSES)
    return Search(policy, optimum, best.curve, fitter.iterations, done, tuple(p.plan for p in promising))
