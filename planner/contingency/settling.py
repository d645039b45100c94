"""A branched plan fitted anew: conditions and plans of options, tails, and what a failed step does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planner.contingency.option_fitting import FOLLOWED, OptionFitter
from planner.contingency.sequences import sequence_steps, total
from planner.contingency.valued_plan import Point, ValuedPlan
from planner.plan_edits import (
    change_step,
    lists_of,
    neutral_option,
    options_of,
    replace_option,
    with_tail,
    without_option,
    without_unused_tracks,
)
from planner.plan_tree import (
    Branch,
    Navigate,
    Observe,
    OnFail,
    Option,
    Path,
    Plan,
    Step,
    TrackStart,
    count_branches,
    walk,
)


class Settler:
    """Fits the parts of a plan in turn; no step of it ever makes a plan worth less.

    `tolerance` is the share of the value that is worth work, `width` that of the beam for tails.
    """

    def __init__(self, fitter: OptionFitter, tolerance: float, width: int) -> None:
        self.fitter, self.tolerance, self.width = fitter, tolerance, width

    def refit(self, plan: ValuedPlan, *, plans: bool = True) -> ValuedPlan:
        """Return the plan with every option fitted anew: its condition, and with `plans` its plan if that
        holds no branch.
        """
        for path in [p for p, _ in options_of(plan.plan)]:
            if self.fitter.over():
                return plan
            option = dict(options_of(plan.plan)).get(path)
            if option is None:
                continue
            without = ValuedPlan(self.fitter.tails, neutral_option(plan.plan, path))
            row = without.program.option_test[path]
            masses = without.flow.get(row, {})
            weight = total(masses)
            kept = {s: m for s, m in masses.items() if float(m.sum()) >= FOLLOWED * max(weight, 0.01)}
            if not kept:
                continue
            going_on = {s: without.backward.value(row, s) for s in kept}
            regret = sum(
                float(np.vdot(m, np.maximum(self.fitter.optimal(s) - going_on[s], 0.0)))
                for s, m in kept.items()
            )
            point = Point((*path[:-2], path[-2] + 1), row, kept, regret)
            choices = [option.plan]
            if plans and not count_branches(option.plan) and regret > 2.0 * self.tolerance * abs(plan.value):
                choices += [c for c in self.fitter.candidates(without, point, going_on) if c != option.plan]
            best_gain, best_new = 0.0, option
            for steps in choices:
                gain, when = self.fitter.fit(point, going_on, steps)
                if gain > best_gain:
                    best_gain, best_new = gain, Option(when, steps)
            if best_new != option:
                changed = ValuedPlan(self.fitter.tails, replace_option(plan.plan, path, best_new))
                if changed.value > plan.value + 1e-9:
                    plan = changed
        return plan

    def retail(self, plan: ValuedPlan) -> ValuedPlan:
        """Return the plan with the tails of its lists (from the last branch on) replaced where that wins."""
        for owner, steps in list(lists_of(plan.plan)):
            if self.fitter.over():
                return plan
            first = next((k + 1 for k in range(len(steps) - 1, -1, -1) if isinstance(steps[k], Branch)), 0)
            while first < len(steps) and isinstance(steps[first], TrackStart):
                first += 1
            path = (*owner, first)
            row = plan.program.step_row.get(path)
            masses = plan.flow.get(row) if row else None
            if not row or not masses or (len(steps) and first == 0 and not owner):
                continue
            least = FOLLOWED * max(total(masses), 0.01)
            kept = {s: m for s, m in masses.items() if float(m.sum()) >= least}
            if not kept or any(s.place == 0 for s in kept):
                continue
            self.fitter.iterations += 1
            sequence = self.fitter.sequence(kept, self.width, self.fitter.made_before(plan.plan, path))
            tails = [
                sequence_steps(self.fitter.policy, order, kept)
                for order in self.fitter.shortened(sequence.order)
            ]
            ranked: list[tuple[float, int, Plan]] = []
            for tail in tails:
                value = self.fitter.values_of(tail, kept)
                ranked.append((sum(float(np.vdot(m, value[s])) for s, m in kept.items()), -len(ranked), tail))
            new = max(ranked)[2]
            if new == steps[first:]:
                continue
            changed = ValuedPlan(self.fitter.tails, with_tail(plan.plan, path, new))
            if changed.value > plan.value + 1e-9:
                plan = changed
        return plan

    def reflag(self, plan: ValuedPlan) -> ValuedPlan:
        """Return the plan with failed steps stopping or skipping, whichever is better."""
        for path, step in list(walk(plan.plan)):
            if not isinstance(step, Navigate | Observe):
                continue
            if self.fitter.over():
                return plan
            row = plan.program.step_row[path]
            fail, go = int(plan.program.fail[row]), int(plan.program.go[row])
            if fail == go and int(plan.program.op[row]) not in (3, 4, 5):
                continue
            other = OnFail.STOP if step.on_fail is OnFail.SKIP else OnFail.SKIP
            if not self._may_fail(plan, path, step):
                continue
            changed = ValuedPlan(
                self.fitter.tails, change_step(plan.plan, path, replace(step, on_fail=other))
            )
            if changed.value > plan.value + 1e-7 * max(1.0, abs(plan.value)):
                plan = changed
        return plan

    def _may_fail(self, plan: ValuedPlan, path: Path, step: Step) -> bool:
        model = self.fitter.model
        masses = plan.flow.get(plan.program.step_row[path], {})
        if isinstance(step, Navigate):
            target = model.place_of[step.to]
            return (
                step.require_tracked
                and bool(model.trackable[target])
                and any(not (s.tracked >> target) & 1 for s in masses)
            )
        assert isinstance(step, Observe)
        m = model.number_of[step.observation]
        target = int(model.obs_place[m])
        return bool(model.window[m, 1] < model.t_max_s) or any(
            s.place != target or (model.is_place[m] and not (s.tracked >> target) & 1) for s in masses
        )

    def pruned(self, plan: ValuedPlan) -> ValuedPlan:
        """Return the plan without options that win nothing."""
        for path in sorted((p for p, _ in options_of(plan.plan)), key=lambda p: (-len(p), p)):
            if path not in dict(options_of(plan.plan)):
                continue
            changed = ValuedPlan(self.fitter.tails, without_option(plan.plan, path))
            if changed.value >= plan.value - 1e-7 * max(1.0, abs(plan.value)):
                plan = changed
        return plan

    def lean(self, plan: ValuedPlan) -> ValuedPlan:
        """Return the plan without tracks that it does not use."""
        lean = without_unused_tracks(self.fitter.model, plan.plan)
        return plan if lean == plan.plan else ValuedPlan(self.fitter.tails, lean)

    def settled(self, plan: ValuedPlan) -> ValuedPlan:
        """Return the plan after fitting its parts in turn until little changes."""
        for _ in range(3):
            before = plan.value
            plan = self.retail(plan)
            plan = self.refit(plan)
            plan = self.reflag(plan)
            if plan.value < before + 3e-5 * max(1.0, abs(before)):
                break
        return plan
