"""What becomes of one command: a state machine for each way in which an action goes to ROS 2.

A job hears words, is looked at every few milliseconds, and ends once: with a `Result`, or with an
`Acknowledgement` if it was called off. Times of the line are of the machine's monotonic clock, in seconds;
times of what the rover does (`limit_s`, timers) are of the rover's clock, in milliseconds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from executive.crl.dictionary import ActionSpec, ValueSpec
from executive.ports import Command, CommandId, Value
from rover_iface.ros2.field_paths import AbsentError, read_field
from rover_iface.ros2.goals import Filling
from rover_iface.ros2.mapping import ActionCall, ImageCall, Reading, ServiceCall
from rover_iface.ros2.outcomes import Outcome
from rover_iface.ros2.pictures import picture_of
from rover_iface.ros2.port import (
    Answered,
    Broken,
    CancelRefused,
    Ear,
    Ended,
    Fed,
    GoalStatus,
    Judged,
    RosPort,
    Word,
)
from rover_iface.ros2.readings import Reader, plain_value

STILL_GOING = frozenset({Outcome.UNANSWERED, Outcome.BROKEN})
"""Ends of a job after which the robot may still follow the goal: an abort is not acknowledged with them."""
LOOK_S = 0.25
"""How often it is looked up who serves a name."""


@dataclass(frozen=True, slots=True)
class Over:
    """How a job ended; `acknowledged`: it was called off, and there is no result."""

    success: bool = False
    reason: str = ""
    values: Mapping[str, Value] | None = None
    acknowledged: bool = False


class Desk(Protocol):
    """What a job needs of the rover that it belongs to."""

    port: RosPort
    reader: Reader

    def now_s(self) -> float:
        """Return the monotonic clock of the machine."""

    def rover_ms(self) -> int:
        """Return the rover's clock."""

    def note(self, text: str) -> None:
        """Log a sentence, the same one not over and over."""

    def tell(self, values: Mapping[str, Value]) -> None:
        """Tell values of telemetry keys."""

    def key_spec(self, key: str) -> ValueSpec | None: ...

    def orphan(self, call: ActionCall, goal: bytes) -> None:
        """Cancel a goal whenever it is heard of: it may run, and no command stands for it any more."""

    def keep(
        self, command: CommandId, kind: str, suffix: str, data: bytes, label: Mapping[str, Value]
    ) -> None:
        """Write a data product and tell of it."""


class Job(Protocol):
    """One command on its way. Each method returns how it ended, or None while it goes on."""

    def look(self) -> Over | None: ...

    def hear(self, word: Word) -> Over | None: ...

    def abort(self) -> Over | None: ...


class GoalJob:
    """A goal of a ROS action."""

    def __init__(
        self, desk: Desk, call: ActionCall, spec: ActionSpec, goal: bytes, fields: Mapping[str, Filling]
    ) -> None:
        self._desk, self._spec, self._fields = desk, spec, fields
        self.call = self._call = call
        self.goal = goal
        self._server = f"the action server {call.name} ({call.type})"
        self._begun = self._looked = desk.now_s()
        self._servers: frozenset[str] = frozenset()
        self._sent: float | None = None
        self._accepted_ms: int | None = None
        self._seen = self._begun
        """When its server was last there."""
        self._over_since: float | None = None
        """When the server first said that the goal is over, while no result has come."""
        self._cancel_said: float | None = None
        self._aborted = self._overdue = False
        self._fed = 0.0

    def look(self) -> Over | None:
        if self._sent is None:
            return self._begin()
        now = self._desk.now_s()
        if self._accepted_ms is None:
            if now - self._sent < self._call.accept_s:
                self._hurry(now)
                return None
            self._desk.orphan(self._call, self.goal)
            why = f"{self._server} neither accepted nor rejected the goal within {self._call.accept_s:g} s"
            return self._end(Outcome.UNANSWERED, why)
        self._hurry(now)
        return self._lost(now)

    def _begin(self) -> Over | None:
        now = self._desk.now_s()
        if now < self._looked:
            return None
        self._looked = now + LOOK_S
        self._servers = self._desk.port.servers(self._call)
        if not self._servers:
            if now - self._begun < self._call.server_s:
                return None
            return Over(
                reason=Outcome.ABSENT.because(
                    f"{self._server} is not there, and did not come within {self._call.server_s:g} s"
                )
            )
        self._sent = self._seen = now
        try:
            self._desk.port.send_goal(self._call, self.goal, self._fields)
        except AbsentError as err:
            return Over(reason=Outcome.MALFORMED.because(str(err)))
        return None

    def _hurry(self, now: float) -> None:
        """Cancel what was called off or takes too long, and say so again."""
        limit, accepted = self._call.limit_s, self._accepted_ms
        if limit is not None and accepted is not None:
            self._overdue |= self._desk.rover_ms() - accepted > 1000 * limit
        if not (self._aborted or self._overdue):
            return
        if self._cancel_said is None or now - self._cancel_said >= self._call.cancel_s:
            self._cancel_said = now
            self._desk.port.cancel_goal(self._call, self.goal)

    def _lost(self, now: float) -> Over | None:
        if now >= self._looked:
            self._looked = now + LOOK_S
            if self._servers & self._desk.port.servers(self._call):
                self._seen = now
        if now - self._seen >= self._call.lost_s:
            self._desk.orphan(self._call, self.goal)
            why = f"{self._server} has been away for {self._call.lost_s:g} s while the goal ran"
            return Over(reason=Outcome.LOST.because(why))
        if self._over_since is not None and now - self._over_since >= self._call.lost_s:
            why = f"{self._server} says that the goal is over, and its result did not come"
            return Over(reason=Outcome.LOST.because(f"{why} within {self._call.lost_s:g} s"))
        return None

    def hear(self, word: Word) -> Over | None:
        match word:
            case Judged(accepted=True):
                if self._accepted_ms is not None:
                    self._desk.note(f"{self._server} accepted the same goal twice")
                else:
                    self._accepted_ms = self._desk.rover_ms()
                    self._cancel_said = None  # what was said before may not have been understood
                    self._hurry(self._desk.now_s())
            case Judged():
                return self._end(Outcome.REJECTED, f"{self._server} rejected the goal")
            case Ended():
                return self._ended(word.status, word.result)
            case Fed():
                self._take_feedback(word.feedback)
            case CancelRefused(unknown=True) if self._accepted_ms is not None:
                return self._end(Outcome.LOST, f"{self._server} does not know the goal any more")
            case CancelRefused(unknown=True):
                pass  # not accepted yet: it is cancelled again when it is
            case CancelRefused():
                self._desk.note(f"{self._server} refuses to cancel a goal; it is asked again")
            case Broken():
                self._desk.orphan(self._call, self.goal)
                return self._end(Outcome.BROKEN, f"{self._server}: {word.why}")
            case _:
                pass
        return None

    def hear_status(self, status: GoalStatus | None) -> None:
        """Take in what the server says of the goal, None if it does not name it."""
        gone = status is None or status.is_over
        if self._accepted_ms is None or not gone:
            self._over_since = None
        elif self._over_since is None:
            self._over_since = self._desk.now_s()

    def _ended(self, status: GoalStatus, result: object) -> Over | None:
        told = reason_in(result, self._call.reason)
        match status:
            case GoalStatus.SUCCEEDED:
                return concluded(self._desk, self._call, self._spec, result)
            case GoalStatus.CANCELED:
                return self._end(Outcome.CANCELLED, f"somebody cancelled the goal at {self._call.name}{told}")
            case GoalStatus.ABORTED:
                return self._end(Outcome.ABORTED, f"{self._server} gave the goal up{told}")
            case GoalStatus.UNKNOWN:
                return self._end(Outcome.LOST, f"{self._server} does not know the goal any more")
        self._desk.note(f"{self._server} sent a result with the status {status.name}; it is ignored")
        return None

    def _end(self, outcome: Outcome, why: str) -> Over:
        if self._aborted and outcome not in STILL_GOING:
            return Over(acknowledged=True)
        if self._overdue:
            limit = f"it took longer than {self._call.limit_s:g} s and was cancelled"
            return Over(reason=Outcome.OVERDUE.because(limit))
        return Over(reason=outcome.because(why))

    def _take_feedback(self, feedback: object) -> None:
        now = self._desk.now_s()
        if not self._call.feedback or now - self._fed < 1 / self._call.feedback_hz:
            return
        self._fed = now
        specs = {key: spec for key in self._call.feedback if (spec := self._desk.key_spec(key)) is not None}
        values, wrong = self._desk.reader.values(feedback, self._call.feedback, specs)
        for what in wrong:
            self._desk.note(f"feedback of {self._call.name}: {what}")
        if values:
            self._desk.tell(values)

    def abort(self) -> Over | None:
        self._aborted = True
        if self._sent is None:
            return Over(acknowledged=True)
        self._hurry(self._desk.now_s())
        return None  # a goal that nobody has accepted yet is cancelled again as soon as somebody does


class RequestJob:
    """A request to a ROS service; one on its way cannot be called off."""

    def __init__(
        self, desk: Desk, call: ServiceCall, spec: ActionSpec, ticket: bytes, fields: Mapping[str, Filling]
    ) -> None:
        self._desk, self._call, self._spec, self._fields = desk, call, spec, fields
        self._ticket = ticket
        self._server = f"the service {call.name} ({call.type})"
        self._begun = self._looked = desk.now_s()
        self._sent: float | None = None

    def look(self) -> Over | None:
        now = self._desk.now_s()
        if self._sent is not None:
            if now - self._sent < self._call.answer_s:
                return None
            why = f"{self._server} gave no answer within {self._call.answer_s:g} s"
            return Over(reason=Outcome.UNANSWERED.because(why))
        if now < self._looked:
            return None
        self._looked = now + LOOK_S
        if self._desk.port.servers(self._call):
            self._sent = now
            try:
                self._desk.port.request(self._call, self._ticket, self._fields)
            except AbsentError as err:
                return Over(reason=Outcome.MALFORMED.because(str(err)))
        elif now - self._begun >= self._call.server_s:
            why = f"{self._server} is not there, and did not come within {self._call.server_s:g} s"
            return Over(reason=Outcome.ABSENT.because(why))
        return None

    def hear(self, word: Word) -> Over | None:
        if isinstance(word, Broken):
            return Over(reason=Outcome.BROKEN.because(f"{self._server}: {word.why}"))
        if isinstance(word, Answered):
            return concluded(self._desk, self._call, self._spec, word.response)
        return None

    def abort(self) -> Over | None:
        return Over(acknowledged=True) if self._sent is None else None


class ImageJob:
    """The next image on a topic, as a data product."""

    def __init__(self, desk: Desk, call: ImageCall, command: Command, spec: ActionSpec) -> None:
        self._desk, self._call, self._command, self._spec = desk, call, command, spec
        self._ear: Ear = desk.port.listen(call.name, call.type, call.qos, 1)
        self._begun = desk.now_s()

    def look(self) -> Over | None:
        images = self._ear.take()
        if images:
            return self._done(self._kept(images[-1]))
        if self._desk.now_s() - self._begun < self._call.answer_s:
            return None
        why = f"no image came on {self._call.name} within {self._call.answer_s:g} s"
        return self._done(Over(reason=Outcome.UNANSWERED.because(why)))

    def _kept(self, image: object) -> Over:
        try:
            suffix, data, label = picture_of(image)
            label = {"topic": self._call.name, **label}
            self._desk.keep(self._command.id, self._call.product, suffix, data, label)
        except AbsentError as err:
            return Over(reason=Outcome.MALFORMED.because(f"the image on {self._call.name}: {err}"))
        known = {result.name for result in self._spec.results}
        given: dict[str, Value] = {"products": 1.0, "made": True}
        return Over(success=True, values={name: v for name, v in given.items() if name in known})

    def _done(self, over: Over) -> Over:
        self._ear.close()
        return over

    def hear(self, word: Word) -> Over | None:
        del word
        return None

    def abort(self) -> Over | None:
        return self._done(Over(acknowledged=True))


class UntilJob:
    """Lasts until something holds: a timer's end, or that all else has stopped."""

    def __init__(self, holds: Callable[[], bool]) -> None:
        self._holds = holds

    def look(self) -> Over | None:
        return Over(success=True) if self._holds() else None

    def hear(self, word: Word) -> Over | None:
        del word
        return None

    def abort(self) -> Over | None:
        return Over(acknowledged=True)


def concluded(desk: Desk, call: ActionCall | ServiceCall, spec: ActionSpec, answer: object) -> Over:
    """Return what an answer means that came to its end: success, unless it says itself that it failed."""
    told = reason_in(answer, call.reason)
    try:
        good = True if call.success is None else plain_value(read_field(answer, call.success))
    except AbsentError as err:
        return Over(reason=Outcome.MALFORMED.because(f"the answer of {call.name}: {err}"))
    if good is not True:
        return Over(reason=Outcome.REFUSED.because(f"{call.name} answered {call.success} = {good}{told}"))
    specs: dict[str, ValueSpec] = {result.name: result for result in spec.results}
    readings: Mapping[str, Reading] = call.results
    values, wrong = desk.reader.values(answer, readings, specs)
    if wrong:
        return Over(reason=Outcome.MALFORMED.because(f"the answer of {call.name}: {'; '.join(wrong)}"))
    return Over(success=True, values=values)


def reason_in(answer: object, path: str | None) -> str:
    """Return what an answer says of its failure, `: text`, or nothing."""
    if path is None:
        return ""
    try:
        found = plain_value(read_field(answer, path))
    except AbsentError:
        return ""
    text = f"{found:g}" if isinstance(found, float) else str(found)
    return f": {text[:200]}" if text else ""
