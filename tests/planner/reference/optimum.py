"""What the best policy earns where all amounts are constant: every choice in every state is tried.

Drives may lose tracks and fail, so a policy is not a sequence; it may go anywhere a leg leads to, as often as
it likes, and come back. Tracks begin before the first drive. Nothing here is shared with the planner but the
problem's values.
"""

from __future__ import annotations

from functools import cache
from itertools import product

from planner.problem import START, Leg, Observation, Problem

Names = frozenset[str]


def optimum(problem: Problem) -> float:
    """Return the expected utility of the best policy of a problem whose amounts all have sd 0."""
    every = _EveryChoice(problem)
    trackable = [t.id for t in problem.targets if any(o.needs_track for o in t.observations)]
    best = 0.0
    for choice in product((False, True), repeat=len(trackable)):
        chosen = frozenset(t for t, yes in zip(trackable, choice, strict=True) if yes)
        time_s, drawn_j = (
            len(chosen) * problem.track_start_time_s,
            len(chosen) * problem.track_start_energy_j,
        )
        if not every.over(time_s, drawn_j):
            best = max(best, every.value(START, frozenset(), chosen, frozenset(), time_s, drawn_j))
    return best


class _EveryChoice:
    """The value of a state: place, what is done, what is tracked, where no drive leads any more as one
    failed, time and energy drawn.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.observations = {o.id: o for o in problem.observations}
        self.legs: dict[str, list[Leg]] = {}
        for leg in problem.legs:
            self.legs.setdefault(leg.origin, []).append(leg)
        self.fading = {t.id: t.diminishing for t in problem.targets}
        self.before: dict[str, set[str]] = {}
        for first, second in problem.precedence:
            self.before.setdefault(second, set()).add(first)
        self.value = cache(self._value)

    def over(self, time_s: float, drawn_j: float) -> bool:
        budget = self.problem.budget
        return time_s > budget.time_s or drawn_j + self.problem.hotel_w * time_s > budget.usable_energy_j

    def _value(
        self, place: str, done: Names, tracked: Names, closed: Names, time_s: float, drawn_j: float
    ) -> float:
        best = 0.0
        if tracked:  # to stop a track is free
            best = max(self.value(place, done, tracked - {t}, closed, time_s, drawn_j) for t in tracked)
        for o in self.observations.values():
            if o.id not in done and o.target == place:
                best = max(best, self.observed(o, done, tracked, closed, time_s, drawn_j))
        for leg in self.legs.get(place, ()):
            if leg.to not in closed:
                best = max(best, self.driven(leg, done, tracked, closed, time_s, drawn_j))
        return best

    def observed(
        self, o: Observation, done: Names, tracked: Names, closed: Names, time_s: float, drawn_j: float
    ) -> float:
        opens, closes = o.window_s or (0.0, float("inf"))
        if time_s > closes or not self.before.get(o.id, set()) <= done:
            return 0.0
        if o.needs_track and o.target not in tracked:
            return 0.0
        ends, used = max(time_s, opens) + o.time_s.mean, drawn_j + o.energy_j.mean
        if self.over(ends, used):
            return -self.problem.overrun_penalty
        earlier = sum(self.observations[d].target == o.target for d in done)
        after = done | {o.id}
        if o.needs_track:
            tracked = self.tracked_after(tracked, after, o.target)
        worth = o.utility * o.p_success * self.fading[o.target] ** earlier
        return worth + self.value(o.target, after, tracked, closed, ends, used)

    def tracked_after(self, tracked: Names, done: Names, target: str) -> Names:
        """A track ends with the last observation that needs it."""
        every = self.observations.values()
        left = any(o.target == target and o.needs_track and o.id not in done for o in every)
        return tracked if left else tracked - {target}

    def driven(
        self, leg: Leg, done: Names, tracked: Names, closed: Names, time_s: float, drawn_j: float
    ) -> float:
        ends = time_s + leg.time_s.mean + len(tracked) * self.problem.track_overhead_s_per_leg
        used = drawn_j + leg.energy_j.mean
        if self.over(ends, used):
            return -self.problem.overrun_penalty
        names = sorted(tracked)
        total = 0.0
        for lost in product((False, True), repeat=len(names)):
            chance = 1.0
            for name, gone in zip(names, lost, strict=True):
                p = leg.p_lose.get(name, 0.0)  # type: ignore[call-overload]
                chance *= p if gone else 1.0 - p
            if chance > 0.0:
                kept = frozenset(n for n, gone in zip(names, lost, strict=True) if not gone)
                if leg.p_fail < 1.0:
                    total += (1.0 - leg.p_fail) * chance * self.value(leg.to, done, kept, closed, ends, used)
                if leg.p_fail > 0.0:
                    back = self.value(leg.origin, done, kept, closed | {leg.to}, ends, used)
                    total += leg.p_fail * chance * back
        return total
