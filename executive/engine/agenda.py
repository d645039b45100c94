"""What is to be looked at next, and when: the one queue of a run, with its clock.

Only what can have changed is looked at. Nodes get here when their own state, a child, a watched key, a time
point they refer to or a timer says so; they leave in text order (phase E) or by urgency (phase S).
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator

from executive.engine.instance import Floating, Instance, State


class Agenda:
    """Nodes to be looked at, timers and deadlines. Times are milliseconds on the plan clock."""

    def __init__(self) -> None:
        self.now = 0
        self._touched: list[tuple[int, Instance]] = []
        self._candidates: list[tuple[float, int, int, Instance]] = []
        self._timers: list[tuple[int, int, Instance | Floating]] = []
        self._deadlines: list[tuple[int, int, Instance]] = []
        self._expired: list[tuple[int, int, Instance]] = []
        self._serial = 0

    # --- putting in ---------------------------------------------------------------

    def touch(self, node: Instance) -> None:
        """Look at the node in phase E."""
        if not node.queued:
            node.queued = True
            heapq.heappush(self._touched, (node.order, node))

    def consider(self, node: Instance) -> None:
        """Look at a WAITING or SUSPENDED node in phase S."""
        if not node.candidate:
            node.candidate = True
            heapq.heappush(self._candidates, (node.spec.priority, node.activation, node.order, node))

    def wake(self, node: Instance) -> None:
        """Look at the node in the phase that its state belongs to."""
        if node.state is State.WAITING or node.state is State.SUSPENDED:
            self.consider(node)
        elif node.state is not State.FINISHED:
            self.touch(node)

    def set_timer(self, t_ms: int, target: Instance | Floating) -> None:
        """Wake the target at a later time."""
        if t_ms > self.now:
            self._serial += 1
            heapq.heappush(self._timers, (t_ms, self._serial, target))

    def set_deadline(self, t_ms: int, node: Instance) -> None:
        """Look at the upper bound of the node's own window at `t_ms`."""
        self._serial += 1
        heapq.heappush(self._deadlines, (t_ms, self._serial, node))

    def sort_again(self) -> None:
        """Put what is to be looked at in phase E in the text order of a new plan."""
        self._touched = [(node.order, node) for _, node in self._touched if node.queued]
        heapq.heapify(self._touched)

    # --- taking out ---------------------------------------------------------------

    def touched(self) -> Iterator[Instance]:
        """Yield the nodes to be looked at in phase E, those that come in meanwhile included."""
        heap = self._touched
        while heap:
            _, node = heapq.heappop(heap)
            if node.queued:
                node.queued = False
                yield node

    def candidates(self) -> Iterator[Instance]:
        """Yield the nodes to be looked at in phase S, the most urgent first."""
        heap = self._candidates
        while heap:
            node = heapq.heappop(heap)[3]
            if node.candidate:
                node.candidate = False
                yield node

    def ringing(self) -> Iterator[Instance | Floating]:
        """Yield what has a timer that is due."""
        timers = self._timers
        while timers and timers[0][0] <= self.now:
            yield heapq.heappop(timers)[2]

    def expired(self) -> Iterator[Instance]:
        """Yield the nodes with a deadline that is due, in text order; each deadline once."""
        while self._deadlines and self._deadlines[0][0] <= self.now:
            _, _, node = heapq.heappop(self._deadlines)
            self._serial += 1
            heapq.heappush(self._expired, (node.order, self._serial, node))
        while self._expired:
            yield heapq.heappop(self._expired)[2]

    def next_time(self) -> int | None:
        """Return the next time at which a timer or a deadline of a live node is due."""
        timers, deadlines = self._timers, self._deadlines
        while timers and timers[0][2].state is State.FINISHED:
            heapq.heappop(timers)
        while deadlines and deadlines[0][2].state in (State.FINISHED, State.FAILING):
            heapq.heappop(deadlines)
        times = [heap[0][0] for heap in (timers, deadlines) if heap]
        return min(times, default=None)
