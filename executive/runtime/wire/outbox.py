"""What the executive wants of a rover and has no answer to: commands, aborts, the stop."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from executive.ports import Acknowledgement, Command, CommandId, CommandState, CommandStatus, Result
from executive.runtime.wire.frames import frame
from executive.runtime.wire.messages import about, send_message

RESTARTED = "the rover restarted and knows nothing of it"
UNHEARD = "the rover does not know it, and may have restarted: the journal holds no word of it"
LONG_AGO = -1e9
"""Before any instant of the monotonic clock: what was said then is due."""
STOP_AGAIN_S = 0.25


@dataclass(slots=True)
class _Open:
    """A command that is not over: its message, when it was last said, in which life of the rover first."""

    message: dict[str, object]
    state: str = "sent"
    said: float = 0.0
    boot: int | None = None
    abort_said: float | None = None


class Outbox:
    """Commands that are not over, and a stop that is not confirmed: said until the rover has heard them.

    Belongs to whoever holds the lock of the line (`Line.told`).

    `boot` is the number before the first event of the rover's present life, 0 while it is not known.
    """

    def __init__(self) -> None:
        self.boot = 0
        self.begun_at: int | None = None
        """Up to which number the run had heard before this process, 0 if nothing; None for a new run."""
        self.stopping = False
        self._stop_said = LONG_AGO
        self._open: dict[CommandId, _Open] = {}
        self._asked_about: list[CommandId] = []

    def send(self, command: Command) -> None:
        """Take up a command.

        Raises
        ------
        WireError
            If no frame can hold it: it would break each line it is said on.
        """
        if command.id not in self._open:
            message = send_message(command)
            frame(message)
            self._open[command.id] = _Open(message)

    def abort(self, command: CommandId) -> bool:
        """Let a command be stopped; return whether it never left, and is over with that."""
        entry = self._open.get(command)
        if entry is None:
            self._open[command] = _Open({}, abort_said=LONG_AGO, boot=0)
        elif entry.boot is None and entry.message.get("m") == "send":
            del self._open[command]
            return True
        elif entry.abort_said is None:
            entry.abort_said = LONG_AGO
        return False

    def stop(self) -> list[CommandId]:
        """Let everything be stopped; return what never left, and is over with that."""
        self.stopping, self._stop_said = True, LONG_AGO
        # what has left is aborted, too, or it would begin when it is said again
        return [command for command in list(self._open) if self.abort(command)]

    def close(self, command: CommandId) -> None:
        """A command is over."""
        self._open.pop(command, None)

    def note(self, command: CommandId, state: str) -> None:
        """Take in what the rover says of a command."""
        entry = self._open.get(command)
        if entry is not None and state in ("accepted", "running"):
            entry.state = state
        elif state == "done":  # its answer is in the stream
            self.close(command)

    def known(self, status: CommandStatus, command: CommandId) -> CommandStatus:
        """Return what the rover's word on a command means, with what is known here of its way there."""
        if status.state is CommandState.RUNNING:  # of a process before this one, perhaps
            self._open.setdefault(command, _Open({}, state="running", boot=0))
        if status.state is CommandState.UNKNOWN:
            entry = self._open.get(command)
            if why := self._why_forgotten(entry):
                return CommandStatus(CommandState.DONE, Result(0, command, False, why))
            if entry is not None and entry.state == "sent":
                return CommandStatus(CommandState.RUNNING)  # on its way, and said until it is heard
        return status

    def forgotten(self, command: CommandId) -> Result | None:
        """Return how a command ended that a rover which restarted does not know: it may have begun it."""
        entry = self._open.get(command)
        why = self._why_forgotten(entry) if entry is not None else ""
        return Result(0, command, False, why) if why else None

    def _why_forgotten(self, entry: _Open | None) -> str:
        """Return why a rover that does not know a command may have begun it all the same, or nothing.

        In an earlier life it may; a run that comes back and had heard nothing cannot know of one.
        """
        if entry is not None and entry.message:
            return RESTARTED if entry.boot is not None and entry.boot < self.boot else ""
        if self.begun_at is None or self.begun_at > self.boot:
            return ""
        return RESTARTED if self.begun_at else UNHEARD

    def ask_about_all(self) -> None:
        """Let the rover be asked what it knows of each open command; it has restarted."""
        self._asked_about = list(self._open)

    def states(self) -> tuple[tuple[CommandId, str], ...]:
        """Return the open commands and where they stand."""
        return tuple((command, entry.state) for command, entry in self._open.items())

    def begin(self) -> None:
        """There is a new line: what was said on the one before may be lost."""
        self._stop_said = LONG_AGO
        for entry in self._open.values():
            entry.said = entry.said and LONG_AGO

    def stop_due(self, now: float, retry_s: float) -> bool:
        """Return whether the stop has to be said now (again)."""
        if not self.stopping or now - self._stop_said < min(retry_s, STOP_AGAIN_S):
            return False
        self._stop_said = now
        return True

    def due(self, now: float, retry_s: float) -> Iterator[dict[str, object]]:
        """Yield what has to be said now (again)."""
        asked, self._asked_about = self._asked_about, []
        for command in asked:
            yield about("status", command)
        for command, entry in self._open.items():
            if entry.abort_said is not None:
                if now - entry.abort_said >= retry_s:
                    entry.abort_said = now
                    yield about("abort", command)
            elif (
                entry.state == "sent"
                and (entry.said == 0.0 or now - entry.said >= retry_s)
                and not self._why_forgotten(entry)
            ):
                entry.said = now
                entry.boot = self.boot if entry.boot is None else entry.boot
                yield entry.message


def called_off(command: CommandId) -> Acknowledgement:
    """Return the answer to an abort of a command that never left."""
    return Acknowledgement(0, command)
