"""Clocks of a live run: milliseconds on the plan clock, never backwards, immune to jumps."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import UTC, datetime

from executive.ports import Clock


class MonotonicClock:
    """The machine's monotonic clock, counted from `start_ms`; `speed` > 1 is accelerated time."""

    def __init__(self, start_ms: int = 0, *, speed: float = 1.0) -> None:
        self.start_ms = start_ms
        self.speed = speed
        self._origin = time.monotonic()

    def now_ms(self) -> int:
        return self.start_ms + int((time.monotonic() - self._origin) * 1000 * self.speed)


class SteadyClock:
    """A clock that follows another one but not its jumps.

    The plan clock advances with the monotonic clock of the machine. Small deviations of the followed clock (a
    clock that is slewed) are taken over; a deviation of more than `tolerance_ms` between two looks is a jump:
    it is reported, and from then on ignored.
    """

    def __init__(
        self,
        source: Clock,
        *,
        tolerance_ms: int = 1000,
        reference_ms: Callable[[], float] = lambda: time.monotonic() * 1000,
        report: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.source = source
        self.tolerance_ms = tolerance_ms
        self.reference_ms = reference_ms
        self.report = report
        self._source_last = source.now_ms()
        self._reference_last = reference_ms()
        self._now = float(self._source_last)
        self._last = self._source_last

    def now_ms(self) -> int:
        source, reference = self.source.now_ms(), self.reference_ms()
        step = source - self._source_last
        elapsed = reference - self._reference_last
        if abs(step - elapsed) > self.tolerance_ms:
            self.report(
                f"the clock jumped by {step - elapsed:+.0f} ms; the plan clock goes on without the jump"
            )
            step = int(elapsed)
        self._source_last, self._reference_last = source, reference
        self._now += step
        self._last = max(self._last, int(self._now))
        return self._last


def utc_now() -> datetime:
    """Return the wall clock."""
    return datetime.now(UTC)


def instant_of(text: str) -> datetime:
    """Return an instant in ISO 8601; without a zone it is UTC."""
    instant = datetime.fromisoformat(text.replace("Z", "+00:00"))
    return instant if instant.tzinfo is not None else instant.replace(tzinfo=UTC)


def plan_now_ms(instant: datetime, now: datetime, rate: float = 1.0) -> int:
    """Return the plan time at a wall-clock instant: rate x (now - instant of plan time 0)."""
    return round((now - instant).total_seconds() * 1000 * rate)


def plan_start_ms(epoch: str | None, now: datetime | None = None, rate: float = 1.0) -> int:
    """Return where the plan clock starts: now - epoch if the plan has an epoch in the past, else 0."""
    if epoch is None:
        return 0
    return max(0, plan_now_ms(instant_of(epoch), now if now is not None else utc_now(), rate))
