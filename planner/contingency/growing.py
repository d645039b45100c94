"""Options added one after the other, where the optimal policy says that most is to be won.

The most that any branch can win at a point is known there: the mass that meets it times (V* - V of going on).
The search is a beam over plans of 0, 1, 2, ... options. It is run several times, each time wider
(`PASSES`): the first, a single line, soon has a plan with all the options asked for, so a search that is cut
short is a narrower search and not a plan with fewer branches. What was worked out before is kept, and all
passes together cost little more than the widest alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from planner.contingency.option_fitting import OptionFitter
from planner.contingency.settling import Settler
from planner.contingency.valued_plan import ValuedPlan
from planner.plan_edits import put_option, without_step
from planner.plan_tree import Navigate, Option, Path, Plan, TrackStop, walk

KEPT_TRACKS = 2
"""Tracks given up by a plan that are tried to be kept for a later option."""

PROMISE_EQUAL = 1e-3
"""Share of the value within which two beginnings promise the same."""


@dataclass(frozen=True, slots=True)
class Pass:
    """How wide a search is: lines begun with (all if None), lines kept after the first option, after the
    second, and after every further one, options tried for a line at once, and whether tracks that a plan
    gives up are tried to be kept.
    """

    begun: int | None
    kept: tuple[int, ...]
    moves: int
    keeping: bool = True


PASSES = (
    Pass(2, (1,), 1, keeping=False),
    Pass(2, (1,), 1),
    Pass(None, (2,), 1),
    Pass(None, (5, 3, 2), 2),
)


@dataclass(frozen=True, eq=False)
class Move:
    """A change of a plan and what it wins."""

    gain: float
    plan: Plan


class Grower:
    """Adds options to plans; `tolerance` is the least gain of an option, as a share of the value."""

    def __init__(self, fitter: OptionFitter, settler: Settler, tolerance: float) -> None:
        self.fitter, self.settler, self.tolerance = fitter, settler, tolerance
        self._moves: dict[Plan, Move | None] = {}
        self._settled: dict[Plan, ValuedPlan] = {}

    def grow(
        self,
        lines: list[ValuedPlan],
        most: int,
        width: Pass,
        note: Callable[[ValuedPlan], None],
        enough: Callable[[], bool],
    ) -> None:
        """Search for plans of up to `most` options that begin as the lines do; `note` is told of each."""
        grown = lines if width.begun is None else self.kept(lines, width.begun)
        for depth in range(most):
            if self.fitter.over() or enough():
                return
            following = []
            for line in grown:
                for made in self.offspring(line, width):
                    note(made)
                    note(
                        self.settler.lean(made)
                    )  # the search goes on with tracks that a later option may want
                    following.append(made)
                if self.fitter.over():
                    return
            if not following:
                return
            grown = self.kept(following, width.kept[min(depth, len(width.kept) - 1)])

    def offspring(self, line: ValuedPlan, width: Pass) -> Iterable[ValuedPlan]:
        """Yield the plan with one option more, fitted anew, for each of the best moves."""
        for move in self.moves(line, keeping=width.keeping)[: width.moves]:
            made = self._settled.get(move.plan)
            if made is None:
                made = ValuedPlan(self.fitter.tails, move.plan)
                made = self.settler.pruned(self.settler.settled(made))
                if not self.fitter.over():
                    self._settled[move.plan] = made
            yield made

    def moves(self, plan: ValuedPlan, *, keeping: bool) -> list[Move]:
        """Return the moves worth carrying out: the best option, and the best where a track is kept."""
        found = []
        for variant in (plan, *(self.keeping(plan) if keeping else ())):
            move = self.best_option(variant)
            if move is not None:
                found.append(Move(variant.value + move.gain - plan.value, move.plan))
        found.sort(key=lambda move: -move.gain)
        return found

    def best_option(self, plan: ValuedPlan) -> Move | None:
        """Return the plan with the option that wins most, if one wins."""
        if plan.plan in self._moves:
            return self._moves[plan.plan]
        floor = self.tolerance * max(abs(plan.value), 1e-9)
        best: Move | None = None
        for point in self.fitter.points(plan):
            if point.regret <= (best.gain if best else floor) or self.fitter.over():
                break
            going_on = {s: plan.backward.value(point.row, s) for s in point.masses}
            for steps in self.fitter.candidates(plan, point, going_on):
                gain, when = self.fitter.fit(point, going_on, steps)
                if gain > (best.gain if best else floor):
                    best = Move(gain, put_option(plan.plan, point.path, Option(when, steps)))
        if not self.fitter.over():
            self._moves[plan.plan] = best
        return best

    def kept(self, plans: list[ValuedPlan], count: int) -> list[ValuedPlan]:
        """Return the plans to go on with: the best, and the best of those whose beginning promises most.

        A main line that wants many branches is worth less than others while it has few.
        """
        distinct = {plan.plan: plan for plan in sorted(plans, key=lambda p: -p.value)}
        ranked = list(distinct.values())
        most = max(self.promise(plan) for plan in ranked)
        promising = next(p for p in ranked if self.promise(p) >= most - PROMISE_EQUAL * abs(most))
        chosen = ranked[:count]
        return chosen if promising in chosen else [*chosen[: count - 1], promising]

    def promise(self, plan: ValuedPlan) -> float:
        """Return what a plan would earn if its branches won all that the optimal policy does from halfway on.

        That is its value and the regret halfway along its drives: what its beginning has lost by then is not
        won back.
        """
        drives = [k for k, step in enumerate(plan.plan) if isinstance(step, Navigate)]
        if not drives:
            return plan.value
        row = plan.program.step_row[drives[len(drives) // 2],]
        return plan.value + self.fitter.regret(plan, row, plan.flow.get(row, {}))

    def keeping(self, plan: ValuedPlan) -> list[ValuedPlan]:
        """Return variants of a plan that go on tracking what it gives up, where the policy would, most first.

        A list gives up the tracks that it does not use, since each makes every drive longer. An option that
        comes later and wants one can only be found once the track is kept.
        """
        floor = self.tolerance * max(abs(plan.value), 1e-9)
        found: list[tuple[float, Path]] = []
        for path, step in walk(plan.plan):
            if not isinstance(step, TrackStop):
                continue
            row, p = plan.program.step_row[path], self.fitter.model.place_of[step.target]
            lost = sum(
                float(
                    np.vdot(
                        mass,
                        self.fitter.optimal(s)
                        - self.fitter.optimal(s._replace(tracked=s.tracked & ~(1 << p))),
                    )
                )
                for s, mass in plan.flow.get(row, {}).items()
                if (s.tracked >> p) & 1
            )
            if lost > floor:
                found.append((lost, path))
        found.sort(key=lambda item: (-item[0], item[1]))
        return [
            ValuedPlan(self.fitter.tails, without_step(plan.plan, path)) for _, path in found[:KEPT_TRACKS]
        ]
