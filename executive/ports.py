"""Ports of the executive: what it asks of a rover, a clock and its listeners.

Times are integers, milliseconds on the plan clock (0 = start of the plan), the resolution of CRL.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple, NoReturn, Protocol, runtime_checkable

Value = float | str | bool
"""What the database of the executive holds under a key."""


class CommandId(NamedTuple):
    """Identity of one command: a rover carries out each at most once."""

    run: str
    task: str
    attempt: int

    def __str__(self) -> str:
        return f"{self.run}/{self.task}/{self.attempt}"


class _Nothing(dict[str, Value]):
    """No values, for good: what commands and events without any share. Unlike a mapping proxy, it pickles."""

    def _refuse(self, *_values: object, **_named: object) -> NoReturn:
        raise TypeError("the values of a command or event cannot be written to; make them with it")

    __setitem__ = __ior__ = setdefault = update = _refuse


NOTHING: Mapping[str, Value] = _Nothing()


class Command(NamedTuple):
    """One action sent to the rover; `metadata` is that of the CRL task (observation, target, ...).

    `issue` counts the commands of this copy of the task from 1: a task that is inserted again goes on with
    its attempts (a rover must never see one twice) and begins again with its issues.
    """

    id: CommandId
    action: str
    parameters: Mapping[str, Value]
    metadata: Mapping[str, Value] = NOTHING
    issue: int = 1


class Update(NamedTuple):
    """State values reported by the rover; the last value of a key wins."""

    t_ms: int
    values: Mapping[str, Value]
    number: int = 0


class Result(NamedTuple):
    """An action has returned: `values` are its return values, `updates` state values that came with it."""

    t_ms: int
    command: CommandId
    success: bool
    reason: str = ""
    values: Mapping[str, Value] = NOTHING
    updates: Mapping[str, Value] = NOTHING
    number: int = 0


class Acknowledgement(NamedTuple):
    """An abort has taken effect: the action is over and will return no result."""

    t_ms: int
    command: CommandId
    updates: Mapping[str, Value] = NOTHING
    number: int = 0


class Product(NamedTuple):
    """A data product was written: `path` is relative to the run's folder, `label` describes it."""

    t_ms: int
    command: CommandId
    kind: str
    path: str
    sha256: str
    label: Mapping[str, Value] = NOTHING
    number: int = 0


class Operation(StrEnum):
    """What an operator may ask of a running plan (CRL.md 7.2)."""

    PAUSE = "pause"
    RESUME = "resume"
    ABORT = "abort"
    REPLACE = "replace"


class Operator(NamedTuple):
    """An operator command; `plan_text` is the new plan of a replacement."""

    t_ms: int
    operation: Operation
    plan_text: str | None = None


Event = Update | Result | Acknowledgement | Product | Operator


class CommandState(StrEnum):
    UNKNOWN = "unknown"
    RUNNING = "running"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class CommandStatus:
    """Answer of a rover to `status`: unknown, running, or done with its result or acknowledgement."""

    state: CommandState
    result: Result | Acknowledgement | None = None


class CommandPort(Protocol):
    """The way to the rover. A repeat of a command id is ignored by the rover."""

    def send(self, command: Command) -> None: ...

    def abort(self, command: CommandId) -> None:
        """Ask the rover to stop an action; an `Acknowledgement` follows, or its `Result` if it was faster."""

    def status(self, command: CommandId) -> CommandStatus: ...


class EventSource(Protocol):
    """The way back. A simulated rover advances the virtual clock by it."""

    def next_event(self, until_ms: int | None) -> Event | None:
        """Return the next event with `t_ms <= until_ms`, in order of time, or None when there is none.

        `until_ms=None` means: whenever it comes; None is then returned only if no event can come any more.
        A command sent at time t yields its first event at t or later.
        """


class Rover(CommandPort, EventSource, Protocol):
    """Both ways. The first events are updates at t = 0 that hold the initial state."""


@runtime_checkable
class Receipts(Protocol):
    """A rover that numbers what it says, from 1, and keeps it until it is told that it is durable.

    Events of its stream carry their number and come in its order (0 = not of the stream).
    """

    def commit(self, number: int) -> None:
        """Everything up to this number is durable with the executive and need not be kept."""

    def since(self, number: int) -> Sequence[Event]:
        """Return what was said after this number, in order, with the times at which it was said."""

    def present_state(self) -> Mapping[str, Value]:
        """Return all state values as they are now."""


@dataclass(frozen=True, slots=True)
class LinkState:
    """How the line to a rover stands; times in seconds of the wall clock.

    Attributes
    ----------
    up
        There is a line, and the rover has spoken on it.
    age_s
        Since the rover's last word; None if it never spoke.
    round_trip_s, offset_s
        Of the quickest of the last answers; the offset is the rover's clock minus that of the plan. None
        before the first answer.
    breaks
        How often the line was lost.
    commands
        Open commands and where they stand: sent, accepted or running.
    stopping
        A stop was asked for that the rover has not confirmed.
    """

    up: bool
    age_s: float | None
    round_trip_s: float | None
    offset_s: float | None
    breaks: int
    commands: tuple[tuple[CommandId, str], ...] = ()
    stopping: bool = False


@runtime_checkable
class Link(Protocol):
    """A port that reaches its rover over a line that may be away."""

    def attach(self, clock: Clock, complain: Callable[[str, str], None]) -> None:
        """Hear of the plan clock, and whom to tell (kind, sentence) what belongs into the journal."""

    def link(self) -> LinkState: ...

    def stop(self) -> None:
        """Let the rover stop everything at once; never blocks, may be called from any thread."""


class Clock(Protocol):
    def now_ms(self) -> int: ...


class TraceRecord(NamedTuple):
    """One event of the trace (CRL.md 10): `[t, event, id, ...]`."""

    t_ms: int
    event: str
    arguments: tuple[str, ...] = ()


class TraceListener(Protocol):
    def __call__(self, record: TraceRecord, /) -> None: ...


class UtilitySource(Protocol):
    """Utility of an option from the present state, or None: then the table in the plan holds."""

    def __call__(self, option: str, t_ms: int, database: Mapping[str, Value], /) -> float | None: ...
