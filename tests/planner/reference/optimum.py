"""What the best policy earns where all amounts are constant: every choice in every state is tried.

Drives may lose tracks and fail, so a policy is not a sequence; it may go anywhere a leg leads to, as often as
it likes, and come back. Tracks begin before the first drive. Where the kind of sol is hidden, a policy
remembers its history: it knows the kinds that would have come to the same time and energy used by now, and
must do the same on all of them. Nothing here is shared with the planner but the problem's values.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from itertools import product
from typing import NamedTuple

from planner.problem import START, Leg, Observation, Problem

Names = frozenset[str]


class Kind(NamedTuple):
    """Chance of a kind of sol and its factors."""

    p: float
    drive_time: float
    drive_energy: float
    energy: float


class Sol(NamedTuple):
    """One kind of sol that may still be: its number, and time and energy drawn on it by now."""

    kind: int
    time_s: float
    drawn_j: float


Sols = tuple[Sol, ...]
"""Those that the policy cannot tell apart."""


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
        begun = [Sol(k, time_s, drawn_j * kind.energy) for k, kind in enumerate(every.kinds)]
        lost, groups = every.told_apart(begun)
        value = sum(every.value(START, frozenset(), chosen, frozenset(), group) for group in groups)
        best = max(best, value - lost)
    return best


class _EveryChoice:
    """The value of a state: place, what is done, what is tracked, where no drive leads any more as one
    failed, and the sols that may be. It is weighted with their chances.
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
        self.kinds = [
            Kind(s.p, s.drive_time_factor, s.drive_energy_factor, s.energy_factor) for s in problem.sol_kinds
        ]
        rest = 1.0 - sum(kind.p for kind in self.kinds)
        if rest > 1e-9:
            self.kinds.append(Kind(rest, 1.0, 1.0, 1.0))
        self.value = cache(self._value)

    def used(self, sol: Sol) -> float:
        """Return what the rover has used: the hotel load is on all the time."""
        return sol.drawn_j + self.problem.hotel_w * self.kinds[sol.kind].energy * sol.time_s

    def told_apart(self, sols: Iterable[Sol]) -> tuple[float, list[Sols]]:
        """Return the penalties of sols that end over a budget, and the others in groups that are alike."""
        budget = self.problem.budget
        lost, groups = 0.0, dict[tuple[float, float], Sols]()
        for sol in sols:
            used = self.used(sol)
            if sol.time_s > budget.time_s or used > budget.usable_energy_j:
                lost += self.kinds[sol.kind].p * self.problem.overrun_penalty
            else:
                seen = round(sol.time_s, 6), round(used, 6)
                groups[seen] = (*groups.get(seen, ()), sol)
        return lost, list(groups.values())

    def _value(self, place: str, done: Names, tracked: Names, closed: Names, sols: Sols) -> float:
        best = 0.0
        if tracked:  # to stop a track is free
            best = max(self.value(place, done, tracked - {t}, closed, sols) for t in tracked)
        for o in self.observations.values():
            if o.id not in done and o.target == place:
                best = max(best, self.observed(o, done, tracked, closed, sols))
        for leg in self.legs.get(place, ()):
            if leg.to not in closed:
                best = max(best, self.driven(leg, done, tracked, closed, sols))
        return best

    def observed(self, o: Observation, done: Names, tracked: Names, closed: Names, sols: Sols) -> float:
        opens, closes = o.window_s or (0.0, float("inf"))
        if sols[0].time_s > closes or not self.before.get(o.id, set()) <= done:
            return 0.0
        if o.needs_track and o.target not in tracked:
            return 0.0
        lost, groups = self.told_apart(
            Sol(
                sol.kind,
                max(sol.time_s, opens) + o.time_s.mean,
                sol.drawn_j + o.energy_j.mean * self.kinds[sol.kind].energy,
            )
            for sol in sols
        )
        earlier = sum(self.observations[d].target == o.target for d in done)
        after = done | {o.id}
        if o.needs_track:
            tracked = self.tracked_after(tracked, after, o.target)
        worth = o.utility * o.p_success * self.fading[o.target] ** earlier
        made = sum(
            worth * sum(self.kinds[sol.kind].p for sol in group)
            + self.value(o.target, after, tracked, closed, group)
            for group in groups
        )
        return made - lost

    def tracked_after(self, tracked: Names, done: Names, target: str) -> Names:
        """A track ends with the last observation that needs it."""
        every = self.observations.values()
        left = any(o.target == target and o.needs_track and o.id not in done for o in every)
        return tracked if left else tracked - {target}

    def driven(self, leg: Leg, done: Names, tracked: Names, closed: Names, sols: Sols) -> float:
        overhead = len(tracked) * self.problem.track_overhead_s_per_leg
        penalties, groups = self.told_apart(
            Sol(
                sol.kind,
                sol.time_s + leg.time_s.mean * self.kinds[sol.kind].drive_time + overhead,
                sol.drawn_j
                + leg.energy_j.mean * self.kinds[sol.kind].drive_energy * self.kinds[sol.kind].energy,
            )
            for sol in sols
        )
        names = sorted(tracked)
        total = -penalties
        for group in groups:
            for lost in product((False, True), repeat=len(names)):
                chance = 1.0
                for name, gone in zip(names, lost, strict=True):
                    p = leg.p_lose.get(name, 0.0)  # type: ignore[call-overload]
                    chance *= p if gone else 1.0 - p
                if chance > 0.0:
                    kept = frozenset(n for n, gone in zip(names, lost, strict=True) if not gone)
                    if leg.p_fail < 1.0:
                        total += (1.0 - leg.p_fail) * chance * self.value(leg.to, done, kept, closed, group)
                    if leg.p_fail > 0.0:
                        back = self.value(leg.origin, done, kept, closed | {leg.to}, group)
                        total += leg.p_fail * chance * back
        return total
