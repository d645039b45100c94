"""The one queue between the threads of a live run and the owner of its state."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

from executive.ports import Event, Operator, Update, Value


class Mailbox:
    """Events from any thread, taken by one owner; never loses a result, never grows without bound.

    Operator commands go first. When telemetry floods, the newest updates are merged key by key into the last
    one that waits: a later value replaces an earlier one that nobody has seen yet, which is what the
    executive would have made of the two anyway (CRL.md 4.2: last one wins).
    """

    def __init__(self, limit: int = 10_000) -> None:
        self.limit = limit
        self.merged = 0
        """How many updates were merged into another one."""
        self._urgent: deque[Operator] = deque()
        self._events: deque[Event] = deque()
        self._flood: dict[str, Value] | None = None
        self._updates = 0
        self._condition = threading.Condition()
        self._closed = False

    def post(self, event: Event) -> None:
        """Add an event; may be called from any thread, never blocks for long."""
        with self._condition:
            if isinstance(event, Operator):
                self._urgent.append(event)
            elif isinstance(event, Update):
                self._post_update(event)
            else:
                self._flood = None
                self._events.append(event)
            self._condition.notify_all()

    def _post_update(self, event: Update) -> None:
        if self._updates >= self.limit and self._flood is not None:
            self._flood.update(event.values)
            self._events[-1] = Update(event.t_ms, self._flood, event.number)
            self.merged += 1
            return
        if self._updates >= self.limit:
            values = dict(event.values)
            self._flood = dict(values)
            self._events.append(Update(event.t_ms, self._flood, event.number))
        else:
            self._flood = None
            self._events.append(event)
        self._updates += 1

    def take(self, now_ms: int) -> list[Event]:
        """Return everything that waits, stamped with the present time, operator commands first."""
        with self._condition:
            events: list[Event] = [e._replace(t_ms=now_ms) for e in self._urgent]
            events += [e._replace(t_ms=now_ms) for e in self._events]
            self._urgent.clear()
            self._events.clear()
            self._flood = None
            self._updates = 0
            return events

    def wait(self, timeout_s: float | None, ready: Callable[[], bool] = bool) -> None:
        """Block the owner until something was posted, `wake` was called or the time is over."""
        with self._condition:
            self._condition.wait_for(
                lambda: bool(self._urgent or self._events or self._closed or ready()), timeout_s
            )

    def wake(self) -> None:
        """Let a waiting owner look again."""
        with self._condition:
            self._condition.notify_all()

    def close(self) -> None:
        """Let nobody wait any more."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()

    def __len__(self) -> int:
        with self._condition:
            return len(self._urgent) + len(self._events)
