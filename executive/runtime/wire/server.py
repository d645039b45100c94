"""The rover's end of a wire: any rover behind the ports, for an executive in another process.

Two threads: one owns the lines and answers at once whatever the rover is doing, the other owns the rover. The
rover's clock is `clock`; a simulated rover is led along it.
"""

from __future__ import annotations

import base64
import logging
import os
import selectors
import socket
import ssl
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from executive.errors import WireError
from executive.ports import (
    Clock,
    CommandId,
    Event,
    Rover,
    Update,
)
from executive.runtime.codec import command_id_to_json
from executive.runtime.wire.address import Keys
from executive.runtime.wire.downloads import CHUNK
from executive.runtime.wire.frames import LIMIT, Connection
from executive.runtime.wire.lead import RoverLead
from executive.runtime.wire.messages import (
    PROTOCOL,
    command_id,
    command_of,
    event_message,
    mapping,
    numbered,
    status_message,
    text,
    whole,
)
from executive.runtime.wire.speakable import fitting

logger = logging.getLogger(__name__)

TICK_S = 0.005
"""How often the rover is led along its clock."""
IN_FLIGHT = 512
"""Messages lined up on a line before more of the stream follows: what cannot leave is merged instead."""

LEFT_OUT = 1000
"""Sentences logged of what no frame can hold: a rover that floods must not flood its log."""


@dataclass(frozen=True, slots=True)
class About:
    """What a rover says of itself."""

    name: str
    rate: float = 1.0
    """Seconds of its clock in a second."""
    dictionary: Mapping[str, str] | None = None
    """Name, version and sha256 of its dictionary."""


class RoverServer:
    """Serves one rover to one executive at a time.

    Parameters
    ----------
    out
        Folder in which the rover leaves its products; they are given down by pieces.
    inject
        Lets a simulated rover suffer a `fault/1`; None where there is no such thing.
    """

    def __init__(
        self,
        rover: Rover,
        about: About,
        clock: Clock,
        *,
        out: Path | None = None,
        inject: Callable[[dict[str, object]], None] | None = None,
    ) -> None:
        self.about, self.clock = about, clock
        self._out, self._fault = out, inject
        self._lock = threading.RLock()
        self._lead: RoverLead[Connection] = RoverLead(
            rover,
            clock,
            self._lock,
            said=self._wake,
            started=self._say_running,
            stopped=self._say_stopped,
        )
        self._kept, self._commands = self._lead.kept, self._lead.commands
        self._run = ""
        self._active: Connection | None = None
        self._lines: dict[Connection, None] = {}
        self._stopping = threading.Event()
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_read, False)
        os.set_blocking(self._wake_write, False)
        self.over = threading.Event()
        """Set when an executive said that its run is over."""
        self.alone_since = time.monotonic()
        """When the last executive went."""

    @property
    def has_executive(self) -> bool:
        return self._active is not None

    # --- threads ----------------------------------------------------------------------

    def serve(self, door: socket.socket | None, keys: Keys | None = None) -> None:
        """Own the lines until `stop_serving`; takes lines from `door`, and those given by `add_line`."""
        context = keys.context(server=True) if keys is not None else None
        self._lead.listen()  # its state, before anybody asks
        worker = threading.Thread(target=self._lead.run, args=(self._stopping,), name="rover", daemon=True)
        worker.start()
        with selectors.DefaultSelector() as selector:
            selector.register(self._wake_read, selectors.EVENT_READ)
            if door is not None:
                door.setblocking(False)
                selector.register(door, selectors.EVENT_READ)
            known: set[Connection] = set()
            while not self._stopping.is_set():
                self._pump(selector, known, door, context)
        for connection in list(self._lines):
            connection.close()
        worker.join(timeout=5)

    def stop_serving(self) -> None:
        """Let both threads end."""
        self._stopping.set()
        self._lead.wake()
        self._wake()

    def add_line(self, line: socket.socket) -> None:
        """Take up a line that is there already, one end of a pair in the same process."""
        self._lines[Connection(line)] = None
        self._wake()

    def _wake(self) -> None:
        with suppress(OSError):
            os.write(self._wake_write, b".")

    def _pump(
        self,
        selector: selectors.BaseSelector,
        known: set[Connection],
        door: socket.socket | None,
        context: ssl.SSLContext | None,
    ) -> None:
        for connection in list(self._lines):
            mask = selectors.EVENT_READ | (selectors.EVENT_WRITE if connection.wants_to_write else 0)
            if connection in known:
                selector.modify(connection.line, mask, connection)
            else:
                selector.register(connection.line, mask, connection)
                known.add(connection)
        for key, _ in selector.select(0.2):
            if key.fileobj is door and door is not None:
                self._accept(door, context)
            elif isinstance(key.data, Connection):
                self._read(key.data)
        with suppress(OSError):
            os.read(self._wake_read, 4096)
        self._flush()
        for connection in [c for c in known if c not in self._lines]:
            selector.unregister(connection.line)
            known.discard(connection)
            connection.close()

    def _accept(self, door: socket.socket, context: ssl.SSLContext | None) -> None:
        try:
            line, _ = door.accept()
            if line.family != socket.AF_UNIX:
                line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if context is not None:
                line.setblocking(False)
                line = context.wrap_socket(line, server_side=True, do_handshake_on_connect=False)
            self._lines[Connection(line)] = None
        except OSError as error:
            logger.warning("a line was refused", extra={"why": str(error)})

    def _drop(self, connection: Connection, why: str) -> None:
        self._lines.pop(connection, None)
        self._lead.forget(connection)
        if connection is self._active:
            self._active, self.alone_since = None, time.monotonic()
            logger.info("the executive is gone", extra={"why": why})

    def _read(self, connection: Connection) -> None:
        try:
            messages = connection.read()
        except WireError as error:
            self._drop(connection, str(error))
            return
        for message in messages:
            try:
                with self._lock:
                    self._take(connection, message)
            except WireError as error:
                logger.warning("a message was dropped", extra={"why": str(error)})
            except Exception:  # the lines stay, whatever one message does
                logger.exception("a message was dropped")

    def _flush(self) -> None:
        with self._lock:
            active = self._active
            if active is not None:
                for event in self._kept.fresh(max(0, IN_FLIGHT - active.backlog)):
                    self._tell(active, event)
        for connection in list(self._lines):
            try:
                connection.write()
            except WireError as error:
                self._drop(connection, str(error))

    def _tell(self, connection: Connection, event: Event) -> None:
        try:
            connection.put(event_message(event))
        except WireError as error:  # its number must come, or it is asked for for ever
            logger.warning("an event was dropped", extra={"why": str(error)})
            number = numbered(event).number
            connection.put(event_message(Update(self.clock.now_ms(), {}, number)))

    # --- messages of the executive --------------------------------------------------------

    def _take(self, connection: Connection, message: dict[str, object]) -> None:
        kind = message.get("m")
        if kind == "stop":
            self._lead.stop(connection)
        elif kind == "hello":
            self._hello(connection, message)
        elif connection is not self._active:
            return
        elif kind in ("send", "abort", "status"):
            self._take_command(connection, message)
        elif kind == "commit":
            self._kept.commit(whole(message, "number"))
        elif kind == "since":
            self._kept.rewind(whole(message, "number"))
        elif kind == "beat":
            answer = {"m": "beat", "echo": message.get("t"), "t": self.clock.now_ms()}
            connection.put({**answer, "last": self._kept.last})
        elif kind == "state":
            values = fitting(self._kept.state, [], LIMIT // 2)
            connection.put({"m": "state", "q": message.get("q"), "t": self.clock.now_ms(), "values": values})
        elif kind == "fetch":
            self._give(connection, message)
        elif kind == "fault":
            self._lead.do(partial(self._suffer, connection, message))
        elif kind == "bye":
            self.over.set()
            self._drop(connection, "the run is over")

    def _hello(self, connection: Connection, message: dict[str, object]) -> None:
        run, have = text(message, "run"), whole(message, "have")
        if message.get("protocol") != PROTOCOL:
            connection.put({"m": "bye", "reason": f"this rover speaks {PROTOCOL}"})
            return
        if run != self._run:
            if self._run and self._commands.running:
                busy = f"this rover is busy with the run {self._run}"
                connection.put({"m": "bye", "reason": busy})
                return
            if self._run or not have:
                self._kept.forget(self.clock.now_ms())
            if self._run:
                self._lead.products.clear()
            self._run = run
        if self._active is not None and self._active is not connection:
            self._active.put({"m": "bye", "reason": "another executive of this run took over", "final": True})
            with suppress(WireError):
                self._active.write()
            self._drop(self._active, "another executive took over")
        if have > self._kept.last:
            self._kept.move_behind(have)
        self._active = connection
        self._kept.rewind(have)
        welcome: dict[str, object] = {
            "m": "welcome",
            "protocol": PROTOCOL,
            "rover": self.about.name,
            "run": run,
            "boot": self._kept.boot,
            "first": self._kept.first,
            "last": self._kept.last,
            "t": self.clock.now_ms(),
            "rate": self.about.rate,
            "faults": self._fault is not None,
        }
        if self.about.dictionary is not None:
            welcome["dictionary"] = dict(self.about.dictionary)
        connection.put(welcome)

    def _take_command(self, connection: Connection, message: dict[str, object]) -> None:
        kind = message["m"]
        wanted = command_id(message)
        if kind == "send":
            self._lead.begin(command_of(message))
            state = "done" if wanted in self._commands.done else "accepted"
            connection.put({"m": "command", "id": command_id_to_json(wanted), "state": state})
        elif kind == "abort":
            if self._lead.abort(wanted):
                connection.put({"m": "command", "id": command_id_to_json(wanted), "state": "done"})
        else:
            answer = status_message(wanted, self._lead.status(wanted))
            connection.put(answer | ({"q": message["q"]} if "q" in message else {}))

    def _say_stopped(self, connection: Connection) -> None:
        if connection in self._lines:
            connection.put({"m": "stopped"}, urgent=True)
            self._wake()

    def _say_running(self, command: CommandId) -> None:
        with self._lock:
            if self._active is not None and command in self._commands.running:
                self._active.put({"m": "command", "id": command_id_to_json(command), "state": "running"})
        self._wake()

    def _give(self, connection: Connection, message: dict[str, object]) -> None:
        """Answer with a piece of a product, or that there is no such file."""
        path, offset = text(message, "path"), whole(message, "offset")
        size = min(whole({"size": CHUNK, **message}, "size", least=1), CHUNK)
        answer: dict[str, object] = {"m": "chunk", "q": message.get("q"), "path": path, "offset": offset}
        known = path in self._lead.products or path.removesuffix(".json") in self._lead.products
        try:
            if self._out is None or not known:
                raise FileNotFoundError
            with (self._out / path).open("rb") as file:
                answer["total"] = os.fstat(file.fileno()).st_size
                file.seek(offset)
                answer["data"] = base64.b64encode(file.read(size)).decode()
        except OSError:
            answer.update(total=None, data="")
        connection.put(answer)

    def _suffer(self, connection: Connection, message: dict[str, object]) -> None:
        answer: dict[str, object] = {"m": "fault", "q": message.get("q"), "ok": False}
        if self._fault is None:
            answer["reason"] = "this rover takes no faults"
        else:
            try:
                self._fault(mapping(message, "fault"))
                answer["ok"] = True
            except Exception as error:  # noqa: BLE001 - a rover is foreign code and may raise anything
                answer["reason"] = str(error)[:400]
        connection.put(answer)
        self._wake()
