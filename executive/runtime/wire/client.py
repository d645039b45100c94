"""The executive's end of a wire: a rover behind the ports, over a line that may lose frames, break, be away.

One thread owns the line (`Line`). Whoever sends, aborts or stops only leaves word (`Outbox`), so nothing of
the executive ever waits for a line; what must not get lost is said again until the rover answers to it. What
the rover says is numbered (`Stream`): what is missing is asked for, what comes twice is dropped.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

from executive.errors import WireError
from executive.ports import (
    Clock,
    Command,
    CommandId,
    CommandStatus,
    Event,
    LinkState,
    Product,
    Value,
)
from executive.runtime.wire.address import Address, Keys, dial
from executive.runtime.wire.conversation import Complaints, Conversation, Welcome
from executive.runtime.wire.downloads import Downloads
from executive.runtime.wire.line import Dial, Line, WireOptions
from executive.runtime.wire.messages import about, mapping, status_of
from executive.runtime.wire.outbox import called_off


class WireRover:
    """A rover at the other end of a wire: `Rover`, `Receipts`, `Heartbeat` and `Link`.

    Parameters
    ----------
    where
        Its address, or a function that gives a line to it.
    run
        Id of the run: the rover gives what it kept for it.
    out
        Folder of the run, into which products come down; without it they stay on board.
    """

    def __init__(
        self,
        where: Address | Dial,
        *,
        run: str,
        keys: Keys | None = None,
        out: Path | None = None,
        options: WireOptions | None = None,
    ) -> None:
        self.options = options or WireOptions()
        reach: Dial
        if isinstance(where, Address):
            where.require_keys(keys)
            reach = partial(dial, where, keys, self.options.dial_s)
        else:
            reach = where
        self.where = str(where) if isinstance(where, Address) else "the rover"
        self.run = run
        self._complain = Complaints()
        self._downloads = None if out is None else Downloads(out, self._complain)
        self._talk = Conversation(run, self.where, self.options, self._complain, self._downloads)
        self._outbox, self._stream, self.times = self._talk.outbox, self._talk.stream, self._talk.times
        self._told = threading.Condition()
        self._line = Line(reach, self._talk, self._told, self.options, f"{run}-wire")
        self._questions = 0
        self._clock: Clock | None = None

    @property
    def welcome(self) -> Welcome | None:
        """What the rover said of itself, once it has."""
        return self._talk.welcome

    # --- ports: commands ----------------------------------------------------------

    def send(self, command: Command) -> None:
        """Leave word of a command.

        Raises
        ------
        WireError
            If no frame can hold it.
        """
        with self._told:
            self._outbox.send(command)
        self._line.begin()

    def abort(self, command: CommandId) -> None:
        with self._told:
            if self._outbox.abort(command):
                self._call_off([command])
        self._line.begin()

    def stop(self) -> None:
        """Let the rover stop everything at once; said until the rover says that it has."""
        with self._told:
            self._call_off(self._outbox.stop())
        self._line.begin()

    def _call_off(self, commands: Iterable[CommandId]) -> None:
        """Commands that never left need not be stopped."""
        self._talk.events.extend(called_off(command) for command in commands)
        self._told.notify_all()

    def status(self, command: CommandId) -> CommandStatus:
        """Return what the rover says of a command.

        Raises
        ------
        WireError
            If it says nothing in time.
        """
        status = status_of(self._ask(about("status", command)))
        with self._told:
            return self._outbox.known(status, command)

    # --- ports: events ----------------------------------------------------------------

    def next_event(self, until_ms: int | None) -> Event | None:
        """Return what the rover said next; waits for it up to 20 ms (for ever without `until_ms`)."""
        self._line.begin()
        events = self._talk.events
        with self._told:
            while not events and not self._line.closing:
                self._told.wait(0.02)
                if until_ms is not None:
                    break
            return events.popleft() if events else None

    def commit(self, number: int) -> None:
        with self._told:
            self._stream.committed = max(self._stream.committed, number)
        self._line.wake()

    def since(self, number: int) -> Sequence[Event]:
        """Return what was said after a number, as far as it comes in time; the rest comes as events."""
        with self._told:
            self._outbox.begun_at = number
            if not self._line.begun:
                self._stream.go_on_from(number)
                self._line.begin()
            self._told.wait_for(self._caught_up, self.options.patience_s)
            events = [self._in_plan_time(event) for event in self._talk.events]
            self._talk.events.clear()
            return events

    def _caught_up(self) -> bool:
        return self._line.closing or (self._talk.greeted and self._stream.whole)

    def _in_plan_time(self, event: Event) -> Event:
        """Return an event at the plan time at which it was said, by how long ago that was for the rover."""
        now_ms = self._clock.now_ms() if self._clock is not None else event.t_ms
        rate = float(getattr(self._clock, "speed", 1.0))
        age_s = self.times.age_s(event.t_ms)
        return event._replace(t_ms=now_ms if age_s is None else max(0, round(now_ms - 1000 * rate * age_s)))

    def present_state(self) -> Mapping[str, Value]:
        """Return all state values.

        Raises
        ------
        WireError
            If the rover says nothing in time.
        """
        values = mapping(self._ask({"m": "state"}), "values")
        return {k: v for k, v in values.items() if isinstance(v, str | bool | int | float)}

    def heartbeat(self, t_ms: int) -> None:
        """Let the rover know that the executive is well, not only its end of the line."""
        self._talk.plan_ms = t_ms

    # --- ports: the link ---------------------------------------------------------------

    def attach(self, clock: Clock, complain: Callable[[str, str], None]) -> None:
        self._clock = clock
        self.times.plan = clock
        self._complain.listen(complain)

    def link(self) -> LinkState:
        with self._told:
            word = self._line.word
            return LinkState(
                self._talk.greeted,
                None if word is None else time.monotonic() - word,
                self.times.round_trip_s,
                self.times.offset_s,
                self._talk.breaks,
                self._outbox.states(),
                self._outbox.stopping,
            )

    # --- for whoever makes the run ------------------------------------------------------

    def wait_ready(self, timeout_s: float = 30.0) -> Welcome:
        """Return what the rover says of itself once all that it had said before is here, its first state.

        Raises
        ------
        WireError
            If it does not come in time; the message says what was tried.
        """
        self._line.begin()
        talk = self._talk
        with self._told:
            ready = self._told.wait_for(
                lambda: talk.refused or self._caught_up(),
                timeout_s,
            )
            if talk.refused:
                raise WireError(f"{self.where} refuses: {talk.refused}")
            if not ready or talk.welcome is None:
                why = self._line.why or "it accepts the line and says nothing"
                raise WireError(f"{self.where}: no rover answers within {timeout_s:g} s ({why})")
            return talk.welcome

    def inject(self, fault: Mapping[str, object]) -> None:
        """Let a simulated rover suffer a fault.

        Raises
        ------
        WireError
            If it refuses, or says nothing in time.
        """
        if self.welcome is not None and not self.welcome.faults:
            raise WireError(f"the rover {self.welcome.rover} takes no faults")
        reply = self._ask({"m": "fault", "fault": fault})
        if reply.get("ok") is not True:
            raise WireError(str(reply.get("reason") or "the rover takes no faults"))

    def fetch(self, products: Iterable[Product]) -> None:
        """Let products come down that the rover told of earlier, where their files are not here.

        It begins no line: that is for whoever knows what this run has heard before (`since`).
        """
        with self._told:
            for product in products:
                if self._downloads is not None:
                    self._downloads.want(product)
        self._line.wake()

    def wait_for_products(self, timeout_s: float) -> int:
        """Return how many files have not come down when none is open any more or the time is over."""
        if self._downloads is None:
            return 0
        downloads = self._downloads
        with self._told:
            self._told.wait_for(lambda: not downloads.open, timeout_s)
            return downloads.open

    def close(self, *, over: bool = False) -> None:
        """End the line; with `over` the run is over and the rover may forget it."""
        with self._told:
            connection = self._line.connection
            if over and connection is not None and self._talk.greeted:
                connection.put({"m": "commit", "number": self._stream.committed})
                connection.put({"m": "bye"})
        self._line.close()

    def break_line(self) -> None:
        """Begin the line anew; for checks."""
        self._line.break_off()

    def say_raw(self, data: bytes) -> None:
        """Put bytes on the line that may be no frame; for checks."""
        with self._told:
            if self._line.connection is not None:
                self._line.connection.put_raw(data)
        self._line.wake()

    # --- questions ------------------------------------------------------------------------

    def _ask(self, message: dict[str, object]) -> dict[str, object]:
        """Return the rover's answer; the question is said again while there is none."""
        self._line.begin()
        talk, line = self._talk, self._line
        with self._told:
            self._questions += 1
            number = self._questions
            message = {**message, "q": number}
            talk.replies[number] = None
            end = time.monotonic() + self.options.patience_s
            try:
                while (left := end - time.monotonic()) > 0 and not line.closing:
                    if talk.greeted and line.connection is not None:
                        line.connection.put(message)
                        line.wake()
                    self._told.wait_for(
                        lambda: talk.replies[number] is not None or line.closing,
                        min(left, talk.retry_s if talk.greeted else 0.05),
                    )
                    reply = talk.replies[number]
                    if reply is not None:
                        return reply
            finally:
                del talk.replies[number]
        raise WireError(f"no answer to {message['m']} within {self.options.patience_s:g} s")
