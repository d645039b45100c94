"""Plans polished on common futures: observations put in, taken out and exchanged, visits moved and turned
round, conditions fitted anew.

The moves of visits are those of local search for tours (Or 1976, Croes 1958), judged on what the plan earns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

from planner.contingency.sampled.conditions import fitted_condition
from planner.contingency.sampled.futures import Change, Line, Sampler
from planner.plan_edits import lists_of, neutral_option, options_of, replace_option, steps_at, with_tail
from planner.plan_tree import Branch, Navigate, Observe, OnFail, Option, Path, Plan, Step, TrackStart

SWEEPS = 10
"""Passes over a plan; most end earlier, when one wins nothing. By hand: each makes one change."""

THOROUGH = 3
"""How many times more passes there are where visits are changed too: lines are begun with ten observations
that end with twenty. By hand."""

SHORTLIST = 10
"""Changes that are tried on many futures in each sweep."""

NEAREST = 6
"""Targets that are tried for a place in a list: those with the most worth for their detour."""


class Polisher:
    """Puts observations into a plan and takes them out, judged on common futures."""

    def __init__(self, sampler: Sampler) -> None:
        self.sampler, self.model = sampler, sampler.model

    def polished(self, line: Line, *, thoroughly: bool = False) -> Line:
        """Return the plan after the changes that win for sure, the best of each sweep at a time.

        Visits are exchanged, moved and turned round only where it is to be polished `thoroughly`, and as long
        as nothing else wins: these are most of the changes.
        """
        of_visits = False
        for _ in range(SWEEPS * (THOROUGH if thoroughly else 1)):
            better = self._best(line, self.changes_of_visits(line) if of_visits else self.changes(line))
            if better is not None:
                line = self.sampler.line(line.changed(better))
            elif of_visits or not thoroughly or self.sampler.over():
                break
            of_visits = better is None
        return line

    def _best(self, line: Line, changes: Iterator[Change]) -> Change | None:
        """Return the change that wins most for sure, of those that win in the fewest futures."""
        few = self.sampler.scanned
        base = line.futures.utility[:few]
        ideas: list[tuple[float, int, Change]] = []
        for k, change in enumerate(changes):
            if self.sampler.over():
                return None
            gain = float((self.sampler.utility(line, change, few) - base).mean())
            if gain > 0.0:
                ideas.append((-gain, k, change))
        return self.sampler.best_sure(line, [change for _, _, change in sorted(ideas)[:SHORTLIST]])

    def changes(self, line: Line) -> Iterator[Change]:
        """Yield conditions fitted anew, and observations taken out and put in."""
        for path, option in options_of(line.plan):
            refitted = self._refitted(line, path, option)
            if refitted is not None:
                yield refitted
        for owner, steps in lists_of(line.plan):
            for k, step in enumerate(steps):
                if isinstance(step, Observe):
                    yield Change((*owner, k - _alone(steps, k)), steps[k + 1 :])
            yield from self._insertions(line.plan, owner, steps)

    def changes_of_visits(self, line: Line) -> Iterator[Change]:
        """Yield visits given up for others, moved and turned round."""
        for owner, steps in lists_of(line.plan):
            yield from self._exchanges(line.plan, owner, steps)
            for k, rest in reordered(steps):
                if self._drivable(line.plan, (*owner, k), rest):
                    yield Change((*owner, k), rest)

    def _refitted(self, line: Line, path: Path, option: Option) -> Change | None:
        row = line.program.option_test[path]
        there, arrivals = line.arrivals(row, self.sampler.fitted)
        if not there.any():
            return None
        branch = path[:-1]
        going_on = steps_at(neutral_option(line.plan, path), branch)
        gains = self.sampler.utility_at(line, row, option.plan, self.sampler.fitted)
        gains -= self.sampler.utility_at(line, row, going_on, self.sampler.fitted)
        rest = steps_at(line.plan, (*path[:-2], path[-2] + 1))
        tests = self.sampler.tests(option.plan, rest)
        choice = fitted_condition(self.model, arrivals, gains[there], tests)
        if not choice.when or choice.when == option.when:
            return None
        plan = replace_option(line.plan, path, replace(option, when=choice.when))
        return Change(branch, steps_at(plan, branch))

    def _insertions(self, plan: Plan, owner: Path, steps: Plan) -> Iterator[Change]:
        model = self.model
        started = {model.place_of[s.target] for s in plan if isinstance(s, TrackStart)}
        for k in range(len(steps) + 1):
            if k < len(steps) and not isinstance(steps[k], Navigate):
                continue
            made, place = self.sampler.before(plan, (*owner, k))
            later = frozenset(self.sampler.observations(steps[k:]))
            ahead = next((model.place_of[s.to] for s in steps[k:] if isinstance(s, Navigate)), None)
            for m, legs in self._near(place, ahead, made | later):
                yield from self._with_visit(plan, (*owner, k), m, legs, steps[k:], started)

    def _exchanges(self, plan: Plan, owner: Path, steps: Plan) -> Iterator[Change]:
        """Yield each visit given up for one to another target."""
        model = self.model
        started = {model.place_of[s.target] for s in plan if isinstance(s, TrackStart)}
        for first, end in _visits(steps):
            made, place = self.sampler.before(plan, (*owner, first))
            rest = steps[end:]
            ahead = next((model.place_of[s.to] for s in rest if isinstance(s, Navigate)), None)
            known = made | frozenset(self.sampler.observations(steps[first:]))
            for m, legs in self._near(place, ahead, known):
                if legs:
                    yield from self._with_visit(plan, (*owner, first), m, legs, rest, started)

    def _with_visit(
        self, plan: Plan, path: Path, m: int, legs: bool, rest: Plan, started: set[int]
    ) -> Iterator[Change]:
        """Yield the plan with an observation at a path and then the rest, if it is admitted; `legs` says
        whether the rover has to drive there, `started` are the places whose tracks the plan starts.
        """
        model = self.model
        target = int(model.obs_place[m])
        tid = model.target_ids[target - 1]
        added: tuple[Step, ...] = (Observe(model.observation_ids[m], tid, OnFail.SKIP),)
        if legs:
            added = (Navigate(tid, bool(model.is_place[m]), OnFail.SKIP), *added)
        change = Change(path, (*added, *rest))
        longer = with_tail(plan, change.path, change.rest)
        if model.is_place[m] and target not in started:
            longer = (TrackStart(tid), *longer)
            change = Change((0,), longer)
        if model.admits_plan(longer):
            yield change

    def _drivable(self, plan: Plan, path: Path, rest: Plan) -> bool:
        """Return whether a leg leads to each stop of a list's rest from the one before."""
        place = self.sampler.before(plan, path)[1]
        stops = [place, *(self.model.place_of[step.to] for step in rest if isinstance(step, Navigate))]
        return all(a != b and self.model.has_leg[a, b] for a, b in pairwise(stops))

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


def _visits(steps: Plan) -> list[tuple[int, int]]:
    """Return where the visits of a list begin and end: a drive and what is observed right after it."""
    found = []
    for k, step in enumerate(steps):
        end = k + 1
        while isinstance(step, Navigate) and end < len(steps) and isinstance(steps[end], Observe):
            end += 1
        if end > k + 1:
            found.append((k, end))
    return found


def reordered(steps: Plan) -> Iterator[tuple[int, Plan]]:
    """Yield a list with one visit made earlier or later, or with visits in a row turned round: from where it
    differs, and the rest.

    What branches off before a visit does not move with it.
    """
    visits = _visits(steps)
    for i, (first, end) in enumerate(visits):
        for to, _ in visits[:i]:
            yield to, (*steps[first:end], *steps[to:first], *steps[end:])
        for _, to in visits[i + 2 :]:  # a visit past the next one is the next one made earlier
            yield first, (*steps[end:to], *steps[first:end], *steps[to:])
        for j in range(i + 2, len(visits)):
            turned: list[Step] = list(steps[first : visits[j][1]])
            if any(isinstance(step, Branch) for step in turned):
                break
            inner = [steps[a:b] for a, b in reversed(visits[i : j + 1])]
            if sum(map(len, inner)) == len(turned):
                yield first, (*(step for visit in inner for step in visit), *steps[visits[j][1] :])


def _alone(steps: Plan, k: int) -> bool:
    """Return whether the drive before observation k is made for it alone."""
    before = steps[k - 1] if k else None
    after = steps[k + 1] if k + 1 < len(steps) else None
    return isinstance(before, Navigate) and not isinstance(after, Observe | Branch)
