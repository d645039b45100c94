"""What is to be looked at next, and when: the one queue of a run, with its clock.

Only what can have changed is looked at. Nodes get here when their own state, a child, a watched key, a time
point they refer to or a timer says so; they leave in text order (phase E) or by urgency (phase S).
"""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Iterator
from typing import Any, Generic, TypeVar

from executive.engine.instance import FAILING, FINISHED, SUSPENDED, WAITING, Floating, Instance

Entry = TypeVar("Entry", bound=tuple[Any, ...])


class Queue(Generic[Entry]):
    """Entries that leave the smallest first. Those that come in order wait in a line and cost no heap."""

    __slots__ = ("_heap", "_line")

    def __init__(self) -> None:
        self._line: deque[Entry] = deque()
        self._heap: list[Entry] = []

    def push(self, entry: Entry) -> None:
        """Add an entry."""
        line = self._line
        if not line or entry >= line[-1]:
            line.append(entry)
        else:
            heapq.heappush(self._heap, entry)

    def first(self) -> Entry | None:
        """Return the smallest entry, which stays."""
        line, heap = self._line, self._heap
        if heap and (not line or heap[0] < line[0]):
            return heap[0]
        return line[0] if line else None

    def take(self) -> Entry | None:
        """Take the smallest entry out; None if there is none."""
        line, heap = self._line, self._heap
        if heap and (not line or heap[0] < line[0]):
            return heapq.heappop(heap)
        return line.popleft() if line else None

    def take_until(self, t_ms: int) -> Entry | None:
        """Take the smallest entry out if it begins with a time up to `t_ms`."""
        line, heap = self._line, self._heap
        if heap and (not line or heap[0] < line[0]):
            return heapq.heappop(heap) if heap[0][0] <= t_ms else None
        return line.popleft() if line and line[0][0] <= t_ms else None

    def clear(self) -> list[Entry]:
        """Take all entries out, in any order."""
        entries = [*self._line, *self._heap]
        self._line.clear()
        self._heap.clear()
        return entries


class Agenda:
    """Nodes to be looked at, timers and deadlines. Times are milliseconds on the plan clock."""

    def __init__(self) -> None:
        self.now = 0
        self._touched: Queue[tuple[int, Instance]] = Queue()
        self._candidates: Queue[tuple[float, int, int, Instance]] = Queue()
        self._timers: Queue[tuple[int, int, Instance | Floating]] = Queue()
        self._deadlines: Queue[tuple[int, int, Instance]] = Queue()
        self._expired: Queue[tuple[int, int, Instance]] = Queue()
        self._serial = 0

    # --- putting in ---------------------------------------------------------------

    def touch(self, node: Instance) -> None:
        """Look at the node in phase E."""
        if not node.queued:
            node.queued = True
            self._touched.push((node.order, node))

    def consider(self, node: Instance) -> None:
        """Look at a WAITING or SUSPENDED node in phase S."""
        if not node.candidate:
            node.candidate = True
            self._candidates.push((node.spec.priority, node.activation, node.order, node))

    def wake(self, node: Instance) -> None:
        """Look at the node in the phase that its state belongs to."""
        if node.state is WAITING or node.state is SUSPENDED:
            self.consider(node)
        elif node.state is not FINISHED:
            self.touch(node)

    def set_timer(self, t_ms: int, target: Instance | Floating) -> None:
        """Wake the target at a later time."""
        if t_ms > self.now:
            self._serial += 1
            self._timers.push((t_ms, self._serial, target))

    def set_deadline(self, t_ms: int, node: Instance) -> None:
        """Look at the upper bound of the node's own window at `t_ms`."""
        self._serial += 1
        self._deadlines.push((t_ms, self._serial, node))

    def sort_again(self) -> None:
        """Put what is to be looked at in phase E in the text order of a new plan."""
        for _, node in self._touched.clear():
            if node.queued:
                self._touched.push((node.order, node))

    # --- taking out ---------------------------------------------------------------

    def next_touched(self) -> Instance | None:
        """Return the next node to be looked at in phase E, None if there is none."""
        while (entry := self._touched.take()) is not None:
            node = entry[1]
            if node.queued:
                node.queued = False
                return node
        return None

    def next_candidate(self) -> Instance | None:
        """Return the most urgent node to be looked at in phase S, None if there is none."""
        while (entry := self._candidates.take()) is not None:
            node = entry[3]
            if node.candidate:
                node.candidate = False
                return node
        return None

    def ringing(self) -> Instance | Floating | None:
        """Return the next target whose timer is due."""
        entry = self._timers.take_until(self.now)
        return None if entry is None else entry[2]

    def deadline_due(self) -> bool:
        """Tell whether a deadline is due, even if only of a node to which it no longer applies."""
        entry = self._deadlines.first()
        return self._expired.first() is not None or (entry is not None and entry[0] <= self.now)

    def expired(self) -> Iterator[Instance]:
        """Yield the nodes with a deadline that is due, in text order; each deadline once."""
        while (entry := self._deadlines.take_until(self.now)) is not None:
            self._serial += 1
            self._expired.push((entry[2].order, self._serial, entry[2]))
        while (entry := self._expired.take()) is not None:
            yield entry[2]

    def next_time(self) -> int | None:
        """Return the next time at which a timer or a deadline of a live node is due."""
        while (timer := self._timers.first()) is not None and timer[2].state is FINISHED:
            self._timers.take()
        while (due := self._deadlines.first()) is not None and due[2].state in (
            FINISHED,
            FAILING,
        ):
            self._deadlines.take()
        if timer is None or due is None:
            entry = timer or due
            return None if entry is None else entry[0]
        return min(timer[0], due[0])
