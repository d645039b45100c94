"""What the owner of a live run has taken from the mailbox, as the rover of its session."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TypeVar

from executive.ports import (
    Command,
    CommandId,
    CommandPort,
    CommandState,
    CommandStatus,
    Event,
    Receipts,
    Value,
)

logger = logging.getLogger(__name__)

T = TypeVar("T")


class Inbox:
    """What waits for the owner's next round; commands go to the port."""

    def __init__(self, port: CommandPort, complain: Callable[[str, str], None]) -> None:
        self.port = port
        self.events: deque[Event] = deque()
        self.complain = complain

    def next_event(self, until_ms: int | None) -> Event | None:
        if self.events and (until_ms is None or self.events[0].t_ms <= until_ms):
            return self.events.popleft()
        return None

    def send(self, command: Command) -> None:
        self.ask(f"send of {command.id}", lambda: self.port.send(command), None)

    def abort(self, command: CommandId) -> None:
        self.ask(f"abort of {command}", lambda: self.port.abort(command), None)

    def status(self, command: CommandId) -> CommandStatus:
        unheard = CommandStatus(CommandState.RUNNING)
        return self.ask(f"status of {command}", lambda: self.port.status(command), unheard)

    def commit(self, number: int) -> None:
        if isinstance(self.port, Receipts):
            self.ask(f"receipt up to {number}", partial(self.port.commit, number), None)

    def since(self, number: int) -> Sequence[Event]:
        if not isinstance(self.port, Receipts):
            return ()
        return self.ask(f"what was said after {number}", partial(self.port.since, number), ())

    def present_state(self) -> Mapping[str, Value]:
        if not isinstance(self.port, Receipts):
            return {}
        return self.ask("present state", self.port.present_state, {})

    def ask(self, what: str, act: Callable[[], T], otherwise: T) -> T:
        """Let the port act; one that breaks must not break the executive (the action monitor asks again)."""
        try:
            return act()
        except Exception as error:  # noqa: BLE001 - a port is foreign code and may raise anything
            logger.warning("port failed", extra={"what": what})
            self.complain("port", f"{what} failed: {error}")
            return otherwise
