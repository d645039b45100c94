"""Dynamic controllability: W033, for when the rover decides how long a task takes within its `:duration`.

The network of a tree's mainline becomes a simple temporal network with uncertainty: a task with a `:duration`
of two different finite bounds is a contingent link. The check is the one of Morris (2014): from every point
with an incoming negative edge, distances are propagated backward along non-negative edges until they become
positive themselves and are then added as edges; a search that needs its own outcome shows that no strategy
exists.
"""

from __future__ import annotations

import heapq
from collections.abc import Generator, Iterable
from dataclasses import dataclass

from executive.crl.checks.index import Index, label
from executive.crl.checks.network import PlanNetwork, Why
from executive.crl.nodes import Node, Task

MAX_STEPS = 100_000
"""How many edges are looked at for one tree before W033 is left undecided."""

ORDINARY, LOWER, UPPER = 0, 1, 2
Edge = tuple[int, int, int, int]
"""Other end, weight, kind, contingent end point (-1 for an ordinary edge)."""


@dataclass(frozen=True, slots=True)
class Contingent:
    """A duration that is not ours to choose: `lo <= t[end] - t[start] <= hi`."""

    start: int
    end: int
    lo: int
    hi: int


class _UndecidedError(Exception):
    """The effort is spent."""


class _Network:
    def __init__(
        self,
        points: int,
        constraints: Iterable[tuple[int, int, int | None, int | None]],
        contingent: Iterable[Contingent],
        steps: int,
    ) -> None:
        self.enter: list[list[Edge]] = [[] for _ in range(points)]
        self.steps = steps
        for source, target, lo, hi in constraints:
            if hi is not None:
                self.enter[target].append((source, hi, ORDINARY, -1))
            if lo is not None:
                self.enter[source].append((target, -lo, ORDINARY, -1))
        for link in contingent:
            self.enter[link.end].append((link.start, link.hi, ORDINARY, -1))
            self.enter[link.start].append((link.end, -link.lo, ORDINARY, -1))
            self.enter[link.end].append((link.start, link.lo, LOWER, link.end))
            self.enter[link.start].append((link.end, -link.hi, UPPER, link.end))
        self.negative = [any(w < 0 for _, w, _, _ in edges) for edges in self.enter]
        self.done: set[int] = set()

    def controllable(self) -> bool:
        for point, negative in enumerate(self.negative):
            if negative and point not in self.done and not self._run(point):
                return False
        return True

    def _run(self, first: int) -> bool:
        """Carry out the search from a point and those it needs first; a stack instead of recursion."""
        active = {first}
        stack: list[tuple[int, Generator[int, None, bool]]] = [(first, self._search(first))]
        while stack:
            point, search = stack[-1]
            try:
                needed = next(search)
            except StopIteration as finished:
                if not finished.value:
                    return False
                self.done.add(point)
                active.discard(point)
                stack.pop()
                continue
            if needed in self.done:
                continue
            if needed in active:
                return False
            active.add(needed)
            stack.append((needed, self._search(needed)))
        return True

    def _negative_groups(self, source: int) -> dict[int, list[tuple[int, int]]]:
        """Return the negative edges into a point, by the contingent duration that they bound from above."""
        groups: dict[int, list[tuple[int, int]]] = {}
        for u, w, kind, end in self.enter[source]:
            if w < 0:
                groups.setdefault(end if kind == UPPER else -1, []).append((w, u))
        return groups

    def _search(self, source: int) -> Generator[int, None, bool]:
        for owner, begins in self._negative_groups(source).items():
            distance: dict[int, int] = {}
            heap: list[tuple[int, int]] = []
            for w, u in begins:
                if w < distance.get(u, 0):
                    distance[u] = w
                    heapq.heappush(heap, (w, u))
            settled: set[int] = set()
            while heap:
                d, u = heapq.heappop(heap)
                if u in settled:
                    continue
                settled.add(u)
                if d >= 0:
                    self.enter[source].append((u, d, ORDINARY, -1))
                    continue
                if self.negative[u]:
                    yield u
                for v, w, kind, end in self.enter[u]:
                    self.steps -= 1
                    if self.steps < 0:
                        raise _UndecidedError
                    if w < 0 or (kind == LOWER and end == owner):
                        continue
                    new = d + w
                    if v == source:
                        if new < 0:
                            return False
                        continue
                    if v not in settled and new < distance.get(v, new + 1):
                        distance[v] = new
                        heapq.heappush(heap, (new, v))
        return True


def dynamically_controllable(
    points: int,
    constraints: Iterable[tuple[int, int, int | None, int | None]],
    contingent: Iterable[Contingent],
    steps: int = MAX_STEPS,
) -> bool | None:
    """Tell whether a strategy exists that satisfies all constraints whatever the contingent durations are.

    `constraints` are (source, target, lo, hi) with None for infinite; the network must be consistent. None
    means that it was not decided within `steps` edges.
    """
    try:
        return _Network(points, constraints, contingent, steps).controllable()
    except _UndecidedError:
        return None


def contingent_tasks(index: Index, tree: int) -> bool:
    """Tell whether a tree has a contingent duration, and an upper bound that it could break."""
    tasks = bounds = False
    root = index.roots[tree]
    for number in range(root, index.entries[root].end):
        node = index.entries[number].node
        if _is_contingent(node):
            tasks = True
        elif node.duration is not None and node.duration.hi_ms is not None:
            bounds = True
        for temporal in (*node.start_temporal_conditions, *node.end_temporal_conditions):
            if temporal.interval.hi_ms is not None:
                bounds = True
    return tasks and bounds


def _is_contingent(node: Node) -> bool:
    duration = node.duration
    if not isinstance(node, Task) or duration is None or duration.hi_ms is None:
        return False
    return 0 <= (duration.lo_ms or 0) < duration.hi_ms


def check_controllability(index: Index, tree: int, network: PlanNetwork) -> None:
    """Report W033 for the mainline of a tree; `network` holds it and is consistent."""
    if not contingent_tasks(index, tree):
        return
    rows: list[tuple[int, int, int | None, int | None]] = []
    links: list[Contingent] = []
    names: list[str] = []
    for constraint in network.network.constraints():
        why = constraint.label
        node = why.node if isinstance(why, Why) else None
        if (
            isinstance(why, Why)
            and node is not None
            and why.temporal is not None
            and why.side == "end"
            and _is_contingent(node)
            and why.temporal.interval == node.duration
            and why.temporal not in node.end_temporal_conditions
        ):
            lo, hi = constraint.lo_ms or 0, constraint.hi_ms
            assert hi is not None
            links.append(Contingent(constraint.source, constraint.target, lo, hi))
            names.append(node.id)
        else:
            rows.append((constraint.source, constraint.target, constraint.lo_ms, constraint.hi_ms))
    points = len(network.network)
    answer = dynamically_controllable(points, rows, links)
    if answer is True:
        return
    root = index.entries[index.roots[tree]].node
    holder = index.holder(tree)
    what = "the plan" if holder is None else label(holder)
    if answer is None:
        message = f"not decided whether {what} can be executed for all durations ({MAX_STEPS} steps)"
        index.add("W033", root, message)
        return
    shown = ", ".join(names[:5]) + (", ..." if len(names) > 5 else "")
    message = f"{what} cannot be executed for all durations that the rover may take for {shown}"
    hint = "not dynamically controllable; widen the windows that follow, or narrow the durations"
    index.add("W033", root, message, hint=hint)
