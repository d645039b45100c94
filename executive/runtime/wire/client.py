"""The executive's end of a wire: a rover behind the ports, over a line that may lose frames, break, be away.

One thread owns the line. Whoever sends, aborts or stops only leaves word, so nothing of the executive ever
waits for a line; what must not get lost is said again until the rover answers to it. What the rover says is
numbered: what is missing is asked for, what comes twice is dropped.
"""

from __future__ import annotations

import logging
import os
import selectors
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from executive.errors import WireError
from executive.ports import (
    Acknowledgement,
    Clock,
    Command,
    CommandId,
    CommandState,
    CommandStatus,
    Event,
    LinkState,
    Product,
    Result,
    Value,
)
from executive.runtime.codec import Json
from executive.runtime.wire.address import Address, Keys, dial
from executive.runtime.wire.downloads import Downloads
from executive.runtime.wire.frames import Connection
from executive.runtime.wire.messages import (
    PROTOCOL,
    about,
    command_id,
    event_of,
    mapping,
    numbered,
    send_message,
    status_of,
    text,
    whole,
)
from executive.runtime.wire.round_trips import RoundTrips

logger = logging.getLogger(__name__)

Dial = Callable[[], socket.socket]

RESTARTED = "the rover restarted and knows nothing of it"
AHEAD = 10_000
"""Events kept that came before one that is missing."""


@dataclass(frozen=True, slots=True)
class WireOptions:
    """How patient the executive's end is; seconds of the wall clock."""

    beat_s: float = 1.0
    retry_s: float = 1.0
    """What was not answered is said again after so long, or after two round trips if that is more."""
    dead_s: float = 10.0
    """A line on which nothing came for so long is begun anew: half-open lines say nothing of it."""
    dial_s: float = 5.0
    pause_s: float = 0.2
    """Between two tries to reach the rover; doubled up to `longest_pause_s`."""
    longest_pause_s: float = 2.0
    patience_s: float = 5.0
    """How long a question may stay unanswered."""


@dataclass(frozen=True, slots=True)
class Welcome:
    """What the rover said of itself: name, number before the first event of its present life, clock rate,
    whether it takes faults.
    """

    rover: str
    boot: int
    rate: float
    dictionary: Mapping[str, object]
    faults: bool = False


@dataclass(slots=True)
class _Open:
    """A command that is not over: its message, when it was last said, in which life of the rover first."""

    message: Json
    state: str = "sent"
    said: float = 0.0
    boot: int | None = None
    abort_said: float | None = None


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
        if isinstance(where, Address):
            where.require_keys(keys)
            address = where
            self._dial: Dial = lambda: dial(address, keys, self.options.dial_s)
        else:
            self._dial = where
        self.where = str(where) if isinstance(where, Address) else "the rover"
        self.run = run
        self.welcome: Welcome | None = None
        self._lock = threading.RLock()
        self._told = threading.Condition(self._lock)
        self._events: deque[Event] = deque()
        self._ahead: dict[int, Event | None] = {}
        self._heard = self._last = self._committed = self._commit_said = 0
        self._begun_at = 0
        self._open: dict[CommandId, _Open] = {}
        self._replies: dict[int, Json | None] = {}
        self._questions = 0
        self._plan_ms: int | None = None
        self._stop_wanted = False
        self._stop_said = self._since_said = self._beat_said = self._hello_said = -1e9
        self._word: float | None = None
        self._greeted = False
        self._breaks = 0
        self._why = ""
        self._refused = ""
        self._closing = False
        self._connection: Connection | None = None
        self._thread: threading.Thread | None = None
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_read, False)
        os.set_blocking(self._wake_write, False)
        self._clock: Clock | None = None
        self._complaint: Callable[[str, str], None] = lambda kind, said: logger.info(
            "wire", extra={"kind": kind, "said": said}
        )
        self._complained: set[str] = set()
        self.times = RoundTrips(self._complain)
        self._downloads = None if out is None else Downloads(out, self._complain)

    # --- ports: commands ----------------------------------------------------------

    def send(self, command: Command) -> None:
        with self._lock:
            if command.id not in self._open:
                self._open[command.id] = _Open(send_message(command))
        self._begin()

    def abort(self, command: CommandId) -> None:
        with self._lock:
            entry = self._open.get(command)
            if entry is not None and entry.boot is None and entry.message.get("m") == "send":
                self._call_off(command)  # it never left
            elif entry is None:
                self._open[command] = _Open({}, abort_said=-1e9, boot=0)
            elif entry.abort_said is None:
                entry.abort_said = -1e9
        self._begin()

    def stop(self) -> None:
        """Let the rover stop everything at once; said until the rover says that it has."""
        with self._lock:
            self._stop_wanted, self._stop_said = True, -1e9
            for command, entry in list(self._open.items()):
                if entry.boot is None:
                    self._call_off(command)
                elif entry.abort_said is None:  # or it would begin when it is said again
                    entry.abort_said = -1e9
        self._begin()

    def status(self, command: CommandId) -> CommandStatus:
        """Return what the rover says of a command.

        Raises
        ------
        WireError
            If it says nothing in time.
        """
        status = status_of(self._ask(about("status", command)))
        if status.state is CommandState.RUNNING:
            with self._lock:  # of a process before this one
                self._open.setdefault(command, _Open({}, state="running", boot=0))
        if status.state is CommandState.UNKNOWN:
            with self._lock:
                entry = self._open.get(command)
                if self._is_forgotten(entry):
                    return CommandStatus(CommandState.DONE, Result(0, command, False, RESTARTED))
                if entry is not None and entry.state == "sent":
                    return CommandStatus(CommandState.RUNNING)  # on its way, and said until it is heard
        return status

    def _is_forgotten(self, entry: _Open | None) -> bool:
        """Tell whether a command belongs to an earlier life of the rover, which may have begun it."""
        boot = self.welcome.boot if self.welcome is not None else 0
        if entry is None or not entry.message:
            return 0 < self._begun_at <= boot
        return entry.boot is not None and entry.boot < boot

    # --- ports: events ----------------------------------------------------------------

    def next_event(self, until_ms: int | None) -> Event | None:
        """Return what the rover said next; waits for it up to 20 ms (for ever without `until_ms`)."""
        self._begin()
        with self._told:
            while not self._events and not self._closing:
                self._told.wait(0.02)
                if until_ms is not None:
                    break
            return self._events.popleft() if self._events else None

    def commit(self, number: int) -> None:
        with self._lock:
            self._committed = max(self._committed, number)
        self._wake()

    def since(self, number: int) -> Sequence[Event]:
        """Return what was said after a number, as far as it comes in time; the rest comes as events."""
        with self._told:
            if self._thread is None:
                self._heard = self._last = self._begun_at = number
                self._begin()
            self._told.wait_for(self._caught_up, self.options.patience_s)
            events = [self._in_plan_time(event) for event in self._events]
            self._events.clear()
            return events

    def _caught_up(self) -> bool:
        return self._closing or (self._greeted and self._heard >= self._last)

    def _in_plan_time(self, event: Event) -> Event:
        """Return an event at the plan time at which it was said, by how long ago that was for the rover."""
        now_ms = self._clock.now_ms() if self._clock is not None else event.t_ms
        rate = float(getattr(self._clock, "speed", 1.0))
        age_s = self.times.age_s(event.t_ms)
        return replace(event, t_ms=now_ms if age_s is None else max(0, round(now_ms - 1000 * rate * age_s)))

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
        self._plan_ms = t_ms

    # --- ports: the link ---------------------------------------------------------------

    def attach(self, clock: Clock, complain: Callable[[str, str], None]) -> None:
        self._clock, self._complaint = clock, complain
        self.times.plan = clock

    def link(self) -> LinkState:
        with self._lock:
            age = None if self._word is None else time.monotonic() - self._word
            return LinkState(
                self._greeted,
                age,
                self.times.round_trip_s,
                self.times.offset_s,
                self._breaks,
                tuple((command, entry.state) for command, entry in self._open.items()),
            )

    # --- for whoever makes the run ------------------------------------------------------

    def wait_ready(self, timeout_s: float = 30.0) -> Welcome:
        """Return what the rover says of itself once its first state is here.

        Raises
        ------
        WireError
            If it does not come in time; the message says what was tried.
        """
        self._begin()
        with self._told:
            ready = self._told.wait_for(
                lambda: self._closing or self._refused or (self._greeted and self._heard > 0), timeout_s
            )
            if self._refused:
                raise WireError(f"{self.where} refuses: {self._refused}")
            if not ready or self.welcome is None:
                why = self._why or "it accepts the line and says nothing"
                raise WireError(f"{self.where}: no rover answers within {timeout_s:g} s ({why})")
            return self.welcome

    def inject(self, fault: Json) -> None:
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

    def wait_for_products(self, timeout_s: float) -> int:
        """Return how many files have not come down when none is open any more or the time is over."""
        end = time.monotonic() + timeout_s
        while self._downloads is not None and self._downloads.open and time.monotonic() < end:
            time.sleep(0.01)
        return 0 if self._downloads is None else self._downloads.open

    def close(self, *, over: bool = False) -> None:
        """End the line; with `over` the run is over and the rover may forget it."""
        with self._lock:
            if over and self._connection is not None and self._greeted:
                self._connection.put({"m": "commit", "number": self._committed})
                self._connection.put({"m": "bye"})
            self._closing = True
            self._told.notify_all()
        self._wake()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout=5)
        if self._wake_read >= 0:
            os.close(self._wake_read)
            os.close(self._wake_write)
            self._wake_read = self._wake_write = -1

    def break_line(self) -> None:
        """Begin the line anew; for checks."""
        with self._lock:
            if self._connection is not None:
                with suppress(OSError):
                    self._connection.line.shutdown(socket.SHUT_RDWR)

    def say_raw(self, data: bytes) -> None:
        """Put bytes on the line that may be no frame; for checks."""
        with self._lock:
            if self._connection is not None:
                self._connection.put_raw(data)
        self._wake()

    # --- questions ------------------------------------------------------------------------

    def _ask(self, message: Json) -> Json:
        """Return the rover's answer; the question is said again while there is none."""
        self._begin()
        with self._told:
            self._questions += 1
            number = self._questions
            message = {**message, "q": number}
            self._replies[number] = None
            end = time.monotonic() + self.options.patience_s
            try:
                while (left := end - time.monotonic()) > 0 and not self._closing:
                    if self._greeted and self._connection is not None:
                        self._connection.put(message)
                        self._wake()
                    self._told.wait_for(
                        lambda: self._replies[number] is not None or self._closing,
                        min(left, self._retry_s if self._greeted else 0.05),
                    )
                    reply = self._replies[number]
                    if reply is not None:
                        return reply
            finally:
                del self._replies[number]
        raise WireError(f"no answer to {message['m']} within {self.options.patience_s:g} s")

    @property
    def _retry_s(self) -> float:
        return max(self.options.retry_s, 2 * (self.times.round_trip_s or 0.0))

    # --- the thread that owns the line -----------------------------------------------------

    def _begin(self) -> None:
        with self._lock:
            if self._thread is None and not self._closing:
                self._thread = threading.Thread(target=self._keep_line, name=f"{self.run}-wire", daemon=True)
                self._thread.start()
        self._wake()

    def _wake(self) -> None:
        if self._wake_write >= 0:
            with suppress(OSError):
                os.write(self._wake_write, b".")

    def _keep_line(self) -> None:
        pause_s = self.options.pause_s
        while not self._closing:
            try:
                connection = Connection(self._dial())
            except WireError as error:
                self._why = str(error)
                self._rest(pause_s)
                pause_s = min(2 * pause_s, self.options.longest_pause_s)
                continue
            pause_s = self.options.pause_s
            try:
                self._talk(connection)
            except WireError as error:
                self._lost(str(error))
                self._rest(pause_s)
            finally:
                with self._told:
                    self._greeted, self._connection = False, None
                connection.close()

    def _rest(self, pause_s: float) -> None:
        with self._told:
            self._told.wait_for(lambda: self._closing, pause_s)

    def _lost(self, why: str) -> None:
        with self._told:
            self._connection, self._why = None, why
            self._breaks += self._greeted
            if self._greeted and not self._closing:
                self._complain("link", f"the line to {self.where} was lost: {why}")
            self._greeted = False
            self._told.notify_all()

    def _talk(self, connection: Connection) -> None:
        with self._lock:
            self._connection = connection
            self._hello_said = self._beat_said = self._since_said = -1e9
            for entry in self._open.values():
                entry.said = entry.said and -1e9
        begun = time.monotonic()
        with selectors.DefaultSelector() as selector:
            selector.register(self._wake_read, selectors.EVENT_READ)
            selector.register(connection.line, selectors.EVENT_READ)
            while True:
                now = time.monotonic()
                with self._lock:
                    if self._closing:
                        connection.write()
                        return
                    self._say_what_is_due(connection, now)
                connection.write()
                writing = selectors.EVENT_WRITE if connection.wants_to_write else 0
                selector.modify(connection.line, selectors.EVENT_READ | writing)
                selector.select(0.02)
                with suppress(OSError):
                    os.read(self._wake_read, 4096)
                for message in connection.read():
                    with self._told:
                        self._word = time.monotonic()
                        self._hear(message)
                        self._told.notify_all()
                if time.monotonic() - max(begun, self._word or 0.0) > self.options.dead_s:
                    raise WireError(f"no word for {self.options.dead_s:g} s")

    def _say_what_is_due(self, connection: Connection, now: float) -> None:
        retry = self._retry_s
        if self._stop_wanted and now - self._stop_said >= min(retry, 0.25):
            self._stop_said = now
            connection.put({"m": "stop"}, urgent=True)
        if not self._greeted:
            if now - self._hello_said >= retry:
                self._hello_said = now
                hello = {"m": "hello", "protocol": PROTOCOL, "run": self.run, "have": self._heard}
                connection.put(hello)
            return
        if now - self._beat_said >= self.options.beat_s:
            self._beat_said = now
            connection.put({"m": "beat", "t": self.times.begin(now), "plan_t": self._plan_ms})
        if self._committed > self._commit_said:
            self._commit_said = self._committed
            connection.put({"m": "commit", "number": self._committed})
        if self._last > self._heard and now - self._since_said >= retry:
            self._since_said = now
            connection.put({"m": "since", "number": self._heard})
        self._say_commands(connection, now, retry)
        if self._downloads is not None and not connection.backlog:
            request = self._downloads.request(now, retry)
            if request is not None:
                connection.put(request)

    def _say_commands(self, connection: Connection, now: float, retry: float) -> None:
        boot = self.welcome.boot if self.welcome is not None else 0
        for command, entry in self._open.items():
            if entry.abort_said is not None:
                if now - entry.abort_said >= retry:
                    entry.abort_said = now
                    connection.put(about("abort", command))
            elif (
                entry.state == "sent"
                and (entry.said == 0.0 or now - entry.said >= retry)
                and not self._is_forgotten(entry)
            ):
                entry.said = now
                entry.boot = boot if entry.boot is None else entry.boot
                connection.put(entry.message)

    # --- what comes -------------------------------------------------------------------------

    def _hear(self, message: Json) -> None:
        """Take in a message; one that makes no sense is noted and dropped."""
        try:
            self._take(message)
        except WireError as error:
            self._complain("wire", f"dropped: {error}")

    def _take(self, message: Json) -> None:
        match message.get("m"):
            case "welcome":
                self._take_welcome(message)
            case "event":
                self._take_event(mapping(message, "event"))
            case "command":
                entry = self._open.get(command_id(message))
                state = text(message, "state")
                if entry is not None and state in ("accepted", "running"):
                    entry.state = state
                elif state == "done":  # its answer is in the stream
                    self._open.pop(command_id(message), None)
            case "beat":
                self.times.end(whole(message, "echo"), whole(message, "t"), time.monotonic())
                self._last = max(self._last, whole(message, "last"))
            case "status" | "state" | "fault":
                self._take_answer(message)
            case "chunk":
                if self._downloads is not None:
                    self._downloads.take(message)
            case "stopped":
                self._stop_wanted = False
            case "bye":
                self._refused = str(message.get("reason", ""))[:200]
                self._complain("link", f"{self.where} ends the line: {self._refused}")
                if message.get("final") is True:
                    self._closing = True
                self._why = f"the rover ended the line: {self._refused}"
            case other:
                self._complain("wire", f"a message of kind {str(other)[:40]!a}, which is not known")

    def _take_answer(self, message: Json) -> None:
        number = message.get("q")
        if isinstance(number, int) and number in self._replies:
            self._replies[number] = message
        elif message.get("m") == "status" and "q" not in message:
            self._settle_forgotten(command_id(message), status_of(message))

    def _take_welcome(self, message: Json) -> None:
        if message.get("protocol") != PROTOCOL:
            raise WireError(f"the rover speaks {str(message.get('protocol'))[:40]!a}, not {PROTOCOL}")
        if message.get("run") != self.run:
            return  # of an earlier hello
        rate = message.get("rate", 1.0)
        if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0 < rate <= 1e6:
            raise WireError(f"welcome: rate is {str(rate)[:40]!a}, no number above 0")
        boot, first, last = (whole(message, name) for name in ("boot", "first", "last"))
        before = self.welcome
        self.welcome = Welcome(
            str(message.get("rover", ""))[:100],
            boot,
            float(rate),
            mapping(message, "dictionary"),
            message.get("faults") is True,
        )
        self.times.rate = float(rate)
        self.times.show(whole(message, "t"), time.monotonic())
        self._refused = ""
        greeted, self._greeted = self._greeted, True
        self._last = max(last, self._heard)
        restarted = 0 < self._heard <= boot and (before is None or before.boot != boot)
        if restarted:
            self._complain("link", f"the rover has restarted (its word goes on behind {boot})")
            for command in self._open:
                if self._connection is not None:
                    self._connection.put(about("status", command))
        elif self._heard and first > self._heard + 1:
            self._complain("link", f"the rover no longer keeps {self._heard + 1} to {first - 1} of its word")
        if first > self._heard + 1:
            self._heard = first - 1
            self._ahead = {n: e for n, e in self._ahead.items() if n > self._heard}
            self._deliver_ahead()
        if not greeted and self._breaks:
            self._complain("link", f"the line to {self.where} is back")

    def _settle_forgotten(self, command: CommandId, status: CommandStatus) -> None:
        """What a rover that restarted knows nothing of has failed: it may have been begun before."""
        entry = self._open.get(command)
        if entry is not None and status.state is CommandState.UNKNOWN and self._is_forgotten(entry):
            self._deliver(Result(0, command, False, RESTARTED))

    def _take_event(self, document: Json) -> None:
        number = whole({"number": 0, "e": "event", **document}, "number")
        event: Event | None = None
        try:
            event = event_of(document)
        except WireError as error:
            self._complain("garbage", f"event {number} is malformed and was dropped: {error}")
        if number == 0:
            if event is not None:
                self._deliver(event)
            return
        self._last = max(self._last, number)
        if number > self._heard and len(self._ahead) < AHEAD:
            self._ahead[number] = event
        self._deliver_ahead()

    def _deliver_ahead(self) -> None:
        while self._heard + 1 in self._ahead:
            self._heard += 1
            event = self._ahead.pop(self._heard)
            if event is not None:
                self._deliver(event)

    def _deliver(self, event: Event) -> None:
        event = numbered(event)
        if isinstance(event, Result | Acknowledgement):
            self._open.pop(event.command, None)
        elif isinstance(event, Product) and self._downloads is not None:
            self._downloads.want(event)
        self._events.append(event)

    def _call_off(self, command: CommandId) -> None:
        """A command that never left need not be stopped."""
        del self._open[command]
        self._events.append(Acknowledgement(0, command))
        self._told.notify_all()

    def _complain(self, kind: str, said: str) -> None:
        """Tell a sentence once; a rover that floods with garbage must not flood the journal."""
        if len(self._complained) > 1000 or (kind in ("wire", "garbage") and said in self._complained):
            return
        self._complained.add(said)
        self._complaint(kind, said)
