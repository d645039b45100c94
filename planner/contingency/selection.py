"""Which observations of a problem a part of it holds: never one without what must be done before it."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable

from planner.constraints.registry import columns_of
from planner.problem import START, ObservationId, Problem, TargetId


class Selection:
    """Observations selected from a problem, at most so many of them and on at most so many targets.

    Each comes with all that must be done before it, or not at all.
    """

    def __init__(self, problem: Problem, *, most: int, most_targets: int) -> None:
        self.problem, self.most, self.most_targets = problem, most, most_targets
        self.names: set[ObservationId] = set()
        self._before = predecessors_of(problem)
        self._target_of = {o.id: o.target for o in problem.observations}

    @property
    def full(self) -> bool:
        return len(self.names) >= self.most

    def demand(self, names: Iterable[ObservationId]) -> None:
        """Take observations whatever their number."""
        for name in names:
            self.names |= {name, *self._before[name]}

    def offer(self, names: Iterable[ObservationId]) -> None:
        """Take, one after the other, those observations that there is room for."""
        for name in names:
            more = self.names | {name, *self._before[name]}
            if len(more) <= self.most and len({self._target_of[x] for x in more}) <= self.most_targets:
                self.names = more


def predecessors_of(problem: Problem) -> dict[ObservationId, frozenset[ObservationId]]:
    """Return for each observation all that must be made before it, directly or not."""
    names = [o.id for o in problem.observations]
    direct: dict[ObservationId, set[ObservationId]] = {name: set() for name in names}
    for first, second in problem.precedence:
        direct[second].add(first)
    _, columns = columns_of(problem)
    for name, bits in zip(names, columns.predecessors.tolist(), strict=True):
        direct[name] |= {names[k] for k in range(bits.bit_length()) if (bits >> k) & 1}
    found = {}
    for name in names:
        before: set[ObservationId] = set()
        queue = list(direct[name])
        while queue:
            other = queue.pop()
            if other not in before:
                before.add(other)
                queue += direct[other]
        found[name] = frozenset(before)
    return found


def makeable(problem: Problem, names: set[ObservationId]) -> set[ObservationId]:
    """Return those of some observations that nothing outside of them must be made before."""
    before = predecessors_of(problem)
    return {name for name in names if before[name] <= names}


def nearest_by_worth(problem: Problem) -> list[ObservationId]:
    """Return the observations worth something, those first that earn most for the mean time from the start.

    That is the time of the quickest drives there and of the observation itself.
    """
    drive_s = _quickest_s(problem)
    wanted = [
        (o.utility * o.p_success / (drive_s[o.target] + o.time_s.mean + 1.0), o.id)
        for o in problem.observations
        if o.utility * o.p_success > 0.0 and o.target in drive_s
    ]
    return [name for _, name in sorted(wanted, key=lambda pair: (-pair[0], pair[1]))]


def places_through(problem: Problem, kept: set[TargetId]) -> set[TargetId]:
    """Return the places on the quickest ways from the start and between places, where no drive leads."""
    direct = {(leg.origin, str(leg.to)) for leg in problem.legs}
    through: set[TargetId] = set()
    for origin in (START, *sorted(kept)):
        missing = [to for to in kept if to != origin and (origin, to) not in direct]
        before = _quickest(problem, origin)[1] if missing else {}
        for to in missing:
            place = before.get(to, origin)
            while place != origin:
                through.add(TargetId(place))
                place = before[place]
    return through - kept


def _quickest_s(problem: Problem) -> dict[str, float]:
    return _quickest(problem, START)[0]


def _quickest(problem: Problem, origin: str) -> tuple[dict[str, float], dict[str, str]]:
    """Return the mean time of the quickest drives to each place, and the place before it (Dijkstra)."""
    ways: dict[str, list[tuple[str, float]]] = {}
    for leg in problem.legs:
        ways.setdefault(leg.origin, []).append((leg.to, leg.time_s.mean))
    found: dict[str, float] = {}
    before: dict[str, str] = {}
    queue: list[tuple[float, str, str]] = [(0.0, origin, origin)]
    while queue:
        seconds, place, last = heapq.heappop(queue)
        if seconds >= found.get(place, math.inf):
            continue
        found[place], before[place] = seconds, last
        for to, more in ways.get(place, ()):
            heapq.heappush(queue, (seconds + more, to, place))
    return found, before
