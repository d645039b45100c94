"""Simple temporal network: consistency with the cycle that breaks it, incremental, and dispatch bounds.

A constraint `lo <= t[target] - t[source] <= hi` is kept as *edges* `t[v] >= t[u] + w`: its lower bound from
source to target with w = lo, its upper bound from target to source with w = -hi. A network is consistent
iff no cycle of edges has positive length, and then a schedule exists that satisfies all of them. One such
schedule is kept at all times and repaired locally when a constraint is added, a point is executed or the
clock advances (Dijkstra on the gaps, after Cotton and Maler 2006); a contradiction shows as a repair that
comes back to where it began or to a point that is fixed. Nothing is ever computed for all pairs of points.

Local repairs leave a schedule that is tight where it was repaired, so that the next repair reaches further.
The points visited are counted, and when they are as many as the network has, the schedule is made anew with
slack on both sides: in a chain of n points an execution then costs in the order of sqrt(n), not n.

Times are whole milliseconds. Point 0, `ORIGIN`, is the start of the plan and is executed at 0.
"""

from __future__ import annotations

import heapq
from collections import deque
from dataclasses import dataclass

ORIGIN = 0
HORIZON_MS = 1 << 42
"""Where the kept schedule puts points that have no upper bound: later than anything that happens."""


@dataclass(frozen=True, slots=True)
class Constraint:
    """`lo_ms <= t[target] - t[source] <= hi_ms`; None is infinite. `label` is the caller's."""

    source: int
    target: int
    lo_ms: int | None
    hi_ms: int | None
    label: object = None


@dataclass(frozen=True, slots=True)
class Link:
    """One bound of a constraint as it takes part in a conflict: `t[to] >= t[from_] + weight_ms`.

    `constraint` is None where the link is a fact: the present time, before which nothing more can happen.
    """

    from_: int
    to: int
    weight_ms: int
    constraint: Constraint | None

    @property
    def is_upper_bound(self) -> bool:
        return self.constraint is not None and self.from_ == self.constraint.target


@dataclass(frozen=True, slots=True)
class Conflict:
    """Links that cannot hold together: in sequence they ask a point to be `deficit_ms` later than it is.

    The sequence is a cycle, or leads from one executed point to another (or from the present time).
    """

    links: tuple[Link, ...]
    deficit_ms: int


Edge = tuple[int, int, int]
"""Other end, weight in ms, index of the constraint."""

Step = tuple[int, int, int, int]
"""An edge with both ends: from, to, weight in ms, index of the constraint (-1 if it is a fact)."""


class TemporalNetwork:
    """A simple temporal network with a schedule that is kept consistent, and a clock.

    After a contradiction the network stays inconsistent until the contradiction is gone, by removal, voiding
    or execution; meanwhile the schedule is not kept. `now_ms` is the present: points not executed are not
    before it.
    """

    def __init__(self) -> None:
        self.now_ms = 0
        self._time: list[int] = [0]
        self._fixed: list[bool] = [True]
        self._out: list[list[Edge]] = [[]]
        self._in: list[list[Edge]] = [[]]
        self._constraints: list[Constraint | None] = []
        self._earliest = True  # the kept schedule is the earliest one, so that a raise is always forced
        self._waiting: list[tuple[int, int]] = []  # (time, point) of points not executed, lazily
        self._watch = False
        self._void: set[int] = set()
        self._trail: list[list[tuple[int, int, int]]] = []
        self._suspect: _Suspect | None = None
        self._early: list[int] = []  # the earliest schedule when it was last made, empty if outdated
        self._early_now = 0
        self._visited = 0
        self._late: dict[int, int] | None = (
            None  # latest times, or later where a constraint went; once asked for
        )
        self._closing: list[tuple[int, int]] = []  # (latest time, point) of points not executed, lazily

    @property
    def consistent(self) -> bool:
        return self._suspect is None

    @property
    def conflict(self) -> Conflict | None:
        """The contradiction, None while the network is consistent."""
        return None if self._suspect is None else self._suspect.conflict(self._time, self._constraints)

    # -- building ----------------------------------------------------------------

    def __len__(self) -> int:
        return len(self._time)

    def add_point(self) -> int:
        """Return a new point; it is not before the start of the plan only if a constraint says so."""
        point = len(self._time)
        self._early = []
        self._time.append(self.now_ms)
        self._fixed.append(False)
        self._out.append([])
        self._in.append([])
        if self._watch:
            heapq.heappush(self._waiting, (self.now_ms, point))
        return point

    def declare(
        self, source: int, target: int, lo_ms: int | None, hi_ms: int | None, label: object = None
    ) -> int:
        """Add a constraint without looking at it; `check` must follow. Return its index."""
        index = len(self._constraints)
        self._early = []
        self._late = None
        if self._void and (source in self._void or target in self._void):
            self._constraints.append(None)
            return index
        self._constraints.append(Constraint(source, target, lo_ms, hi_ms, label))
        if lo_ms is not None:
            self._out[source].append((target, lo_ms, index))
            self._in[target].append((source, lo_ms, index))
        if hi_ms is not None:
            self._out[target].append((source, -hi_ms, index))
            self._in[source].append((target, -hi_ms, index))
        if self._trail:
            self._trail[-1].append((-1, index, 0))
        return index

    def add(
        self, source: int, target: int, lo_ms: int | None, hi_ms: int | None, label: object = None
    ) -> int:
        """Add a constraint and repair the schedule. Return its index; see `conflict` for the outcome."""
        index = self.declare(source, target, lo_ms, hi_ms, label)
        if self._suspect is None and self._constraints[index] is not None:
            time, fixed = self._time, self._fixed
            if fixed[source] and fixed[target]:
                return index
            if lo_ms is not None and time[target] < time[source] + lo_ms:
                self._mend(source, target, lo_ms, index)
            if hi_ms is not None and self.consistent and time[source] < time[target] - hi_ms:
                self._mend(target, source, -hi_ms, index)
        return index

    def constraints(self) -> list[Constraint]:
        """Return the constraints in force."""
        return [c for c in self._constraints if c is not None]

    def remove(self, index: int) -> None:
        """Take a constraint back."""
        constraint = self._constraints[index]
        if constraint is None:
            return
        self._constraints[index] = None
        for point in {constraint.source, constraint.target}:
            self._out[point] = [e for e in self._out[point] if e[2] != index]
            self._in[point] = [e for e in self._in[point] if e[2] != index]
        self._earliest = False
        if self._suspect is not None and self._suspect.loses(index):
            self._decide_again()

    def void(self, point: int) -> None:
        """Drop every constraint of a point that will never occur, also those added later."""
        self._void.add(point)
        for index in {e[2] for e in self._out[point]} | {e[2] for e in self._in[point]}:
            self.remove(index)
        self._fixed[point] = True

    def push(self) -> None:
        """Begin a trial: what is added from here on is taken back by `pop`."""
        self._trail.append([])

    def pop(self) -> None:
        """End the latest trial. A conflict that it brought about is gone with it."""
        points = len(self._time)
        for kind, a, b in reversed(self._trail.pop()):
            if kind >= 0:
                self._time[kind] = a
            elif kind == -1:
                constraint = self._constraints.pop()
                if constraint is None:
                    continue
                if constraint.hi_ms is not None:
                    self._out[constraint.target].pop()
                    self._in[constraint.source].pop()
                if constraint.lo_ms is not None:
                    self._out[constraint.source].pop()
                    self._in[constraint.target].pop()
            else:
                points = b
        del self._time[points:], self._fixed[points:], self._out[points:], self._in[points:]
        self._suspect = None
        # what was worked out within the trial may name its points, and times that only it made
        self._late, self._early, self._closing, self._watch = None, [], [], False

    def mark_points(self) -> None:
        """Within a trial: `pop` also drops the points that are added from here on."""
        self._trail[-1].append((-2, 0, len(self._time)))

    # -- the whole network -------------------------------------------------------

    def check(self) -> Conflict | None:
        """Decide consistency from scratch and keep the earliest schedule; return the conflict, if any.

        Label correcting in the order in which the points were added, which for a plan is the order of time.
        """
        fixed, out = self._fixed, self._out
        count = len(self._time)
        now = self.now_ms
        old = self._time
        time = [old[p] if fixed[p] else now for p in range(count)]
        parent: list[Edge | None] = [None] * count
        queue = deque(range(count))
        queued = bytearray(b"\x01") * count
        changes = 0
        limit = count
        self._suspect = None
        while queue:
            u = queue.popleft()
            queued[u] = 0
            start = time[u]
            is_fixed = fixed[u]
            for v, w, index in out[u]:
                if start + w > time[v]:
                    if fixed[v]:
                        if is_fixed:
                            continue
                        self._suspect = _Suspect(self._path(parent, u, (u, v, w, index)), self._fixed)
                        return self.conflict
                    parent[v] = (u, w, index)
                    time[v] = start + w
                    changes += 1
                    if not queued[v]:
                        queued[v] = 1
                        queue.append(v)
            if changes >= limit:
                limit = changes + count
                cycle = _find_cycle(parent)
                if cycle is not None:
                    self._suspect = _Suspect(cycle, self._fixed)
                    return self.conflict
        self._assign_all(time)
        self._earliest = True
        return None

    def relax(self) -> None:
        """Give the kept schedule slack on both sides, so that running the plan seldom needs repairs.

        It lies half way between the earliest and the latest schedule (what has no upper bound is late by
        `HORIZON_MS`). To be called after `check`, when execution begins.
        """
        if self._suspect is not None:
            return
        count = len(self._time)
        fixed, enter = self._fixed, self._in
        early = self._time
        self._early = early
        self._early_now = self.now_ms
        self._visited = 0
        late = [early[p] if fixed[p] else early[p] + HORIZON_MS for p in range(count)]
        queue = deque(range(count - 1, -1, -1))
        queued = bytearray(b"\x01") * count
        while queue:
            v = queue.popleft()
            queued[v] = 0
            end = late[v]
            for u, w, _ in enter[v]:
                if end - w < late[u] and not fixed[u]:
                    late[u] = end - w
                    if not queued[u]:
                        queued[u] = 1
                        queue.append(u)
        self._time = [(a + b) // 2 for a, b in zip(early, late, strict=True)]
        self._earliest = False
        self._restart_watch()

    def schedule(self) -> tuple[int, ...]:
        """Return the kept schedule, milliseconds: after `check`, the earliest time of each point."""
        return tuple(self._time)

    # -- execution ---------------------------------------------------------------

    def is_fixed(self, point: int) -> bool:
        return self._fixed[point]

    def execute(self, point: int, t_ms: int) -> None:
        """Fix a point at the time at which it has occurred."""
        fixed, time = self._fixed, self._time
        planned = time[point]
        if self._suspect is not None:
            self._late = None
            time[point] = t_ms
            fixed[point] = True
            if self._suspect.resolved_by(point, t_ms, time):
                self._decide_again()
            return
        fixed[point] = True
        if t_ms > self.now_ms:
            self._early = []  # a clock that jumps: what is earliest is no longer known
        if t_ms > planned:
            self._shift(point, t_ms, 1)
        elif t_ms < planned:
            self._earliest = False
            self._shift(point, t_ms, -1)
        if self._late is not None:
            self._late[point] = t_ms
            self._lower_late(deque((point,)))
        self._make_slack()

    def _make_slack(self) -> None:
        """Make the schedule anew when repairs and searches have visited as many points as there are."""
        if self._visited > len(self._time) and self._watch and not self._trail and self.consistent:
            self._decide_again()

    def advance(self, now_ms: int) -> None:
        """Let the clock advance: no point that is not executed can lie before `now_ms` any more."""
        if now_ms <= self.now_ms:
            return
        self.now_ms = now_ms
        if self._suspect is not None:
            return
        if not self._watch:
            self._restart_watch()
        heap, time, fixed = self._waiting, self._time, self._fixed
        while heap and heap[0][0] < now_ms:
            _, point = heapq.heappop(heap)
            if fixed[point]:
                continue
            forced = time[point] < now_ms
            possible = not forced or self._shift(point, now_ms, 1)
            heapq.heappush(heap, (time[point], point))
            if not possible:
                return

    def dispatch_bound(self, point: int) -> int:
        """Return the lower bound of a point in the minimal network (CRL section 8.3) at the present time.

        Where it exceeds `now_ms` because of a point that has not occurred it moves on with the clock; see
        `dispatch_time`. While the network is inconsistent it is the present time.
        """
        return self._bound(point)[0]

    def dispatch_time(self, point: int) -> int | None:
        """Return the dispatch bound if it is a fixed time, None if it moves on with the clock.

        None means: ask again when a point has been executed or has become void. A time means: ask again then.
        In both cases ask again at `breaks_at`.
        """
        bound, moving = self._bound(point)
        return None if moving else bound

    def breaks_at(self) -> int | None:
        """Return when the network will have become inconsistent if nothing occurs before, None if never.

        It is a millisecond after the latest time of the point that has to occur first. Where a constraint has
        gone since, it may be too early. None, too, while the network is inconsistent.
        """
        if self._suspect is not None:
            return None
        closing, fixed = self._closing, self._fixed
        while self._late is not None and closing and fixed[closing[0][1]]:
            heapq.heappop(closing)
        if self._late is None or (closing and closing[0][0] < self.now_ms):
            enter, time = self._in, self._time
            self._late = {p: time[p] for p in range(len(time)) if fixed[p] and enter[p]}
            self._closing = closing = []
            self._lower_late(deque(self._late))
        return closing[0][0] + 1 if closing else None

    def _lower_late(self, queue: deque[int]) -> None:
        """Work out what the latest times of some points say about those before them."""
        late, fixed, enter = self._late, self._fixed, self._in
        assert late is not None
        while queue:
            v = queue.popleft()
            end = late[v]
            for u, w, _ in enter[v]:
                if not fixed[u] and end - w < late.get(u, end - w + 1):
                    late[u] = end - w
                    heapq.heappush(self._closing, (end - w, u))
                    queue.append(u)

    def _bound(self, point: int) -> tuple[int, bool]:
        """Return the longest path to `point` from executed points and from the present, and which it was.

        Best first over the points from which `point` can be reached. Two schedules tell how much any path
        through a point can still give, so that the search ends as soon as nothing better is in sight: the
        kept one, and the earliest one as it was last made plus the time since then.
        """
        best = self.now_ms
        moving = False
        if self._suspect is not None:
            return best, moving
        enter, fixed, time = self._in, self._fixed, self._time
        now = best
        open_before = False
        for u, w, _ in enter[point]:
            if fixed[u]:
                if time[u] + w > best:
                    best = time[u] + w
            else:
                open_before = True
        if not open_before:
            return best, moving
        early = self._early
        since = now - self._early_now
        heap = [(-time[point], point, 0)]
        seen: set[int] = set()
        while heap:
            negative, v, length = heapq.heappop(heap)
            if -negative <= best:
                break
            if v in seen:
                continue
            seen.add(v)
            for u, w, _ in enter[v]:
                found = length + w
                if fixed[u]:
                    if time[u] + found > best:
                        best = time[u] + found
                        moving = False
                elif u not in seen:
                    if now + found > best:
                        best = now + found
                        moving = True
                    most = found + (time[u] if not early else min(time[u], early[u] + since))
                    if most > best:
                        heapq.heappush(heap, (-most, u, found))
        self._visited += len(seen)
        return best, moving

    # -- repair ------------------------------------------------------------------

    def _mend(self, u: int, v: int, w: int, index: int) -> None:
        """Make the edge u -> v hold: raise v, else lower u, else decide from scratch."""
        fixed = self._fixed
        wanted = self._time[u] + w
        if not fixed[v]:
            failed = self._propagate(v, wanted, 1, u)
            if failed is None:
                return
            links, hit = failed
            if hit == u or self._earliest or fixed[u]:
                before = [] if hit == u or fixed[u] else self._support(u)
                self._suspect = _Suspect([*before, (u, v, w, index), *links], self._fixed)
                return
        if not fixed[u]:
            self._earliest = False
            failed = self._propagate(u, self._time[v] - w, -1, v)
            if failed is None:
                return
            links, hit = failed
            if hit == v or fixed[v]:
                self._suspect = _Suspect([*links, (u, v, w, index)], self._fixed)
                return
        self._decide_again()

    def _decide_again(self) -> None:
        if self.check() is None and self._watch:
            self.relax()

    def _shift(self, point: int, t_ms: int, sign: int) -> bool:
        """Move a point to a time that is a fact, and others as they must; False on a contradiction."""
        failed = self._propagate(point, t_ms, sign, -1)
        if failed is None:
            return True
        links, _ = failed
        if sign > 0 and not self._fixed[point]:
            links = [(-1, point, t_ms, -1), *links]
        if self._fixed[point]:
            self._time[point] = t_ms
        self._suspect = _Suspect(links, self._fixed)
        return False

    def _propagate(self, first: int, value: int, sign: int, forbidden: int) -> tuple[list[Step], int] | None:
        """Raise (sign 1) or lower (-1) a point to a time and repair what that breaks; largest gap first.

        Return None when done. If the repair reaches `forbidden` or an executed point, nothing is changed and
        the edges that lead there from `first` are returned, in the order of time, with the point reached.
        """
        time, fixed = self._time, self._fixed
        edges = self._out if sign > 0 else self._in
        gap = {first: sign * (value - time[first])}
        heap = [(-gap[first], first)]
        parent: dict[int, tuple[int, int, int]] = {}
        moved: dict[int, int] = {}
        lowest = self.now_ms
        while heap:
            negative, u = heapq.heappop(heap)
            if u in moved:
                continue
            moved[u] = new = sign * time[u] - negative  # in mirrored time when lowering
            if sign < 0 and -new < lowest and not fixed[u]:
                return [(-1, u, lowest, -1), *self._trace_back(parent, u)], u
            for v, w, number in edges[u]:
                need = new + w - sign * time[v]
                if need <= 0 or (v in moved and v != first):
                    continue
                if v == forbidden or fixed[v] or (v == first and v in moved):
                    if v == first and new + w <= sign * value:
                        continue
                    if fixed[v] and u == first and fixed[u] and v != first:
                        continue  # both executed: the constraint is dropped
                    return self._trace(parent, u, (u, v, w, number), sign), v
                if need > gap.get(v, 0):
                    gap[v] = need
                    parent[v] = (u, w, number)
                    heapq.heappush(heap, (-need, v))
        self._visited += len(moved)
        trail = self._trail[-1] if self._trail else None
        watch = self._watch and sign < 0
        for point, mirrored in moved.items():
            if trail is not None:
                trail.append((point, time[point], 0))
            time[point] = new = sign * mirrored
            if watch and not fixed[point]:
                heapq.heappush(self._waiting, (new, point))
        return None

    @staticmethod
    def _trace_back(parent: dict[int, tuple[int, int, int]], u: int) -> list[Step]:
        """Return the edges from a lowered point to where the lowering began."""
        path: list[Step] = []
        while u in parent:
            after, w, number = parent[u]
            path.append((u, after, w, number))
            u = after
        return path

    @staticmethod
    def _trace(parent: dict[int, tuple[int, int, int]], u: int, last: Step, sign: int) -> list[Step]:
        path = [last]
        while u in parent:
            before, w, number = parent[u]
            path.append((before, u, w, number))
            u = before
        if sign > 0:
            path.reverse()
            return path
        return [(v, u, w, number) for u, v, w, number in path]

    def _assign_all(self, time: list[int]) -> None:
        if self._trail:
            trail = self._trail[-1]
            trail.extend((p, old, 0) for p, old in enumerate(self._time) if old != time[p])
        self._time = time
        if self._watch:
            self._restart_watch()

    def _restart_watch(self) -> None:
        self._watch = True
        fixed = self._fixed
        self._waiting = [(t, p) for p, t in enumerate(self._time) if not fixed[p]]
        heapq.heapify(self._waiting)

    def _path(self, parent: list[Edge | None], point: int, last: Step) -> list[Step]:
        """Return the edges that raised the label of `point`, from an executed point or the present on."""
        path = [last]
        seen = {point: 0}
        while (edge := parent[point]) is not None:
            u, w, index = edge
            path.append((u, point, w, index))
            if u in seen:  # a cycle, found before the search for cycles was due
                return path[seen[u] + 1 :][::-1]
            seen[u] = len(path) - 1
            point = u
        if not self._fixed[point]:
            path.append((-1, point, self.now_ms, -1))
        return path[::-1]

    def _support(self, point: int) -> list[Step]:
        """Return edges that hold a point at its time in the earliest schedule, from an executed point on."""
        time, fixed = self._time, self._fixed
        after: dict[int, Step] = {}
        queue = deque([point])
        seen = {point}
        while queue:
            v = queue.popleft()
            if fixed[v] or time[v] == self.now_ms:
                path: list[Step] = [] if fixed[v] else [(-1, v, self.now_ms, -1)]
                while v != point:
                    path.append(after[v])
                    v = after[v][1]
                return path
            for u, w, index in self._in[v]:
                if time[u] + w == time[v] and u not in seen:
                    seen.add(u)
                    after[u] = (u, v, w, index)
                    queue.append(u)
        return []


class _Suspect:
    """The edges of a contradiction, with quick answers to whether an event ends it.

    The path is a cycle of points not executed, or leads from an executed point (or the present, -1) to an
    executed one. As points on it are executed it is shortened from the front.
    """

    __slots__ = ("begin", "indices", "is_cycle", "path", "place", "rest")

    def __init__(self, path: list[Step], fixed: list[bool]) -> None:
        self.path = path
        self.is_cycle = path[0][0] == path[-1][1] and not fixed[path[-1][1]]
        self.begin = 0
        self.indices = {index: at for at, (_, _, _, index) in enumerate(path)}
        self.place = {u: at for at, (u, _, _, _) in enumerate(path) if u >= 0}
        rest = 0
        self.rest = [0] * len(path)
        for at in range(len(path) - 1, -1, -1):
            rest += path[at][2]
            self.rest[at] = rest

    def loses(self, index: int) -> bool:
        """Tell whether removing a constraint may end the contradiction."""
        return self.indices.get(index, -1) >= self.begin

    def resolved_by(self, point: int, t_ms: int, time: list[int]) -> bool:
        """Tell whether the execution of a point may have ended the contradiction, or changed its nature."""
        at = self.place.get(point, -1)
        last = self.path[-1][1]
        if self.is_cycle or point == last:
            return at >= 0 or point == last
        if at < self.begin:
            return False
        self.begin = at
        both_executed = at == len(self.path) - 1  # then the constraint is dropped
        return both_executed or t_ms + self.rest[at] <= time[last]

    def conflict(self, time: list[int], constraints: list[Constraint | None]) -> Conflict:
        links = []
        for u, v, w, index in self.path[self.begin :]:
            links.append(Link(max(u, ORIGIN), v, w, constraints[index] if index >= 0 else None))
        deficit = self.rest[self.begin]
        first, last = self.path[self.begin][0], self.path[-1][1]
        if not self.is_cycle:
            deficit += (time[first] if first >= 0 else 0) - time[last]
        return Conflict(tuple(links), deficit)


def _find_cycle(parent: list[Edge | None]) -> list[Step] | None:
    """Return the edges of a cycle among parent links in the order of time, None if there is none."""
    done = bytearray(len(parent))
    for root in range(len(parent)):
        point = root
        walked: set[int] = set()
        while not done[point] and point not in walked:
            walked.add(point)
            edge = parent[point]
            if edge is None:
                break
            point = edge[0]
        else:
            if point in walked:
                cycle: list[Step] = []
                at = point
                while not cycle or at != point:
                    edge = parent[at]
                    assert edge is not None
                    cycle.append((edge[0], at, edge[1], edge[2]))
                    at = edge[0]
                return cycle[::-1]
        for p in walked:
            done[p] = 1
    return None
