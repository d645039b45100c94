"""Plans polished on common futures: observations put in and taken out, conditions fitted anew."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from planner.contingency.sampled_conditions import fitted_condition
from planner.contingency.sampled_futures import FITTED, SCANNED, Change, Line, Sampler
from planner.plan_edits import lists_of, neutral_option, options_of, replace_option, steps_at, with_tail
from planner.plan_tree import Branch, Navigate, Observe, OnFail, Option, Path, Plan, Step, TrackStart

SWEEPS = 5
"""Passes over a plan; most end earlier, when one wins nothing. By hand."""

SHORTLIST = 10
"""Changes that are tried on many futures in each sweep."""

NEAREST = 6
"""Targets that are tried for a place in a list: those with the most worth for their detour."""


class Polisher:
    """Puts observations into a plan and takes them out, judged on common futures."""

    def __init__(self, sampler: Sampler) -> None:
        self.sampler, self.model = sampler, sampler.model

    def polished(self, line: Line) -> Line:
        """Return the plan after the changes that win for sure, the best of each sweep at a time."""
        for _ in range(SWEEPS):
            base = line.futures.utility[:SCANNED]
            ideas: list[tuple[float, int, Change]] = []
            for k, change in enumerate(self.changes(line)):
                if self.sampler.over():
                    return line
                gain = float((self.sampler.utility(line, change, SCANNED) - base).mean())
                if gain > 0.0:
                    ideas.append((-gain, k, change))
            better = self.sampler.best_sure(line, [change for _, _, change in sorted(ideas)[:SHORTLIST]])
            if better is None:
                break
            line = self.sampler.line(line.changed(better))
        return line

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

    def _refitted(self, line: Line, path: Path, option: Option) -> Change | None:
        row = line.program.option_test[path]
        there, arrivals = line.arrivals(row, FITTED)
        if not there.any():
            return None
        branch = path[:-1]
        going_on = steps_at(neutral_option(line.plan, path), branch)
        gains = self.sampler.utility_at(line, row, option.plan, FITTED)
        gains -= self.sampler.utility_at(line, row, going_on, FITTED)
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
                target = int(model.obs_place[m])
                tid = model.target_ids[target - 1]
                added: tuple[Step, ...] = (Observe(model.observation_ids[m], tid, OnFail.SKIP),)
                if legs:
                    added = (Navigate(tid, bool(model.is_place[m]), OnFail.SKIP), *added)
                change = Change((*owner, k), (*added, *steps[k:]))
                longer = with_tail(plan, change.path, change.rest)
                if model.is_place[m] and target not in started:
                    longer = (TrackStart(tid), *longer)
                    change = Change((0,), longer)
                if model.admits_plan(longer):
                    yield change

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


def _alone(steps: Plan, k: int) -> bool:
    """Return whether the drive before observation k is made for it alone."""
    before = steps[k - 1] if k else None
    after = steps[k + 1] if k + 1 < len(steps) else None
    return isinstance(before, Navigate) and not isinstance(after, Observe | Branch)
