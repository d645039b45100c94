"""A rover that does what a script says: the world of a scenario, and a stand-in where no rover is at hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from executive.engine.agenda import Queue
from executive.ports import (
    Acknowledgement,
    Command,
    CommandId,
    CommandState,
    CommandStatus,
    Event,
    Result,
    Update,
    Value,
)


@dataclass(frozen=True, slots=True)
class Behaviour:
    """What an action does: when it returns (None = never), with what, and what happens meanwhile."""

    duration_ms: int | None = 1000
    success: bool = True
    updates: Mapping[str, Value] = field(default_factory=dict)
    abort_delay_ms: int = 0
    during: tuple[tuple[int, Mapping[str, Value]], ...] = ()
    values: Mapping[str, Value] = field(default_factory=dict)


_Entry = tuple[int, int, int, Event, CommandId | None]
"""Time, rank at equal times, serial number, event, and the command it belongs to."""


class ScriptedRover:
    """A rover that does what a script says, on a virtual clock that it advances itself.

    Parameters
    ----------
    initial
        State values at t = 0.
    actions
        Behaviours by task id, one for each command of a copy of the task (the last one repeats); `*` for all
        other tasks.
    script
        Events in file order; at equal stamps they come before what actions report.
    """

    def __init__(
        self,
        initial: Mapping[str, Value] | None = None,
        actions: Mapping[str, Sequence[Behaviour]] | None = None,
        script: Sequence[Event] = (),
    ) -> None:
        self.actions = dict(actions or {})
        self.t_ms = 0
        self.sent: list[Command] = []
        self.aborted: list[CommandId] = []
        self._queue: Queue[_Entry] = Queue()
        self._serial = 0
        self._order: dict[CommandId, int] = {}
        """Commands by their number among all that came."""
        self._running: dict[CommandId, Behaviour] = {}
        self._answers: dict[CommandId, Result | Acknowledgement] = {}
        if initial:
            self._push(0, -1, Update(0, dict(initial)))
        for event in script:
            self._push(event.t_ms, 0, event)

    def _push(self, t_ms: int, rank: int, event: Event, command: CommandId | None = None) -> None:
        self._serial += 1
        self._queue.push((t_ms, rank, self._serial, event, command))

    def behaviour_of(self, command: Command) -> Behaviour:
        """Return how this command will go."""
        script = self.actions.get(command.id.task) or self.actions.get("*") or (Behaviour(),)
        return script[min(command.issue, len(script)) - 1]

    def send(self, command: Command) -> None:
        if command.id in self._order:
            return
        self.sent.append(command)
        behaviour = self.behaviour_of(command)
        rank = self._order[command.id] = len(self._order) + 1
        self._running[command.id] = behaviour
        for offset, values in behaviour.during:
            if behaviour.duration_ms is None or offset <= behaviour.duration_ms:
                at = self.t_ms + offset
                self._push(at, rank, Update(at, values), command.id)
        if behaviour.duration_ms is not None:
            at = self.t_ms + behaviour.duration_ms
            result = Result(at, command.id, behaviour.success, "", behaviour.values, behaviour.updates)
            self._push(at, rank, result, command.id)

    def abort(self, command: CommandId) -> None:
        behaviour = self._running.pop(command, None)
        if behaviour is None:
            return
        self.aborted.append(command)
        at = self.t_ms + behaviour.abort_delay_ms
        if behaviour.duration_ms is not None or behaviour.during:
            self._call_off(command, at)
        self._push(at, self._order[command], Acknowledgement(at, command), command)

    def _call_off(self, command: CommandId, at: int) -> None:
        """Take back what a stopped action would still have reported after its acknowledgement."""
        for entry in sorted(self._queue.clear()):
            t_ms, rank, serial, event, of = entry
            if of == command:
                if isinstance(event, Result):
                    if t_ms >= self.t_ms or not event.updates:
                        continue
                    entry = (t_ms, rank, serial, Update(t_ms, event.updates), of)
                elif t_ms > at:
                    continue
            self._queue.push(entry)

    def status(self, command: CommandId) -> CommandStatus:
        if command not in self._order:
            return CommandStatus(CommandState.UNKNOWN)
        answer = self._answers.get(command)
        return CommandStatus(CommandState.DONE if answer else CommandState.RUNNING, answer)

    def next_event(self, until_ms: int | None) -> Event | None:
        entry = self._queue.take() if until_ms is None else self._queue.take_until(until_ms)
        if entry is None:
            if until_ms is not None and until_ms > self.t_ms:
                self.t_ms = until_ms
            return None
        t_ms, _, _, event, _ = entry
        if t_ms > self.t_ms:
            self.t_ms = t_ms
        if isinstance(event, (Result, Acknowledgement)):
            self._running.pop(event.command, None)
            self._answers[event.command] = event
        return event

    def wait_until(self, t_ms: int) -> None:
        """Let time go by; what happens meanwhile is kept for the executive."""
        self.t_ms = max(self.t_ms, t_ms)
