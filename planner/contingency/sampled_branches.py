"""Branches for plans that no table of the optimal policy reaches: grown and polished on common futures.

Draws are keyed by future and action, so a plan and the same plan with another ending at one point agree in
every future that does not come there. What an ending wins is therefore known future by future, and the
condition for it follows from the times, energies and tracks with which futures come to the point
(`sampled_conditions`). Endings come from the rest of the plan with stops left out, and from the exact routing
engine on mean values, asked again from the place, time and energy of early, usual and late futures. After
each option the lists are polished: observations put in and taken out, conditions fitted anew. This is policy
improvement by rollouts (Bertsekas, Tsitsiklis and Wu 1997) over plans instead of actions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from planner.contingency.reduction import mean_routing
from planner.contingency.sampled_conditions import Arrivals, fitted_condition
from planner.contingency.seeding import route_steps
from planner.evaluate.model import Floats, Model, Truths
from planner.evaluate.monte_carlo import Futures, Passages, simulate
from planner.evaluate.program import Program, compile_plan
from planner.plan_edits import (
    lists_of,
    neutral_option,
    options_of,
    put_option,
    replace_option,
    steps_at,
    with_steps,
    with_tail,
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
)

Curve = list[tuple[float, Plan]]
"""Value and plan with at most 0, 1, 2, ... branches."""

SCANNED = 1_024
"""Futures on which every candidate is tried."""

FITTED = 16_384
"""Futures on which the best candidates are fitted and compared."""

SHORTLIST = 10
LEAST_SHARE = 0.02
"""Points that fewer futures come to get no option."""

SURE = 2.5
"""Standard errors by which a change must win on the futures that it is fitted on."""

QUANTILES = (0.15, 0.5, 0.85)
SHARES = (1.0, 0.85)
"""Of the budgets that are left, for routes on mean values."""

ROUTE_LABELS = 20_000
NEAREST = 6
"""Targets that are tried for a place in a list: those with the most worth for their detour."""

SWEEPS = 5


@dataclass(frozen=True, slots=True)
class Growth:
    """Limits of the growth; `iterations` counts candidates carried out and is the deterministic limit."""

    max_branches: int
    seed: int
    iterations: int | None = None


class _Line:
    """A plan, and what it earns and sees in the futures that all plans share."""

    def __init__(self, model: Model, plan: Plan, futures: int, seed: int) -> None:
        self.plan = plan
        self.program: Program = compile_plan(model, plan)
        self.futures: Futures = simulate(model, self.program, futures, seed=seed, watch=True)
        assert self.futures.seen is not None
        self.seen: Passages = self.futures.seen

    @property
    def value(self) -> float:
        return float(self.futures.utility.mean())

    def arrivals(self, row: int, count: int) -> tuple[Truths, Arrivals]:
        """Return which of the first futures come to a row, and how."""
        time_s = self.seen.time_s[:count, row]
        there = ~np.isnan(time_s)
        energy, tracked = self.seen.energy_j[:count, row], self.seen.tracked[:count, row]
        return there, Arrivals(time_s[there], energy[there], tracked[there])


@dataclass(frozen=True, eq=False)
class _Idea:
    gain: float
    path: Path
    steps: Plan


class Endings:
    """Routes on mean values from anywhere in a plan; one table answers for all of them."""

    def __init__(self, model: Model) -> None:
        from planner.orienteering.exact import ExactSolver

        self.model = model
        self.routing = mean_routing(model.problem)
        self.solver = ExactSolver(self.routing) if ExactSolver.fits(self.routing) else None
        self.known: dict[Any, tuple[int, ...]] = {}

    def route(self, place: int, t_s: float, e_j: float, without: frozenset[int]) -> tuple[int, ...]:
        """Return the best route from a place on; `without` are the observations that it cannot make."""
        p = self.routing
        time, energy = round(t_s / 60.0) * 60, round(e_j / 2000.0) * 2000
        if self.solver is None or time >= p.time_budget or energy >= (p.energy_budget or 0):
            return ()
        key = place, time, energy, without
        if key not in self.known:
            start = replace(p, start_site=place, start_time=time, energy_used=energy, done=without)
            self.known[key] = self.solver.solve(start, iterations=ROUTE_LABELS).route
        return self.known[key]


class _Grower:
    def __init__(self, model: Model, limits: Growth, should_stop: Callable[[], bool]) -> None:
        self.model, self.limits, self.should_stop = model, limits, should_stop
        self.endings = Endings(model)
        self.iterations = 0

    def over(self) -> bool:
        limit = self.limits.iterations
        return (limit is not None and self.iterations >= limit) or self.should_stop()

    def line(self, plan: Plan) -> _Line:
        return _Line(self.model, plan, FITTED, self.limits.seed)

    def utility(self, plan: Plan, futures: int) -> Floats:
        self.iterations += 1
        return simulate(self.model, plan, futures, seed=self.limits.seed, threads=1).utility

    # ------------------------------------------------------------------------------------- options

    def points(self, line: _Line) -> Iterator[tuple[Path, int]]:
        """Yield where an option may be put, with the row there."""
        for owner, steps in lists_of(line.plan):
            for k, step in enumerate(steps):
                path = (*owner, k)
                row = line.program.step_row.get(path, 0)
                if row and isinstance(step, Navigate | Observe):
                    share = float(np.mean(~np.isnan(line.seen.time_s[:, row])))
                    if share >= LEAST_SHARE:
                        yield path, row

    def candidates(self, line: _Line, path: Path, arrivals: Arrivals) -> list[Plan]:
        """Return endings that might replace the rest of a list."""
        rest = tuple(s for s in steps_at(line.plan, path) if not isinstance(s, Branch))
        made, place = self._before(line.plan, path)
        found: dict[Plan, None] = {(): None}
        stops = [k for k, step in enumerate(rest) if isinstance(step, Navigate)]
        for j, k in enumerate(stops):
            found.setdefault(rest[k:])
            end = stops[j + 1] if j + 1 < len(stops) else len(rest)
            found.setdefault((*rest[:k], *rest[end:]))
        for k, step in enumerate(rest):
            if isinstance(step, Observe):
                found.setdefault((*rest[:k], *rest[k + 1 :]))
        started = {self.model.place_of[s.target] for s in line.plan if isinstance(s, TrackStart)}
        for ending in self._routes(arrivals, made, place, started):
            found.setdefault(route_steps(self.model, ending, place, OnFail.SKIP))
        found.pop(rest, None)
        before = sum(1 << m for m in made)
        return [
            steps
            for steps in found
            if self.model.fits_downlink(before | sum(1 << m for m in self._observations(steps)))
        ]

    def _routes(
        self, arrivals: Arrivals, made: frozenset[int], place: int, started: set[int]
    ) -> Iterator[tuple[int, ...]]:
        model = self.model
        p = self.endings.routing
        for quantile in QUANTILES:
            t = float(np.quantile(arrivals.time_s, quantile))
            e = float(np.quantile(arrivals.energy_j, quantile))
            near = np.abs(arrivals.time_s - t) <= np.ptp(arrivals.time_s) * 0.1 + 1.0
            lost = {
                m
                for m in range(model.m)
                if model.is_place[m]
                and (
                    int(model.obs_place[m]) not in started
                    or float(arrivals.kept(int(model.obs_place[m]))[near].mean()) < 0.5
                )
            }
            for share in SHARES:
                late = p.time_budget - share * (p.time_budget - t)
                used = (p.energy_budget or 0) - share * ((p.energy_budget or 0) - e)
                yield self.endings.route(place, late, used, made | lost)

    def _observations(self, steps: Plan) -> list[int]:
        return [self.model.number_of[s.observation] for s in steps if isinstance(s, Observe)]

    def _before(self, plan: Plan, path: Path) -> tuple[frozenset[int], int]:
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

    def tests(self, *lists: Plan) -> list[int]:
        """Return the places whose tracks matter to lists of steps."""
        return sorted(
            {
                int(self.model.obs_place[m])
                for steps in lists
                for m in self._observations(steps)
                if self.model.is_place[m]
            }
        )

    def best_option(self, line: _Line) -> Plan | None:
        """Return the plan with the option that wins most; None if none wins for sure."""
        ideas: list[_Idea] = []
        for path, row in self.points(line):
            there, arrivals = line.arrivals(row, SCANNED)
            if int(there.sum()) < SCANNED * LEAST_SHARE:
                continue
            rest = steps_at(line.plan, path)
            for steps in self.candidates(line, path, arrivals):
                if self.over():
                    return None
                other = self.utility(with_tail(line.plan, path, steps), SCANNED)
                gains = (other - line.futures.utility[:SCANNED])[there]
                choice = fitted_condition(self.model, arrivals, gains, self.tests(rest, steps))
                ideas.append(_Idea(choice.gain / SCANNED, path, steps))
        ideas.sort(key=lambda idea: (-idea.gain, idea.path))
        best: tuple[float, Plan] | None = None
        for idea in ideas[:SHORTLIST]:
            if self.over():
                break
            plan = self.with_option(line, idea.path, idea.steps)
            if plan is not None:
                gain = self.surely(line, plan)
                if gain is not None and (best is None or gain > best[0]):
                    best = gain, plan
        return best[1] if best is not None else None

    def with_option(self, line: _Line, path: Path, steps: Plan) -> Plan | None:
        """Return the plan with an option at a point under the condition fitted on many futures.

        An ending that wins without any condition replaces the rest of its list.
        """
        there, arrivals = line.arrivals(line.program.step_row[path], FITTED)
        other = self.utility(with_tail(line.plan, path, steps), FITTED)
        gains = (other - line.futures.utility)[there]
        choice = fitted_condition(self.model, arrivals, gains, self.tests(steps_at(line.plan, path), steps))
        return put_option(line.plan, path, Option(choice.when, steps)) if choice.gain > 0.0 else None

    def surely(self, line: _Line, plan: Plan) -> float | None:
        """Return what a plan earns more than a line; None where that may be chance."""
        more = self.utility(plan, FITTED) - line.futures.utility
        gain = float(more.mean())
        return gain if gain > SURE * float(more.std()) / np.sqrt(FITTED) else None

    # ------------------------------------------------------------------------------------- polishing

    def polished(self, line: _Line) -> _Line:
        """Return the plan after the changes that win for sure, the best of each sweep at a time."""
        for _ in range(SWEEPS):
            base = line.futures.utility[:SCANNED]
            ideas: list[tuple[float, int, Plan]] = []
            for k, plan in enumerate(self.changes(line)):
                if self.over():
                    return line
                gain = float((self.utility(plan, SCANNED) - base).mean())
                if gain > 0.0:
                    ideas.append((-gain, k, plan))
            better: tuple[float, Plan] | None = None
            for _, _, plan in sorted(ideas)[:SHORTLIST]:
                found = self.surely(line, plan)
                if found is not None and (better is None or found > better[0]):
                    better = found, plan
            if better is None:
                break
            line = self.line(better[1])
        return line

    def changes(self, line: _Line) -> Iterator[Plan]:
        """Yield the plan with conditions fitted anew, and with observations taken out and put in."""
        for path, option in options_of(line.plan):
            refitted = self._refitted(line, path, option)
            if refitted is not None:
                yield refitted
        for owner, steps in lists_of(line.plan):
            for k, step in enumerate(steps):
                if isinstance(step, Observe):
                    yield with_steps(line.plan, (*owner, k), _without_observation)
            yield from self._insertions(line.plan, owner, steps)

    def _refitted(self, line: _Line, path: Path, option: Option) -> Plan | None:
        row = line.program.option_test[path]
        if not row:
            return None
        there, arrivals = line.arrivals(row, FITTED)
        if not there.any():
            return None
        forced = replace_option(line.plan, path, Option((), option.plan))
        gains = self.utility(forced, FITTED) - self.utility(neutral_option(line.plan, path), FITTED)
        rest = steps_at(line.plan, (*path[:-2], path[-2] + 1))
        choice = fitted_condition(self.model, arrivals, gains[there], self.tests(option.plan, rest))
        if not choice.when or choice.when == option.when:
            return None
        return replace_option(line.plan, path, replace(option, when=choice.when))

    def _insertions(self, plan: Plan, owner: Path, steps: Plan) -> Iterator[Plan]:
        model = self.model
        started = {model.place_of[s.target] for s in plan if isinstance(s, TrackStart)}
        for k in range(len(steps) + 1):
            if k < len(steps) and not isinstance(steps[k], Navigate):
                continue
            made, place = self._before(plan, (*owner, k))
            later = frozenset(self._observations(steps[k:]))
            ahead = next((model.place_of[s.to] for s in steps[k:] if isinstance(s, Navigate)), None)
            for m, legs in self._near(place, ahead, made | later):
                target = int(model.obs_place[m])
                tid = model.target_ids[target - 1]
                added: tuple[Step, ...] = (Observe(model.observation_ids[m], tid, OnFail.SKIP),)
                if legs:
                    added = (Navigate(tid, bool(model.is_place[m]), OnFail.SKIP), *added)
                longer = with_steps(plan, (*owner, k), lambda x, j, a=added: (*x[:j], *a, *x[j:]))  # type: ignore[misc]
                if model.is_place[m] and target not in started:
                    longer = (TrackStart(tid), *longer)
                if model.plan_fits_downlink(longer):
                    yield longer

    def _near(self, place: int, ahead: int | None, known: frozenset[int]) -> list[tuple[int, bool]]:
        """Return observations to put in at a place, best worth for time first, and whether one drives."""
        model = self.model
        offers: list[tuple[float, int, bool]] = []
        for m in range(model.m):
            target = int(model.obs_place[m])
            if m in known or model.utility[m] <= 0.0:
                continue
            seconds = float(model.obs[m, 0])
            if target != place:
                if not model.has_leg[place, target] or (
                    ahead is not None and not model.has_leg[target, ahead]
                ):
                    continue
                seconds += float(model.leg[place, target, 0])
                if ahead is not None and ahead != target:
                    seconds += float(model.leg[target, ahead, 0])
                    if model.has_leg[place, ahead]:
                        seconds -= float(model.leg[place, ahead, 0])
            offers.append(
                (-float(model.utility[m] * model.p_success[m]) / max(seconds, 1.0), m, target != place)
            )
        return [(m, legs) for _, m, legs in sorted(offers)[:NEAREST]]


def _without_observation(steps: Plan, k: int) -> Plan:
    """Return a list without the observation at k, and without the drive to it if it was alone there."""
    before = steps[k - 1] if k else None
    after = steps[k + 1] if k + 1 < len(steps) else None
    alone = isinstance(before, Navigate) and not isinstance(after, Observe | Branch)
    return (*steps[: k - alone], *steps[k + 1 :])


def grow_branches(
    model: Model,
    plan: Plan,
    limits: Growth,
    *,
    should_stop: Callable[[], bool] = lambda: False,
    told: Callable[[Plan, float], None] = lambda plan, value: None,
) -> Curve:
    """Return the best plans found with at most 0, 1, 2, ... branches that begin with a plan.

    Values are means over the futures that the plans were fitted on: they favour the plans and must be checked
    on others.
    """
    grower = _Grower(model, limits, should_stop)
    line = grower.polished(grower.line(plan))
    curve: Curve = []

    def keep(line: _Line) -> None:
        lean = without_unused_tracks(model, line.plan)
        while len(curve) <= count_branches(line.plan):
            curve.append(curve[-1] if curve else (line.value, lean))
        if line.value >= curve[-1][0]:
            curve[-1] = line.value, lean
            told(lean, line.value)

    keep(line)
    while count_branches(line.plan) < limits.max_branches and not grower.over():
        grown = grower.best_option(line)
        if grown is None:
            break
        line = grower.line(grown)
        keep(line)
        line = grower.polished(line)
        keep(line)
    return curve
