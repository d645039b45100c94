"""The executive's side of `wire/1`: it greets, says what is due, and takes in what the rover says."""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from executive.errors import WireError
from executive.ports import (
    Acknowledgement,
    CommandId,
    CommandState,
    CommandStatus,
    Event,
    Product,
    Result,
)
from executive.runtime.wire.downloads import Downloads
from executive.runtime.wire.frames import Connection
from executive.runtime.wire.line import WireOptions
from executive.runtime.wire.messages import (
    PROTOCOL,
    command_id,
    event_of,
    mapping,
    numbered,
    status_of,
    text,
    whole,
)
from executive.runtime.wire.outbox import LONG_AGO, Outbox
from executive.runtime.wire.round_trips import RoundTrips
from executive.runtime.wire.stream import Stream

logger = logging.getLogger(__name__)

COMPLAINTS = 1000
"""Sentences told of one line; a rover that floods with garbage must not flood the journal."""


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


class Complaints:
    """Tells each sentence about garbage once, to whoever listens; a listener that raises ends nothing."""

    def __init__(self) -> None:
        self.tell: Callable[[str, str], None] = lambda kind, said: logger.info(
            "wire", extra={"kind": kind, "said": said}
        )
        self._told: set[str] = set()
        self._unheard: list[tuple[str, str]] | None = []
        """What was told before somebody listened; None once somebody does."""

    def listen(self, tell: Callable[[str, str], None]) -> None:
        """Tell a listener from now on, and first what it has missed."""
        self.tell = tell
        missed, self._unheard = self._unheard or [], None
        for kind, said in missed:
            self._say(kind, said)

    def __call__(self, kind: str, said: str) -> None:
        if len(self._told) > COMPLAINTS or (kind in ("wire", "garbage") and said in self._told):
            return
        self._told.add(said)
        if self._unheard is not None and len(self._unheard) < COMPLAINTS:
            self._unheard.append((kind, said))
        self._say(kind, said)

    def _say(self, kind: str, said: str) -> None:
        try:
            self.tell(kind, said)
        except Exception:
            logger.exception("a complaint was not heard", extra={"kind": kind, "said": said})


class Conversation:
    """What is known of the rover and of the way to it, over all lines of one run.

    Everything here belongs to whoever holds the lock of the line (`Line.told`).
    """

    def __init__(
        self,
        run: str,
        where: str,
        options: WireOptions,
        complain: Complaints,
        downloads: Downloads | None,
    ) -> None:
        self.run, self.where, self.options = run, where, options
        self.outbox, self.stream = Outbox(), Stream()
        self.times = RoundTrips(complain)
        self.events: deque[Event] = deque()
        """What the rover said and nobody has taken yet."""
        self.replies: dict[int, dict[str, object] | None] = {}
        """Answers to questions that are open, by their number."""
        self.welcome: Welcome | None = None
        self.greeted = False
        self.breaks = 0
        self.refused = ""
        self.final = False
        """The rover said that this end must not come back."""
        self.plan_ms: int | None = None
        self._complain, self._downloads = complain, downloads
        self._commit_said = 0
        self._since_said = self._beat_said = self._hello_said = LONG_AGO

    @property
    def retry_s(self) -> float:
        return max(self.options.retry_s, 2 * (self.times.round_trip_s or 0.0))

    # --- what is said -------------------------------------------------------------------------

    def begin(self) -> None:
        self._hello_said = self._beat_said = self._since_said = LONG_AGO
        self.outbox.begin()

    def end(self, why: str) -> None:
        if self.greeted and why:
            self.breaks += 1
            self._complain("link", f"the line to {self.where} was lost: {why}")
        self.greeted = False

    def say(self, connection: Connection, now: float) -> None:
        """Send what is due at `now` (monotonic, s): greeting, beat, receipts, commands."""
        retry = self.retry_s
        if self.outbox.stop_due(now, retry):
            connection.put({"m": "stop"}, urgent=True)
        if not self.greeted:
            if now - self._hello_said >= retry:
                self._hello_said = now
                have = self.stream.heard
                connection.put({"m": "hello", "protocol": PROTOCOL, "run": self.run, "have": have})
            return
        if now - self._beat_said >= self.options.beat_s:
            self._beat_said = now
            connection.put({"m": "beat", "t": self.times.begin(now), "plan_t": self.plan_ms})
        if self.stream.committed > self._commit_said:
            self._commit_said = self.stream.committed
            connection.put({"m": "commit", "number": self.stream.committed})
        if not self.stream.whole and now - self._since_said >= retry:
            self._since_said = now
            connection.put({"m": "since", "number": self.stream.heard})
        for message in self.outbox.due(now, retry):
            connection.put(message)
        if self._downloads is not None and not connection.backlog:
            request = self._downloads.request(now, retry)
            if request is not None:
                connection.put(request)

    # --- what is heard ------------------------------------------------------------------------

    def hear(self, message: dict[str, object]) -> None:
        """Take in a message; one that makes no sense is noted and dropped."""
        try:
            self._take(message)
        except WireError as error:
            self._complain("wire", f"dropped: {error}")

    def _take(self, message: dict[str, object]) -> None:
        match message.get("m"):
            case "welcome":
                self._take_welcome(message)
            case "event":
                self._take_event(mapping(message, "event"))
            case "command":
                self.outbox.note(command_id(message), text(message, "state"))
            case "beat":
                self.times.end(whole(message, "echo"), whole(message, "t"), time.monotonic())
                self.stream.last = max(self.stream.last, whole(message, "last"))
            case "status" | "state" | "fault":
                self._take_answer(message)
            case "chunk":
                if self._downloads is not None:
                    self._downloads.take(message)
            case "stopped":
                self.outbox.stopping = False
            case "bye":
                self.refused = str(message.get("reason", ""))[:200]
                self._complain("link", f"{self.where} ends the line: {self.refused}")
                self.final = message.get("final") is True
            case other:
                self._complain("wire", f"a message of kind {str(other)[:40]!a}, which is not known")

    def _take_answer(self, message: dict[str, object]) -> None:
        number = message.get("q")
        if isinstance(number, int) and number in self.replies:
            self.replies[number] = message
        elif message.get("m") == "status" and "q" not in message:
            self._settle_forgotten(command_id(message), status_of(message))

    def _take_welcome(self, message: dict[str, object]) -> None:
        if message.get("protocol") != PROTOCOL:
            raise WireError(f"the rover speaks {str(message.get('protocol'))[:40]!a}, not {PROTOCOL}")
        if message.get("run") != self.run:
            return  # of an earlier hello
        welcome = _welcome_of(message)
        first, last, shown_ms = (whole(message, name) for name in ("first", "last", "t"))
        before, self.welcome = self.welcome, welcome
        self.outbox.boot = welcome.boot
        self.times.rate = welcome.rate
        self.times.show(shown_ms, time.monotonic())
        self.refused = ""
        greeted, self.greeted = self.greeted, True
        heard = self.stream.heard
        self.stream.last = max(last, heard)
        another_life = before.boot != welcome.boot if before is not None else heard > 0
        if another_life and heard <= welcome.boot:
            self._complain("link", f"the rover has restarted (its word goes on behind {welcome.boot})")
            self.outbox.ask_about_all()
        elif heard and first > heard + 1:
            self._complain("link", f"the rover no longer keeps {heard + 1} to {first - 1} of its word")
        self._deliver(self.stream.skip_to(first))
        if not greeted and self.breaks:
            self._complain("link", f"the line to {self.where} is back")

    def _settle_forgotten(self, command: CommandId, status: CommandStatus) -> None:
        """What a rover that restarted knows nothing of has failed: it may have been begun before."""
        ended = self.outbox.forgotten(command)
        if ended is not None and status.state is CommandState.UNKNOWN:
            self._deliver([ended])

    def _take_event(self, document: dict[str, object]) -> None:
        number = whole({"number": 0, "e": "event", **document}, "number")
        event: Event | None = None
        try:
            event = event_of(document)
        except WireError as error:
            self._complain("garbage", f"event {number} is malformed and was dropped: {error}")
        if number:
            self._deliver(self.stream.take(number, event))
        elif event is not None:
            self._deliver([event])

    def _deliver(self, events: list[Event]) -> None:
        for one in events:
            event = numbered(one)
            if isinstance(event, Result | Acknowledgement):
                self.outbox.close(event.command)
            elif isinstance(event, Product) and self._downloads is not None:
                self._downloads.want(event)
            self.events.append(event)


def _welcome_of(message: dict[str, object]) -> Welcome:
    rate = message.get("rate", 1.0)
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0 < rate <= 1e6:
        raise WireError(f"welcome: rate is {str(rate)[:40]!a}, no number above 0")
    return Welcome(
        str(message.get("rover", ""))[:100],
        whole(message, "boot"),
        float(rate),
        mapping(message, "dictionary"),
        message.get("faults") is True,
    )
