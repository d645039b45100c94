"""Branches for plans that no table of the optimal policy reaches: grown and polished on common futures.

What an ending wins is known future by future (`futures`), and the condition for it follows from the
times, energies and tracks with which futures come to the point (`conditions`). Endings come from the
plan itself and from the exact routing engine (`endings`). After each option the lists are polished
(`polish`). This is policy improvement by rollouts (Bertsekas, Tsitsiklis and Wu 1997) over plans
instead of actions.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from planner.contingency.sampled.conditions import fitted_condition
from planner.contingency.sampled.endings import Endings
from planner.contingency.sampled.futures import FITTED, SCANNED, Change, Growth, Line, Sampler
from planner.contingency.sampled.polish import Polisher
from planner.evaluate.model import Model
from planner.plan_edits import lists_of, put_option, steps_at, without_unused_tracks
from planner.plan_tree import Branch, Navigate, Observe, Option, Path, Plan, count_branches

Curve = list[tuple[float, Plan]]
"""Value and plan with at most 0, 1, 2, ... branches."""


def better_by_branches(*curves: Curve) -> Curve:
    """Return for each number of branches the plan of the curves that is worth most, the first of equals."""
    held = [curve for curve in curves if curve]
    return [
        max((curve[min(most, len(curve) - 1)] for curve in held), key=lambda valued: valued[0])
        for most in range(max(map(len, held), default=0))
    ]


SHORTLIST, OF_A_POINT = 12, 3
"""Endings that are fitted on many futures for each option, and how many of them at one point: those of one
are much alike, and what they win on few futures is partly luck. By hand."""

TOLERANCE = 2e-4
"""Share of the value below which an option wins little: as `PlannerOptions.tolerance`."""

LEAST_SHARE = 0.02
"""Points that fewer futures come to get no option."""


@dataclass(frozen=True, eq=False)
class _Idea:
    gain: float
    path: Path
    steps: Plan


class _Grower:
    def __init__(self, sampler: Sampler, endings: Endings) -> None:
        self.sampler, self.model, self.endings = sampler, sampler.model, endings

    def points(self, line: Line) -> Iterator[tuple[Path, int]]:
        """Yield where an option may be put, with the row there."""
        for owner, steps in lists_of(line.plan):
            for k, step in enumerate(steps):
                path = (*owner, k)
                row = line.program.step_row.get(path, 0)
                if row and isinstance(step, Navigate | Observe):
                    share = float(np.mean(~np.isnan(line.seen.time_s[:, row])))
                    if share >= LEAST_SHARE:
                        yield path, row

    def ideas(self, line: Line) -> list[_Idea]:
        """Return endings for all points with what they win on few futures, best first."""
        ideas: list[_Idea] = []
        base = line.futures.utility[:SCANNED]
        for path, row in self.points(line):
            there, arrivals = line.arrivals(row, SCANNED)
            if int(there.sum()) < SCANNED * LEAST_SHARE:
                continue
            rest = steps_at(line.plan, path)
            best: list[float] = []  # of this point, the largest first
            for steps in self.endings.candidates(self.sampler, line, path, arrivals):
                if self.sampler.over():
                    return []
                gains = (self.sampler.utility(line, Change(path, steps), SCANNED) - base)[there]
                most = float(np.maximum(gains, 0.0).sum())  # with any condition
                if len(best) == OF_A_POINT and most <= best[-1]:
                    continue
                choice = fitted_condition(self.model, arrivals, gains, self.sampler.tests(rest, steps))
                best = sorted([*best, choice.gain], reverse=True)[:OF_A_POINT]
                ideas.append(_Idea(choice.gain / SCANNED, path, steps))
        ideas.sort(key=lambda idea: (-idea.gain, idea.path))
        return ideas

    def best_option(self, line: Line) -> Plan | None:
        """Return the plan with the option that wins most; None if none wins for sure."""
        changes = []
        for idea in _shortlist(self.ideas(line)):
            if self.sampler.over():
                break
            change = self.with_option(line, idea.path, idea.steps)
            if change is not None:
                changes.append(change)
        best = self.sampler.best_sure(line, changes)
        return line.changed(best) if best is not None else None

    def with_option(self, line: Line, path: Path, steps: Plan) -> Change | None:
        """Return an option at a point under the condition fitted on many futures.

        An ending that wins without any condition replaces the rest of its list.
        """
        fitted = self.sampler.fitted
        there, arrivals = line.arrivals(line.program.step_row[path], fitted)
        gains = (self.sampler.utility(line, Change(path, steps), fitted) - line.futures.utility)[there]
        rest = steps_at(line.plan, path)
        choice = fitted_condition(self.model, arrivals, gains, self.sampler.tests(rest, steps))
        if choice.gain <= 0.0:
            return None
        plan = put_option(line.plan, path, Option(choice.when, steps))
        *owner, k = path
        before = (*owner, k - 1)
        joins = bool(choice.when) and k > 0 and isinstance(steps_at(line.plan, before)[0], Branch)
        at = before if joins else path
        return Change(at, steps_at(plan, at))


def _shortlist(ideas: list[_Idea]) -> list[_Idea]:
    """Return the best of ideas that are in order, with few of each point."""
    of_point: dict[Path, int] = defaultdict(int)
    chosen = []
    for idea in ideas:
        of_point[idea.path] += 1
        if of_point[idea.path] <= OF_A_POINT:
            chosen.append(idea)
    return chosen[:SHORTLIST]


class Growing:
    """A plan that options are added to one after the other; `told` is told of each that is better.

    `curve` holds the best plans so far with at most 0, 1, 2, ... branches, and an empty one where the plan
    that it began with has more. Several may share a sampler and endings: what was worked out for one is known
    to the others. A plan ends with the option that wins less than a share `least` of its value.
    """

    def __init__(
        self,
        sampler: Sampler,
        endings: Endings,
        plan: Plan,
        told: Callable[[Plan, float], None] = lambda plan, value: None,
        *,
        least: float = 0.0,
    ) -> None:
        self.sampler, self.told, self.least = sampler, told, least
        self._grower, self._polisher = _Grower(sampler, endings), Polisher(sampler)
        self.ended = False
        self.plan, self.begun = plan, count_branches(plan)
        self.curve: Curve = [(0.0, ())] * self.begun
        self._keep(self._polisher.polished(sampler.line(plan), thoroughly=True))

    @property
    def branches(self) -> int:
        return count_branches(self.plan)

    def best(self, branches: int) -> Plan:
        """Return the best plan so far with at most so many branches."""
        return self.curve[min(branches, len(self.curve) - 1)][1]

    def _keep(self, line: Line) -> None:
        self.plan = line.plan  # a later option may want tracks that nothing uses yet
        lean = without_unused_tracks(self.sampler.model, line.plan)
        while len(self.curve) <= count_branches(line.plan):
            self.curve.append(self.curve[-1] if self.curve else (line.value, lean))
        if line.value >= self.curve[-1][0]:
            self.curve[-1] = line.value, lean
            self.told(lean, line.value)

    def grow(self) -> None:
        """Add the option that wins most; the plan has `ended` if none wins for sure, or time is over."""
        if self.branches >= self.sampler.limits.max_branches or self.sampler.over():
            self.ended = True
            return
        grown = self._grower.best_option(self.sampler.line(self.plan))
        if grown is None:
            self.ended = True
            return
        before = self.curve[-1][0]
        line = self.sampler.line(grown)
        self._keep(line)
        self._keep(self._polisher.polished(line))
        self.ended = self.curve[-1][0] - before < self.least * abs(before)

    def finish(self) -> Curve:
        """Grow the plan to its end, polish it thoroughly, and return its curve."""
        while not self.ended:
            self.grow()
        self._keep(self._polisher.polished(self.sampler.line(self.plan), thoroughly=True))
        return self.curve


def grow_branches(
    model: Model,
    plan: Plan,
    limits: Growth,
    *,
    should_stop: Callable[[], bool] = lambda: False,
    told: Callable[[Plan, float], None] = lambda plan, value: None,
    fitted: int = FITTED,
) -> Curve:
    """Return the best plans found with at most 0, 1, 2, ... branches that begin with a plan.

    Values are means over the `fitted` futures that the plans were fitted on: they favour the plans and must
    be checked on others.
    """
    return Growing(Sampler(model, limits, should_stop, fitted=fitted), Endings(model), plan, told).finish()
