"""Rovers behind the wire for tests: in this process, with a clock and faults that a test sets."""

from __future__ import annotations

import contextlib
import hashlib
import threading
import time
from collections.abc import Iterator
from pathlib import Path

from executive.ports import (
    Acknowledgement,
    Command,
    CommandId,
    CommandState,
    CommandStatus,
    Event,
    Product,
    Result,
    Update,
)
from executive.runtime.wire import About, Address, RoverServer
from executive.runtime.wire.address import listen


class JumpingClock:
    """A rover's clock that a test lets jump, also backwards."""

    def __init__(self, start_ms: int = 0) -> None:
        self.offset_ms = start_ms
        self._begin = time.monotonic()

    def now_ms(self) -> int:
        return max(0, int(1000 * (time.monotonic() - self._begin)) + self.offset_ms)


class Waiter:
    """A rover that waits as long as it is told and takes pictures; all else it refuses."""

    def __init__(self, clock: JumpingClock, out: Path | None = None) -> None:
        self.clock, self.out = clock, out
        self.running: dict[CommandId, float] = {}
        self.done: dict[CommandId, Result | Acknowledgement] = {}
        self.events: list[Event] = [Update(0, {"heartbeat": 0.0, "wheel-speed": 0.0})]
        self.carried_out: list[CommandId] = []

    def send(self, command: Command) -> None:
        self.carried_out.append(command.id)
        now = self.clock.now_ms()
        if command.action == "image" and self.out is not None:
            path = self.out / "products" / f"{len(self.carried_out)}.bin"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(bytes(range(256)) * 2000)
            digest = hashlib.sha256(path.read_bytes()).hexdigest()
            self.events.append(Product(now, command.id, "image", f"products/{path.name}", digest))
        elif command.action != "wait":
            self._over(Result(now, command.id, False, f"unknown action {command.action}"))
            return
        seconds = command.parameters.get("duration_s", 0.0)
        self.running[command.id] = time.monotonic() + float(seconds)

    def _over(self, event: Result | Acknowledgement) -> None:
        self.done[event.command] = event
        self.events.append(event)

    def abort(self, command: CommandId) -> None:
        if self.running.pop(command, None) is not None:
            self._over(Acknowledgement(self.clock.now_ms(), command))

    def status(self, command: CommandId) -> CommandStatus:
        if command in self.running:
            return CommandStatus(CommandState.RUNNING)
        done = self.done.get(command)
        return CommandStatus(CommandState.UNKNOWN if done is None else CommandState.DONE, done)

    def next_event(self, until_ms: int | None) -> Event | None:
        for command, end in list(self.running.items()):
            if time.monotonic() >= end:
                del self.running[command]
                self._over(Result(self.clock.now_ms(), command, True))
        return self.events.pop(0) if self.events else None


@contextlib.contextmanager
def served(rover: Waiter, where: Path) -> Iterator[tuple[Address, RoverServer]]:
    """Give the address of a rover that is served by threads of this process."""
    address = Address(where)
    door = listen(address)
    server = RoverServer(rover, About("waiter"), rover.clock, out=rover.out)
    thread = threading.Thread(target=server.serve, args=(door,), daemon=True)
    thread.start()
    try:
        yield address, server
    finally:
        server.stop_serving()
        thread.join(timeout=5)
        door.close()


@contextlib.contextmanager
def served_script(where: Path) -> Iterator[Address]:
    """Give the address of a waiting rover."""
    with served(Waiter(JumpingClock(), where.parent / "made"), where) as (address, _):
        yield address
