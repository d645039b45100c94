"""A robot that speaks ROS 2 behind the ports of the executive; one thread owns it."""

from __future__ import annotations

import hashlib
import json
import logging
import math
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path

from executive.crl.dictionary import ActionSpec, ValueSpec
from executive.ports import (
    Acknowledgement,
    Clock,
    Command,
    CommandId,
    CommandState,
    CommandStatus,
    Event,
    Product,
    Result,
    Update,
    Value,
)
from rover_iface.ros2.consistency import key_spec
from rover_iface.ros2.field_paths import AbsentError
from rover_iface.ros2.goals import filled
from rover_iface.ros2.jobs import GoalJob, ImageJob, Job, Over, RequestJob, UntilJob
from rover_iface.ros2.load import Mapped
from rover_iface.ros2.mapping import ActionCall, ImageCall, ServiceCall, TimerCall
from rover_iface.ros2.outcomes import Outcome
from rover_iface.ros2.port import Answered, Broken, CancelRefused, Ended, Fed, Judged, RosPort, Statuses, Word
from rover_iface.ros2.readings import Reader, held_to
from rover_iface.ros2.senses import Senses

logger = logging.getLogger(__name__)

SAFEMODE = "safemode"
MARK = b"ocrp"
"""Goals of this program begin with it, so that one left behind is known as its own."""
MOST_NOTES = 1000
"""Sentences that are logged, each once; a robot that floods must not flood its log."""


class RosRover:
    """Sends commands as goals and requests, tells what topics tell.

    Parameters
    ----------
    port
        The way to ROS 2.
    clock
        The rover's clock, milliseconds.
    out
        Folder into which products are written, below `products/`.
    now_s
        The machine's monotonic clock, seconds.
    """

    def __init__(
        self,
        mapped: Mapped,
        port: RosPort,
        clock: Clock,
        *,
        out: Path,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.mapping, self.language, self.port = mapped.mapping, mapped.language, port
        self._clock, self._out, self.now_s = clock, out, now_s
        self.reader = Reader(self.mapping.site)
        self._senses = Senses(self)
        self.notes: dict[str, int] = {}
        """Sentences about what was not as it should be, and how often."""
        self._events: deque[Event] = deque()
        self._state: dict[str, Value] = {}
        self._jobs: dict[CommandId, Job] = {}
        self._goals: dict[bytes, CommandId] = {}
        self._done: dict[CommandId, Result | Acknowledgement] = {}
        self._past: dict[bytes, None] = {}
        self._orphans: dict[bytes, ActionCall] = {}
        self._products = 0
        start = {key: held_to(s, v) for key, v in self.mapping.start.items() if (s := self.key_spec(key))}
        self._events.append(Update(0, start))
        self._state |= start

    # --- the ports of the executive -------------------------------------------------------

    def send(self, command: Command) -> None:
        if command.id in self._jobs or command.id in self._done:
            return
        try:
            job = self._job(command)
        except AbsentError as err:
            self._end(command.id, Over(reason=Outcome.MALFORMED.because(str(err))))
            return
        if job is None:
            known = ", ".join(self.mapping.actions) or "none"
            why = f"the mapping {self.mapping.name} has no action {command.action!r}; it has {known}"
            self._end(command.id, Over(reason=Outcome.UNMAPPED.because(why)))
            return
        self._jobs[command.id] = job
        self._settle(command.id, job.look())

    def abort(self, command: CommandId) -> None:
        job = self._jobs.get(command)
        if job is not None:
            self._settle(command, job.abort())

    def status(self, command: CommandId) -> CommandStatus:
        if command in self._jobs:
            return CommandStatus(CommandState.RUNNING)
        done = self._done.get(command)
        return CommandStatus(CommandState.UNKNOWN if done is None else CommandState.DONE, done)

    def next_event(self, until_ms: int | None) -> Event | None:
        del until_ms  # what it has to say is of now
        if not self._events:
            self._turn()
        return self._events.popleft() if self._events else None

    # --- what jobs need -------------------------------------------------------------------

    def rover_ms(self) -> int:
        """Return the rover's clock."""
        return self._clock.now_ms()

    def note(self, text: str) -> None:
        """Log a sentence, each once."""
        if text in self.notes:
            self.notes[text] += 1
        elif len(self.notes) < MOST_NOTES:
            self.notes[text] = 1
            logger.warning(text)

    def tell(self, values: Mapping[str, Value]) -> None:
        """Tell what has changed of the values of telemetry keys."""
        new = {key: value for key, value in values.items() if self._state.get(key) != value}
        if new:
            self._state |= new
            self._events.append(Update(self.rover_ms(), new))

    def key_spec(self, key: str) -> ValueSpec | None:
        """Return what the dictionary says of a telemetry key."""
        return key_spec(self.language, key)

    def orphan(self, call: ActionCall, goal: bytes) -> None:
        """Cancel a goal now, and whenever it is heard of again."""
        self._orphans[goal] = call
        self.port.cancel_goal(call, goal)

    def keep(
        self, command: CommandId, kind: str, suffix: str, data: bytes, label: Mapping[str, Value]
    ) -> None:
        """Write a data product with its label beside it, and tell of it.

        Raises
        ------
        AbsentError
            If the disk does not take it.
        """
        self._products += 1
        digest = hashlib.sha256(data).hexdigest()
        path = f"products/{self.rover_ms():010d}-{self._products:04d}-{digest[:8]}{suffix}"
        try:
            (self._out / "products").mkdir(parents=True, exist_ok=True)
            (self._out / path).write_bytes(data)
            (self._out / f"{path}.json").write_text(json.dumps(dict(label)) + "\n", encoding="utf-8")
        except OSError as err:
            raise AbsentError(f"{path} cannot be written: {err.strerror or err}") from err
        self._events.append(Product(self.rover_ms(), command, kind, path, digest, label))

    # --- its turn -------------------------------------------------------------------------

    def _turn(self) -> None:
        for word in self.port.words():
            self._hear(word)
        for command, job in list(self._jobs.items()):
            try:
                self._settle(command, job.look())
            except AbsentError as err:
                self._settle(command, Over(reason=Outcome.MALFORMED.because(str(err))))
        self._senses.look()

    def _hear(self, word: Word) -> None:
        if isinstance(word, Statuses):
            self._hear_statuses(word)
            return
        goal = word.ticket if isinstance(word, Answered) else word.goal
        command = self._goals.get(goal)
        job = self._jobs.get(command) if command is not None else None
        if command is not None and job is not None:
            self._settle(command, job.hear(word))
        elif goal in self._orphans and isinstance(word, Judged) and word.accepted:
            self.note("a goal was accepted that was given up before; it is cancelled")
            self.port.cancel_goal(self._orphans[goal], goal)
        elif goal in self._orphans and isinstance(word, Ended):
            del self._orphans[goal]
        elif not isinstance(word, Fed | CancelRefused | Broken):
            what = "an answer came again to" if goal in self._past else "an answer came to"
            whom = "a goal that is over" if goal in self._past else "a goal that nobody sent"
            self.note(f"{what} {whom} ({type(word).__name__}, {goal.hex()}); it is ignored")

    def _hear_statuses(self, word: Statuses) -> None:
        ours = self._goal_id(CommandId("", "", 0))[:8]
        for goal, command in self._goals.items():
            job = self._jobs.get(command)
            if isinstance(job, GoalJob) and job.call.name == word.call:
                job.hear_status(word.goals.get(goal))
        for goal, status in word.goals.items():
            call = self._orphans.get(goal)
            if goal[:8] == ours and goal not in self._goals and status.goes_on:
                call = call or self._call_named(word.call)
                self.note(f"a goal at {word.call} is left over from before ({goal.hex()}); it is cancelled")
            if call is not None and status.goes_on:
                self._orphans[goal] = call
                self.port.cancel_goal(call, goal)

    def _call_named(self, name: str) -> ActionCall | None:
        calls = (c for c in self.mapping.actions.values() if isinstance(c, ActionCall))
        return next((call for call in calls if call.name == name), None)

    def _job(self, command: Command) -> Job | None:
        call = self.mapping.actions.get(command.action)
        spec = self.language.commands.actions.get(command.action)
        if call is None and command.action == SAFEMODE:
            for other in list(self._jobs):
                self.abort(other)
            return UntilJob(lambda: not any(other != command.id for other in self._jobs))
        if call is None or spec is None:
            return None
        goal = self._goal_id(command.id)
        match call:
            case TimerCall():
                return self._timer(call, spec, command)
            case ImageCall():
                filled({}, spec, command.parameters, self.mapping.site, None)
                return ImageJob(self, call, command, spec)
            case ActionCall():
                fields = filled(call.fields, spec, command.parameters, self.mapping.site, self._here())
                self._goals[goal] = command.id
                return GoalJob(self, call, spec, goal, fields)
            case ServiceCall():
                fields = filled(call.fields, spec, command.parameters, self.mapping.site, self._here())
                self._goals[goal] = command.id
                return RequestJob(self, call, spec, goal, fields)

    def _timer(self, call: TimerCall, spec: ActionSpec, command: Command) -> Job:
        filled({}, spec, command.parameters, self.mapping.site, None)
        seconds = command.parameters.get(call.duration)
        if seconds is None:
            raise AbsentError(f"the parameter {call.duration} is missing")
        end_ms = self.rover_ms() + 1000 * float(seconds)
        return UntilJob(lambda: self.rover_ms() >= end_ms)

    def _here(self) -> tuple[float, float] | None:
        x, y = self._state.get("pose x"), self._state.get("pose y")
        if isinstance(x, float) and isinstance(y, float) and math.isfinite(x + y):
            return x, y
        return None

    def _goal_id(self, command: CommandId) -> bytes:
        """Return the id of a command's goal, the same in every life of this process."""
        whose = hashlib.sha256(self.mapping.name.encode()).digest()[:4]
        return MARK + whose + hashlib.sha256(json.dumps(command).encode()).digest()[:8]

    def _settle(self, command: CommandId, over: Over | None) -> None:
        if over is not None and command in self._jobs:
            del self._jobs[command]
            self._senses.look(at_all=True)  # what follows a command decides by how things are after it
            self._end(command, over)

    def _end(self, command: CommandId, over: Over) -> None:
        goal = self._goal_id(command)
        if self._goals.pop(goal, None) is not None:
            self._past[goal] = None
        now = self.rover_ms()
        event: Result | Acknowledgement
        if over.acknowledged:
            event = Acknowledgement(now, command)
        else:
            event = Result(now, command, over.success, over.reason, dict(over.values or {}))
        self._done[command] = event
        self._events.append(event)
