"""What a rover has said and nobody has made durable yet: numbered, in order, bounded."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping

from executive.ports import Acknowledgement, CommandId, Event, Result, Update, Value
from executive.runtime.wire.messages import numbered

MERGE_FROM = 2_000
"""From so many kept events on, updates that have not left yet are merged, key by key."""


def first_number(seconds: float) -> int:
    """Return the number before the first event of a life that begins at this UTC instant.

    A rover that keeps nothing over a restart numbers above all it has said before: 2^20 numbers a second, so
    two lives within one second have numbers of their own, too.
    """
    return max(0, int(seconds * (1 << 20)))


class Kept:
    """The stream of a rover for one run; belongs to one thread."""

    def __init__(self, boot: int) -> None:
        self.boot = self.last = boot
        self.state: dict[str, Value] = {}
        self._events: deque[Event] = deque()
        self._left = boot
        """Highest number that has left."""

    @property
    def first(self) -> int:
        """Return the lowest number that is kept, or would be next."""
        return self.last - len(self._events) + 1

    def say(self, event: Event) -> None:
        """Number an event and keep it."""
        event = numbered(event)
        self.state.update(event.values if isinstance(event, Update) else getattr(event, "updates", {}))
        newest = self._events[-1] if self._events else None
        if (
            isinstance(event, Update)
            and isinstance(newest, Update)
            and len(self._events) >= MERGE_FROM
            and newest.number > self._left
        ):
            merged: Mapping[str, Value] = {**newest.values, **event.values}
            self._events[-1] = Update(event.t_ms, merged, newest.number)
            return
        self.last += 1
        self._events.append(event._replace(number=self.last))

    def fresh(self, limit: int) -> list[Event]:
        """Return up to so many events that have not left yet; they count as having left."""
        unseen = self.last - max(self._left, self.first - 1)
        start = len(self._events) - unseen
        found = [self._events[k] for k in range(start, min(start + limit, len(self._events)))]
        if found:
            self._left = numbered(found[-1]).number
        return found

    def rewind(self, number: int) -> None:
        """Let what comes after a number leave (again)."""
        self._left = max(number, self.first - 1)

    def commit(self, number: int) -> None:
        """Forget what is durable elsewhere."""
        while self._events and numbered(self._events[0]).number <= number:
            self._events.popleft()

    def move_behind(self, number: int) -> None:
        """Number everything anew behind what the executive has of an earlier life of this rover."""
        shift = number - self.boot
        self._events = deque(
            numbered(event)._replace(number=numbered(event).number + shift) for event in self._events
        )
        self.boot += shift
        self.last += shift
        self._left = self.boot

    def forget(self, t_ms: int) -> None:
        """Begin for another run: what is known of the present state is its first word."""
        self._events.clear()
        self.boot = self._left = self.last
        self.say(Update(t_ms, dict(self.state)))


class Commands:
    """What became of each command that a rover has heard of."""

    def __init__(self) -> None:
        self.done: dict[CommandId, Result | Acknowledgement] = {}
        self.running: set[CommandId] = set()

    def begin(self, command: CommandId) -> bool:
        """Return whether a command is new; it runs from now on."""
        if command in self.running or command in self.done:
            return False
        self.running.add(command)
        return True

    def note(self, event: Event) -> None:
        """Take in that a command is over."""
        if isinstance(event, Result | Acknowledgement):
            self.running.discard(event.command)
            self.done[event.command] = event

    def call_off(self, command: CommandId, say: Callable[[Event], None], t_ms: int) -> None:
        """Let an abort of a command that was never heard of end it, so that it never begins."""
        if command not in self.running and command not in self.done:
            say(Acknowledgement(t_ms, command))
