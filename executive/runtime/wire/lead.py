"""The thread that owns a rover behind the wire: leads it along its clock, does what the lines ask of it."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Generic, TypeVar

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
    Rover,
)
from executive.runtime.wire.downloads import safe_path
from executive.runtime.wire.kept import Commands, Kept, first_number
from executive.runtime.wire.speakable import speakable

logger = logging.getLogger(__name__)

TICK_S = 0.005
"""How often the rover is led along its clock."""
LEFT_OUT = 1000
"""Sentences logged of what no frame can hold: a rover that floods must not flood its log."""

Asker = TypeVar("Asker")


class RoverLead(Generic[Asker]):
    """Leads a rover along its clock, and keeps what it says.

    `kept`, `commands` and `products` belong to whoever holds `lock`; the rover itself belongs to the thread
    of `run`.

    Parameters
    ----------
    said
        Told, in the rover's thread, that there is something new in `kept`.
    started
        Told of a command that the rover has taken up.
    stopped
        Told whom to say that all has stopped which ran when they asked for it.
    """

    def __init__(
        self,
        rover: Rover,
        clock: Clock,
        lock: threading.RLock,
        *,
        said: Callable[[], None],
        started: Callable[[CommandId], None],
        stopped: Callable[[Asker], None],
    ) -> None:
        self.rover, self.clock = rover, clock
        self.kept = Kept(first_number(time.time()))
        self.commands = Commands()
        self.products: set[str] = set()
        self._lock = lock
        self._told_said, self._told_started, self._told_stopped = said, started, stopped
        self._tasks: deque[Callable[[], None]] = deque()
        self._work = threading.Event()
        self._stops: dict[Asker, set[CommandId]] = {}
        """Who waits for the word that everything has stopped, and what that is."""
        self._stop_queued = False
        self._left_out: set[str] = set()

    # --- for any thread -----------------------------------------------------------------

    def do(self, task: Callable[[], None], *, urgent: bool = False) -> None:
        """Let the rover's thread do something; what is urgent goes before all that waits."""
        if urgent:
            self._tasks.appendleft(task)
        else:
            self._tasks.append(task)
        self._work.set()

    def begin(self, command: Command) -> None:
        """Begin a command, unless it was begun before."""
        with self._lock:
            if self.commands.begin(command.id):
                self.do(partial(self._start, command))

    def abort(self, command: CommandId) -> bool:
        """Stop a command; return whether it is over already, or was never heard of and is over with that."""
        with self._lock:
            self.commands.call_off(command, self.say, self.clock.now_ms())
            if command in self.commands.done:
                return True
        self.do(partial(self._abort, command), urgent=True)
        return False

    def stop(self, asker: Asker) -> None:
        """Stop what runs now, and say so when it has; what is sent after a stop is not stopped by it."""
        with self._lock:
            self._stops.setdefault(asker, set()).update(self.commands.running)
            queue, self._stop_queued = not self._stop_queued, True
        if queue:
            self.do(self._abort_all, urgent=True)
        self._confirm_stops()

    def forget(self, asker: Asker) -> None:
        """Somebody who may have asked for a stop is gone."""
        with self._lock:
            self._stops.pop(asker, None)

    def status(self, command: CommandId) -> CommandStatus:
        if command in self.commands.done:
            return CommandStatus(CommandState.DONE, self.commands.done[command])
        running = command in self.commands.running
        return CommandStatus(CommandState.RUNNING if running else CommandState.UNKNOWN)

    def say(self, event: Event) -> None:
        """Keep something the rover says, as far as a frame can hold it."""
        fit, left_out = speakable(event)
        for what in left_out:
            if len(self._left_out) < LEFT_OUT and what not in self._left_out:
                self._left_out.add(what)
                logger.warning("the rover said what no frame can hold", extra={"left_out": what})
        if fit is None:
            return
        with self._lock:
            self.kept.say(fit)
            self.commands.note(fit)
            if isinstance(fit, Product) and safe_path(fit.path) is not None:
                self.products.add(fit.path)

    def wake(self) -> None:
        self._work.set()

    # --- the rover's thread ---------------------------------------------------------------

    def run(self, over: threading.Event) -> None:
        """Own the rover until it is `over`."""
        while not over.is_set():
            self._work.wait(TICK_S)
            self._work.clear()
            self.listen()
            while self._tasks:
                self._guarded(self._tasks.popleft())
                self.listen()

    def listen(self) -> None:
        """Keep all that the rover has to say up to the present time of its clock."""
        self._guarded(self._listen)

    def _guarded(self, act: Callable[[], None]) -> None:
        """Do something with the rover; whatever it raises, its line stays: the executive hears of silence."""
        try:
            act()
        except Exception:
            logger.exception("the rover raised an error")

    def _listen(self) -> None:
        heard = False
        while (event := self.rover.next_event(self.clock.now_ms())) is not None:
            self.say(event)
            heard = True
        if heard:
            self._confirm_stops()
            self._told_said()

    def _start(self, command: Command) -> None:
        if command.id not in self.commands.running:
            return  # it was stopped before the rover came to it
        try:
            self.rover.send(command)
        except Exception as error:
            logger.exception("the rover raised an error", extra={"task_id": command.id.task})
            self.say(Result(self.clock.now_ms(), command.id, False, f"the rover failed: {error}"[:200]))
            self._told_said()
            return
        self._told_started(command.id)

    def _abort(self, command: CommandId) -> None:
        if command in self.commands.running:
            self.rover.abort(command)
            if self.rover.status(command).state is CommandState.UNKNOWN:
                self.say(Acknowledgement(self.clock.now_ms(), command))
                self._told_said()

    def _abort_all(self) -> None:
        """Stop what everybody who asked wants to be stopped; who asks again has it tried again."""
        with self._lock:
            self._stop_queued = False
            wanted: set[CommandId] = set().union(*self._stops.values())
        for command in wanted:
            self._guarded(partial(self._abort, command))
        self._confirm_stops()

    def _confirm_stops(self) -> None:
        with self._lock:
            running = self.commands.running
            for asker in [a for a, wanted in self._stops.items() if not wanted & running]:
                del self._stops[asker]
                self._told_stopped(asker)
