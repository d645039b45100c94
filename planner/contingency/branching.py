"""Contingent plans with at most k branches, grown where the optimal policy says that most is to be won.

Starting from several main lines, an option is added again and again at the point and with the condition and
plan that win most. The most that any branch can win at a point is known there: the mass that meets it times
(V* - V of going on). Plans for options come from the beam search over the mass in which the policy would do
something else; their conditions from `conditions.best_condition`. After each option the conditions and
plans of the others, the tails of all lists, and what a failed step does (stop or skip) are fitted anew.
Every value is the grid's, without sampling.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from planner.contingency.conditions import Bins, best_condition
from planner.contingency.policy import Policy
from planner.contingency.sequences import (
    Masses,
    Sequence,
    best_sequences,
    likely_path,
    sequence_steps,
    total,
)
from planner.evaluate.grid import Grid
from planner.evaluate.program import Program, compile_plan
from planner.evaluate.propagate import Backward, Flow, State, TailValues, forward, run_in
from planner.plan_edits import (
    change_step,
    lists_of,
    neutral_option,
    options_of,
    put_option,
    replace_option,
    steps_at,
    with_tail,
    without_option,
    without_step,
    without_unused_tracks,
)
from planner.plan_tree import (
    Branch,
    Condition,
    Navigate,
    Observe,
    OnFail,
    Option,
    Path,
    Plan,
    Step,
    TrackStart,
    TrackStop,
    Visit,
    count_branches,
    walk,
)

FOLLOWED = 2e-4
"""Share of the mass that a state needs to be looked at when a branch is fitted."""

KEPT_TRACKS = 2
"""Tracks given up by a plan that are tried to be kept for a later option."""

MOVES_TRIED = 2
"""Options that are tried for a line at once."""

LINES_KEPT = (5, 3, 2)
"""Lines that are kept after the first option, after the second, and after every further one."""

PROMISE_EQUAL = 1e-3
"""Share of the value within which two beginnings promise the same."""


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
    finished: bool = False

    def best(self, branches: int) -> tuple[float, Plan]:
        return self.curve[min(branches, len(self.curve) - 1)]


@dataclass(frozen=True, eq=False)
class _Point:
    """A place in a list of steps where an option may be put: before the step at `path` (or at the list's
    end).
    """

    path: Path
    row: int
    masses: Masses
    regret: float


@dataclass(frozen=True, eq=False)
class _Move:
    gain: float
    plan: Plan


class _Plan:
    """A plan with its program, value and distributions on one grid."""

    def __init__(self, tails: TailValues, plan: Plan):
        self.grid, self.plan = tails.grid, plan
        self.program: Program = compile_plan(self.grid.model, plan, mark_ends=True)
        self.backward = Backward(self.grid, self.program, tails)
        self.value = self.backward.total()
        self._flow: Flow | None = None

    @property
    def flow(self) -> Flow:
        if self._flow is None:
            self._flow = forward(self.grid, self.program)
        return self._flow

    @property
    def branches(self) -> int:
        return count_branches(self.plan)


class _Grower:
    def __init__(
        self, policy: Policy, grid: Grid, limits: SearchLimits, should_stop: Callable[[], bool]
    ) -> None:
        self.policy, self.grid, self.limits = policy, grid, limits
        self.model = grid.model
        self.bins = Bins(grid)
        self.tails = TailValues(grid)
        self.iterations = 0
        self.should_stop = should_stop
        self._optimal: dict[State, Any] = {}
        self._sequences: dict[bytes, Sequence] = {}

    def over(self) -> bool:
        limit = self.limits.iterations
        return (limit is not None and self.iterations >= limit) or self.should_stop()

    def optimal(self, state: State) -> Any:
        """Return V* in a state, in the precision of the grid."""
        value = self._optimal.get(state)
        if value is None:
            value = self._optimal[state] = self.policy.value(state).astype(np.float64)
        return value

    def sequence(self, masses: Masses, width: int, before: int) -> Sequence:
        """Return the best unbranched plan found from a distribution; the same distribution is met often.

        `before` are the observations (bits) that may have been made: they use downlink volume.
        """
        if not self.policy.sets.voluminous:
            before = 0
        digest = hashlib.blake2b(repr(before).encode(), digest_size=16)
        for state, mass in masses.items():
            digest.update(repr((width, *state)).encode())
            digest.update(mass.tobytes())
        key = digest.digest()
        known = self._sequences.get(key)
        if known is None:
            found = best_sequences(self.policy, masses, width=width, before=before)
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

    # ------------------------------------------------------------------------------------- points

    def points(self, plan: _Plan) -> list[_Point]:
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
                    if float(m.sum()) >= FOLLOWED * max(weight, 0.01) and s.place
                }
                if not kept:
                    continue
                regret = sum(
                    float(np.vdot(m, np.maximum(self.optimal(s) - plan.backward.value(row, s), 0.0)))
                    for s, m in kept.items()
                )
                found.append(_Point(path, row, kept, regret))
        found.sort(key=lambda p: (-p.regret, p.path))
        return found

    def candidates(self, plan: _Plan, point: _Point, going_on: dict[State, Any]) -> list[Plan]:
        """Return plans that an option at a point might hold."""
        policy, model = self.policy, self.model
        regions: list[tuple[float, Masses]] = []
        advantage: dict[State, Any] = {}
        floor = 1e-4 * max(1.0, abs(plan.value))
        for s in point.masses:
            advantage[s] = np.maximum(self.optimal(s) - going_on[s], 0.0)
        by_action: dict[int, Masses] = {}
        for s, mass in point.masses.items():
            index = policy.index_of(s)
            if index is None:
                continue
            names, values = policy.actions(s.place, index)
            if not names:
                by_action.setdefault(-1, {})[s] = mass
                continue
            best = np.argmax(values, axis=0)
            stops = values[best, np.arange(values.shape[1])] <= 1e-9
            choice = np.where(stops, -1, np.array(names)[best]).reshape(self.grid.shape)
            worthwhile = advantage[s] > floor
            for m in (-1, *names):
                part = np.where((choice == m) & worthwhile, mass, 0.0)
                if float(part.sum()) > 0.0:
                    by_action.setdefault(m, {})[s] = part
        for masses in by_action.values():
            weight = sum(float(np.vdot(m, advantage[s])) for s, m in masses.items())
            regions.append((weight, masses))
        for p in range(1, model.n + 1):
            for truth in (False, True):
                part_of = {s: m for s, m in point.masses.items() if bool((s.tracked >> p) & 1) is truth}
                if 0 < len(part_of) < len(point.masses):
                    weight = sum(float(np.vdot(m, advantage[s])) for s, m in part_of.items())
                    regions.append((weight, part_of))
        regions.append(
            (point.regret, {s: np.where(advantage[s] > floor, m, 0.0) for s, m in point.masses.items()})
        )
        regions.sort(key=lambda r: -r[0])
        found: dict[Plan, None] = {(): None}
        before = self.made_before(plan.plan, point.path)
        rest = steps_at(plan.plan, point.path)
        for k, step in enumerate(rest):
            if k and isinstance(step, Navigate) and not any(isinstance(x, Branch) for x in rest[k:]):
                found.setdefault(rest[k:])
        for weight, masses in regions[:7]:
            if weight < 0.02 * point.regret or weight <= floor * 0.1:
                continue
            masses = {s: m for s, m in masses.items() if float(m.sum()) > 0.0}
            if not masses:
                continue
            for order in self.shortened(self.sequence(masses, 2, before).order):
                found.setdefault(sequence_steps(policy, order, point.masses))
        return list(found)

    def shortened(self, order: tuple[int, ...]) -> list[tuple[int, ...]]:
        """Return a sequence and its beginnings that need fewer tracks, which makes every drive shorter."""
        model = self.model
        found = [order]
        for length in range(len(order) - 1, 0, -1):
            if any(model.is_place[m] for m in order[length:]):
                found.append(order[:length])
        return found[:3]

    def values_of(self, steps: Plan, masses: Masses) -> dict[State, Any]:
        """Return the value of carrying out steps, per state."""
        program = compile_plan(self.model, steps)
        backward = Backward(self.grid, program, self.tails)
        return {s: backward.value(program.entry, s) for s in masses}

    def fit(
        self, point: _Point, going_on: dict[State, Any], steps: Plan, at_end: bool
    ) -> tuple[float, tuple[Condition, ...]]:
        """Return the gain of an option with these steps and the condition that gives it."""
        self.iterations += 1
        value = self.values_of(steps, point.masses)
        gains = {s: m * (value[s] - going_on[s]) for s, m in point.masses.items()}
        choice = best_condition(self.model, self.bins, gains, point.masses)
        return choice.gain, choice.when

    # ------------------------------------------------------------------------------------- moves

    def best_option(self, plan: _Plan) -> _Move | None:
        """Return the plan with the option that wins most, if one wins."""
        floor = self.limits.tolerance * max(abs(plan.value), 1e-9)
        best: _Move | None = None
        for point in self.points(plan):
            if point.regret <= (best.gain if best else floor) or self.over():
                break
            going_on = {s: plan.backward.value(point.row, s) for s in point.masses}
            for steps in self.candidates(plan, point, going_on):
                gain, when = self.fit(point, going_on, steps, False)
                if gain > (best.gain if best else floor):
                    best = _Move(gain, put_option(plan.plan, point.path, Option(when, steps)))
        return best

    def moves(self, plan: _Plan) -> list[_Move]:
        """Return the moves worth carrying out: the best option, and the best where a track is kept."""
        found = []
        for variant in (plan, *self.keeping(plan)):
            move = self.best_option(variant)
            if move is not None:
                found.append(_Move(variant.value + move.gain - plan.value, move.plan))
        found.sort(key=lambda move: -move.gain)
        return found[:MOVES_TRIED]

    def kept(self, plans: list[_Plan], count: int) -> list[_Plan]:
        """Return the plans to go on with: the best, and the best of those whose beginning promises most.

        A main line that wants many branches is worth less than others while it has few.
        """
        distinct = {plan.plan: plan for plan in sorted(plans, key=lambda p: -p.value)}
        ranked = list(distinct.values())
        most = max(self.promise(plan) for plan in ranked)
        promising = next(p for p in ranked if self.promise(p) >= most - PROMISE_EQUAL * abs(most))
        chosen = ranked[:count]
        return chosen if promising in chosen else [*chosen[: count - 1], promising]

    def promise(self, plan: _Plan) -> float:
        """Return what the optimal policy earns after the first drive of a plan."""
        drive = next((s for s in plan.plan if isinstance(s, Navigate)), None)
        begin = run_in(self.model, plan.program, plan.program.entry)
        index = self.policy.index_of(begin.state)
        place = self.model.place_of[drive.to] if drive is not None else 0
        if drive is None or index is None or begin.over or not self.model.has_leg[begin.state.place, place]:
            return plan.value
        value = self.policy.drive_value(begin.state.place, index, place)
        return float(self.policy.grid.at(value, begin.t_s, begin.g_j))

    def keeping(self, plan: _Plan) -> list[_Plan]:
        """Return variants of a plan that go on tracking what it gives up, where the policy would, most first.

        A list gives up the tracks that it does not use, since each makes every drive longer. An option that
        comes later and wants one can only be found once the track is kept.
        """
        floor = self.limits.tolerance * max(abs(plan.value), 1e-9)
        found: list[tuple[float, Path]] = []
        for path, step in walk(plan.plan):
            if not isinstance(step, TrackStop):
                continue
            row, p = plan.program.step_row[path], self.model.place_of[step.target]
            lost = sum(
                float(
                    np.vdot(mass, self.optimal(s) - self.optimal(s._replace(tracked=s.tracked & ~(1 << p))))
                )
                for s, mass in plan.flow.get(row, {}).items()
                if (s.tracked >> p) & 1
            )
            if lost > floor:
                found.append((lost, path))
        found.sort(key=lambda item: (-item[0], item[1]))
        return [_Plan(self.tails, without_step(plan.plan, path)) for _, path in found[:KEPT_TRACKS]]

    def refit(self, plan: _Plan, *, plans: bool = True) -> _Plan:
        """Return the plan with every option fitted anew: its condition, and with `plans` its plan if that
        holds no branch.
        """
        for path in [p for p, _ in options_of(plan.plan)]:
            if self.over():
                return plan
            option = dict(options_of(plan.plan)).get(path)
            if option is None:
                continue
            without = _Plan(self.tails, neutral_option(plan.plan, path))
            row = without.program.option_test[path]
            masses = without.flow.get(row, {})
            weight = total(masses)
            kept = {s: m for s, m in masses.items() if float(m.sum()) >= FOLLOWED * max(weight, 0.01)}
            if not kept:
                continue
            going_on = {s: without.backward.value(row, s) for s in kept}
            regret = sum(
                float(np.vdot(m, np.maximum(self.optimal(s) - going_on[s], 0.0))) for s, m in kept.items()
            )
            point = _Point((*path[:-2], path[-2] + 1), row, kept, regret)
            choices = [option.plan]
            if (
                plans
                and not count_branches(option.plan)
                and regret > 2.0 * self.limits.tolerance * abs(plan.value)
            ):
                choices += [c for c in self.candidates(without, point, going_on) if c != option.plan]
            best_gain, best_new = 0.0, option
            for steps in choices:
                gain, when = self.fit(point, going_on, steps, False)
                if gain > best_gain:
                    best_gain, best_new = gain, Option(when, steps)
            if best_new != option:
                changed = _Plan(self.tails, replace_option(plan.plan, path, best_new))
                if changed.value > plan.value + 1e-9:
                    plan = changed
        return plan

    def retail(self, plan: _Plan) -> _Plan:
        """Return the plan with the tails of its lists (from the last branch on) replaced where that wins."""
        for owner, steps in list(lists_of(plan.plan)):
            if self.over():
                return plan
            first = next((k + 1 for k in range(len(steps) - 1, -1, -1) if isinstance(steps[k], Branch)), 0)
            while first < len(steps) and isinstance(steps[first], TrackStart):
                first += 1
            path = (*owner, first)
            row = plan.program.step_row.get(path)
            masses = plan.flow.get(row) if row else None
            if not row or not masses or (len(steps) and first == 0 and not owner):
                continue
            kept = {s: m for s, m in masses.items() if float(m.sum()) >= FOLLOWED * max(total(masses), 0.01)}
            if not kept or any(s.place == 0 for s in kept):
                continue
            self.iterations += 1
            sequence = self.sequence(kept, self.limits.width, self.made_before(plan.plan, path))
            tails = [sequence_steps(self.policy, order, kept) for order in self.shortened(sequence.order)]
            ranked: list[tuple[float, int, Plan]] = []
            for tail in tails:
                value = self.values_of(tail, kept)
                ranked.append((sum(float(np.vdot(m, value[s])) for s, m in kept.items()), -len(ranked), tail))
            new = max(ranked)[2]
            if new == steps[first:]:
                continue
            changed = _Plan(self.tails, with_tail(plan.plan, path, new))
            if changed.value > plan.value + 1e-9:
                plan = changed
        return plan

    def reflag(self, plan: _Plan) -> _Plan:
        """Return the plan with failed steps stopping or skipping, whichever is better."""
        for path, step in list(walk(plan.plan)):
            if not isinstance(step, Navigate | Observe):
                continue
            if self.over():
                return plan
            row = plan.program.step_row[path]
            fail, go = int(plan.program.fail[row]), int(plan.program.go[row])
            if fail == go and int(plan.program.op[row]) not in (3, 4, 5):
                continue
            other = OnFail.STOP if step.on_fail is OnFail.SKIP else OnFail.SKIP
            if not self._may_fail(plan, path, step):
                continue
            changed = _Plan(self.tails, change_step(plan.plan, path, replace(step, on_fail=other)))
            if changed.value > plan.value + 1e-7 * max(1.0, abs(plan.value)):
                plan = changed
        return plan

    def _may_fail(self, plan: _Plan, path: Path, step: Step) -> bool:
        model = self.model
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

    def pruned(self, plan: _Plan) -> _Plan:
        """Return the plan without options that win nothing."""
        for path in sorted((p for p, _ in options_of(plan.plan)), key=lambda p: (-len(p), p)):
            if path not in dict(options_of(plan.plan)):
                continue
            changed = _Plan(self.tails, without_option(plan.plan, path))
            if changed.value >= plan.value - 1e-7 * max(1.0, abs(plan.value)):
                plan = changed
        return plan

    def lean(self, plan: _Plan) -> _Plan:
        """Return the plan without tracks that it does not use."""
        lean = without_unused_tracks(self.model, plan.plan)
        return plan if lean == plan.plan else _Plan(self.tails, lean)

    def settled(self, plan: _Plan) -> _Plan:
        """Return the plan after fitting its parts in turn until little changes."""
        for _ in range(3):
            before = plan.value
            plan = self.retail(plan)
            plan = self.refit(plan)
            plan = self.reflag(plan)
            if plan.value < before + 3e-5 * max(1.0, abs(before)):
                break
        return plan


# ------------------------------------------------------------------------------------- the whole


def _main_lines(
    grower: _Grower, limits: SearchLimits, report: Callable[[Plan, float], None]
) -> tuple[list[Plan], list[Plan]]:
    """Return unbranched plans, best first, and the policy's most likely paths, which want branches to be
    good.
    """
    policy, model = grower.policy, grower.model
    starts = sorted(policy.start_values().items(), key=lambda item: (-item[1], item[0]))
    found: dict[Plan, float] = {}
    paths: dict[Plan, None] = {}
    floor = 0.0
    for k, (tracked, bound) in enumerate(starts[:64]):
        if bound <= floor or (found and grower.over()):
            break
        grower.iterations += 1
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
        if k < limits.main_lines and not grower.over():
            order = likely_path(policy, masses)
            if order:
                paths.setdefault((*head, *sequence_steps(policy, order, untracked)))
    ranked = sorted(found.items(), key=lambda item: (-item[1], str(item[0])))
    return [plan for plan, _ in ranked], [plan for plan in paths if plan not in dict(ranked[:2])]


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
    grower = _Grower(policy, grid, limits, should_stop)
    search = Search(policy, policy.best())
    best: list[tuple[float, Plan]] = [(0.0, ())] * (limits.max_branches + 1)

    def note(plan: _Plan) -> None:
        if not grid.model.plan_fits_downlink(plan.plan):
            return
        for k in range(plan.branches, limits.max_branches + 1):
            if plan.value > best[k][0] + 1e-12:
                best[k] = plan.value, plan.plan
                if k == limits.max_branches:
                    report(plan.plan, plan.value)

    lines = []
    for plan in extra:
        line = _Plan(grower.tails, plan)
        note(line)
        if line.branches and not grower.over():  # an earlier solution: its conditions are of another problem
            line = grower.refit(line, plans=False)
            note(line)
            line = grower.pruned(grower.settled(line))
        lines.append(grower.reflag(line))
        note(lines[-1])
    unbranched, paths = _main_lines(grower, limits, report)
    for plan in unbranched[: limits.main_lines + 4]:
        line = _Plan(grower.tails, plan)
        note(line)
        lines.append(grower.reflag(line))
        note(lines[-1])
    optimum = search.optimum
    enough = limits.enough * max(abs(optimum), 1e-9)
    lines.sort(key=lambda p: -p.value)
    grown = lines[: limits.main_lines] + [grower.reflag(_Plan(grower.tails, plan)) for plan in paths]
    for depth in range(limits.max_branches):
        if grower.over() or optimum - best[-1][0] <= enough:
            break
        following = []
        for line in grown:
            if grower.over():
                break
            for move in grower.moves(line):
                made = grower.pruned(grower.settled(_Plan(grower.tails, move.plan)))
                note(made)
                note(grower.lean(made))  # the search goes on with the tracks that a later option may want
                following.append(made)
        if not following:
            break
        grown = grower.kept(following, LINES_KEPT[min(depth, len(LINES_KEPT) - 1)])
    search.curve = best
    search.iterations = grower.iterations
    search.finished = not grower.over()
    return search
