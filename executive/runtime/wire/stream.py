"""The rover's numbered word as the executive hears it: in order, once each, gaps known."""

from __future__ import annotations

from executive.ports import Event

AHEAD = 10_000
"""Events kept that came before one that is missing."""


class Stream:
    """Puts numbered events in order. `None` stands for an event that was malformed: its number counts."""

    def __init__(self) -> None:
        self.heard = 0
        """Everything up to this number was handed on."""
        self.last = 0
        """The highest number that the rover is known to have given."""
        self.committed = 0
        """Everything up to this number is durable on this side."""
        self._ahead: dict[int, Event | None] = {}

    @property
    def whole(self) -> bool:
        """Return whether nothing is known to be missing."""
        return self.heard >= self.last

    def go_on_from(self, number: int) -> None:
        """Begin behind what an earlier process has heard."""
        self.heard = self.last = number

    def take(self, number: int, event: Event | None) -> list[Event]:
        """Return the events that are next, now that this one is here."""
        self.last = max(self.last, number)
        if number > self.heard and len(self._ahead) < AHEAD:
            self._ahead[number] = event
        return self._next()

    def skip_to(self, first: int) -> list[Event]:
        """Return the events that are next when nothing below `first` is kept any more."""
        if first <= self.heard + 1:
            return []
        self.heard = first - 1
        self._ahead = {n: e for n, e in self._ahead.items() if n > self.heard}
        return self._next()

    def _next(self) -> list[Event]:
        found = []
        while self.heard + 1 in self._ahead:
            self.heard += 1
            event = self._ahead.pop(self.heard)
            if event is not None:
                found.append(event)
        return found
