"""Plans carried out in futures that all of them share, and what a change to one of them wins there.

Draws are keyed by future and action, so a plan and the same plan with another ending at one point agree in
every future that does not come there. What an ending wins is therefore known future by future, and only the
ending, in the futures that come to the point, is carried out again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from planner.contingency.sampled.conditions import Arrivals
from planner.evaluate.model import Floats, Model, Truths
from planner.evaluate.monte_carlo import Futures, resume, simulate
from planner.evaluate.program import Program, compile_plan
from planner.evaluate.rollout import Passages, Standing, kinds_of
from planner.plan_edits import steps_to, with_tail
from planner.plan_tree import Branch, Navigate, Observe, Path, Plan

SCANNED = 1_024
"""Futures on which every candidate is tried."""

FITTED = 16_384
"""Futures on which the best candidates are fitted and compared."""

MOST_KNOWN = 20_000
"""Endings whose worth in the first futures is kept: 164 MB. By hand."""

SURE = 2.5
"""Standard errors by which a change must win on the futures that it is fitted on."""


@dataclass(frozen=True, slots=True)
class Growth:
    """Limits of the growth; `iterations` counts candidates carried out and is the deterministic limit.

    `lines` are the main lines that are looked for beside the best ones, where several are grown.
    """

    max_branches: int
    seed: int
    iterations: int | None = None
    lines: int = 0


@dataclass(frozen=True, eq=False)
class Change:
    """The rest of one list of steps replaced from `path` on."""

    path: Path
    rest: Plan


class Line:
    """A plan, and what it earns and sees in the futures that all plans share."""

    def __init__(self, model: Model, plan: Plan, seed: int, futures: int = FITTED) -> None:
        self.plan, self.seed, self.chance = plan, seed, model.sols.chance
        self.program: Program = compile_plan(model, plan, mark_ends=True)
        self.futures: Futures = simulate(model, self.program, futures, seed=seed, watch=True)
        assert self.futures.seen is not None
        self.seen: Passages = self.futures.seen

    @property
    def value(self) -> float:
        return float(self.futures.utility.mean())

    def changed(self, change: Change) -> Plan:
        return with_tail(self.plan, change.path, change.rest)

    def standing(self, row: int, count: int) -> Standing:
        """Return those of the first futures that come to a row, as they stand there."""
        return self.seen.at(row, count)

    def arrivals(self, row: int, count: int) -> tuple[Truths, Arrivals]:
        """Return which of the first futures come to a row, and how."""
        at = self.standing(row, count)
        there = np.zeros(count, np.bool_)
        there[at.number] = True
        hidden = len(self.chance) > 0
        kind = kinds_of(self.chance, self.seed, at.number) if hidden else np.zeros(0, np.int64)
        return there, Arrivals(at.time_s, at.energy_j, at.tracked, kind)


class Sampler:
    """Carries plans out in the shared futures, and counts how often: candidates in the first `scanned`, the
    best of them in `fitted` ones.
    """

    def __init__(
        self,
        model: Model,
        limits: Growth,
        should_stop: Callable[[], bool],
        *,
        scanned: int = SCANNED,
        fitted: int = FITTED,
    ) -> None:
        self.model, self.limits, self.should_stop = model, limits, should_stop
        self.scanned, self.fitted = scanned, fitted
        self.iterations = 0
        self._known: dict[tuple[Plan, Plan, int], Floats] = {}

    def over(self) -> bool:
        limit = self.limits.iterations
        return (limit is not None and self.iterations >= limit) or self.should_stop()

    def line(self, plan: Plan) -> Line:
        return Line(self.model, plan, self.limits.seed, self.fitted)

    def utility(self, line: Line, change: Change, futures: int) -> Floats:
        """Return what the first futures earn with a change; those that do not come there what they did.

        Where a future stands at a step follows from the steps on the way there, and not from the options that
        it did not take. So what it earns with other steps from there on is worked out once, whatever else of
        the plan is changed since.
        """
        self.iterations += 1
        row = line.program.step_row[change.path]
        there = np.flatnonzero(~np.isnan(line.seen.time_s[:futures, row]))
        utility = line.futures.utility[:futures].copy()
        key = steps_to(line.plan, change.path), change.rest, futures
        known = self._known.get(key)
        if known is None or np.isnan(known[there]).any():
            known = np.full(futures, np.nan)
            standing = line.standing(row, futures)
            known[there] = resume(self.model, change.rest, standing, seed=self.limits.seed)
            if futures <= self.scanned:
                if len(self._known) >= MOST_KNOWN:
                    self._known.clear()
                self._known[key] = known
        utility[there] = known[there]
        return utility

    def utility_at(self, line: Line, row: int, rest: Plan, futures: int) -> Floats:
        """Return what the first futures earn when those that come to a row go on with other steps."""
        self.iterations += 1
        standing = line.standing(row, futures)
        utility = line.futures.utility[:futures].copy()
        utility[standing.number] = resume(self.model, rest, standing, seed=self.limits.seed)
        return utility

    def surely(self, line: Line, change: Change) -> float | None:
        """Return what a changed plan earns more than a line; None where that may be chance."""
        more = self.utility(line, change, self.fitted) - line.futures.utility
        gain = float(more.mean())
        return gain if gain > SURE * float(more.std()) / np.sqrt(self.fitted) else None

    def best_sure(self, line: Line, changes: list[Change]) -> Change | None:
        """Return the change that wins most for sure; None if none does."""
        best: tuple[float, Change] | None = None
        for change in changes:
            if self.over():
                break
            gain = self.surely(line, change)
            if gain is not None and (best is None or gain > best[0]):
                best = gain, change
        return best[1] if best is not None else None

    def before(self, plan: Plan, path: Path) -> tuple[frozenset[int], int]:
        """Return the observations on the way to a step, and the place where it begins if nothing failed."""
        made: set[int] = set()
        place = 0
        for depth in range(0, len(path), 2):
            for step in plan[: path[depth]]:
                if isinstance(step, Observe):
                    made.add(self.model.number_of[step.observation])
                elif isinstance(step, Navigate):
                    place = self.model.place_of[step.to]
            if depth + 2 < len(path):
                branch = plan[path[depth]]
                assert isinstance(branch, Branch)
                plan = branch.options[path[depth + 1]].plan
        return frozenset(made), place

    def observations(self, steps: Plan) -> list[int]:
        return [self.model.number_of[s.observation] for s in steps if isinstance(s, Observe)]

    def tests(self, *lists: Plan) -> list[int]:
        """Return the places whose tracks matter to lists of steps."""
        return sorted(
            {
                int(self.model.obs_place[m])
                for steps in lists
                for m in self.observations(steps)
                if self.model.is_place[m]
            }
        )
