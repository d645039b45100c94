"""How the rover's clock stands beside ours, from questions and answers that carry both."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

from executive.ports import Clock

JUMP_S = 1.0
"""A clock that is off by more than this, and more than the answer took, has jumped."""
KEPT = 8
"""Answers of which the quickest tells the offset (as in NTP, RFC 5905, section 10)."""


class RoundTrips:
    """The rover's clock by the answers to `beat`; seconds of the machine's monotonic clock.

    The rover's clock is in milliseconds, runs at `rate`, and may start anywhere, jump, and differ by hours:
    only ages of what was said are taken from it, and a jump is noted and begins the comparison anew.
    """

    def __init__(self, complain: Callable[[str, str], None]) -> None:
        self.rate = 1.0
        self.plan: Clock | None = None
        self._complain = complain
        self._asked: dict[int, float] = {}
        self._count = 0
        self._kept: deque[tuple[float, float]] = deque(maxlen=KEPT)
        self._shown: tuple[float, float] | None = None
        """Rover's clock and ours at one instant, milliseconds and seconds."""
        self._last: tuple[int, int] = (0, 0)
        """Mark of the last answer, and what the rover's clock showed in it."""
        self._backwards = False

    def begin(self, now: float) -> int:
        """Return the mark of a question that leaves now."""
        self._count += 1
        self._asked[self._count] = now
        self._asked.pop(self._count - 64, None)
        return self._count

    def end(self, mark: int, rover_ms: int, now: float) -> None:
        """Take in the answer to a question, heard at `now` (monotonic, s), with the rover's clock in it."""
        asked = self._asked.pop(mark, None)
        if asked is None:
            return
        trip = now - asked
        middle = (now + asked) / 2
        expected = self._rover_ms(middle)
        if expected is not None:
            off_s = (rover_ms - expected) / 1000 / self.rate
            if abs(off_s) > JUMP_S + trip:
                self._complain("clock", f"the rover's clock jumped by {off_s:+.1f} s; ours goes on")
                self._kept.clear()
                self._shown = None
                self._last = (mark, rover_ms)
        if mark > self._last[0]:
            if rover_ms < self._last[1] and not self._backwards:
                self._backwards = True
                self._complain("clock", "the rover's clock runs backwards; ours goes on")
            self._last = (mark, rover_ms)
        self._kept.append((trip, rover_ms - 1000 * self.rate * middle))
        if trip <= min(t for t, _ in self._kept):
            self._shown = (rover_ms, middle)

    def show(self, rover_ms: int, now: float) -> None:
        """Take in what the rover's clock says without a question of ours."""
        self._kept.clear()
        self._shown = (rover_ms, now)
        self._last = (self._count, 0)

    @property
    def round_trip_s(self) -> float | None:
        """Return the longest of the last round trips."""
        return max((trip for trip, _ in self._kept), default=None)

    def _rover_ms(self, now: float) -> float | None:
        if self._shown is None:
            return None
        return self._shown[0] + 1000 * self.rate * (now - self._shown[1])

    def age_s(self, rover_ms: int) -> float | None:
        """Return how long ago the rover's clock showed a time, never below 0; None if that is not known."""
        now_ms = self._rover_ms(time.monotonic())
        return None if now_ms is None else max(0.0, (now_ms - rover_ms) / 1000 / self.rate)

    @property
    def offset_s(self) -> float | None:
        """Return the rover's clock minus that of the plan."""
        now_ms = self._rover_ms(time.monotonic())
        return None if now_ms is None or self.plan is None else (now_ms - self.plan.now_ms()) / 1000
