"""A line to a rover that is begun anew for ever, and the one thread that owns it."""

from __future__ import annotations

import logging
import os
import selectors
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Protocol

from executive.errors import WireError
from executive.runtime.wire.frames import Connection

logger = logging.getLogger(__name__)

Dial = Callable[[], socket.socket]


@dataclass(frozen=True, slots=True)
class WireOptions:
    """How patient the executive's end is; seconds of the wall clock."""

    beat_s: float = 1.0
    retry_s: float = 1.0
    """What was not answered is said again after so long, or after two round trips if that is more."""
    dead_s: float = 10.0
    """A line on which nothing came for so long is begun anew: half-open lines say nothing of it."""
    dial_s: float = 5.0
    pause_s: float = 0.2
    """Between two tries to reach the rover; doubled up to `longest_pause_s`."""
    longest_pause_s: float = 2.0
    patience_s: float = 5.0
    """How long a question may stay unanswered."""


class Talk(Protocol):
    """What is said and heard on a line. Called by the line's thread alone, which holds `told`."""

    @property
    def final(self) -> bool:
        """Whether the rover said not to come back."""

    def begin(self) -> None:
        """There is a new line: nothing that was said on the one before counts."""

    def say(self, connection: Connection, now: float) -> None:
        """Line up what is due at an instant of the monotonic clock, s."""

    def hear(self, message: dict[str, object]) -> None: ...

    def end(self, why: str) -> None:
        """The line is gone."""


class Line:
    """Keeps a line to the rover until it is closed.

    Nothing that happens in here ends the thread: a stop must find its way for as long as the process lives.
    `told` guards all that is shared with other threads, and is notified of everything that is heard.
    """

    def __init__(self, dial: Dial, talk: Talk, told: threading.Condition, options: WireOptions, name: str):
        self.options = options
        self.connection: Connection | None = None
        self.closing = False
        self.word: float | None = None
        """When the rover's last word came."""
        self.why = ""
        """Why there is no line."""
        self._dial, self._talk, self._told, self._name = dial, talk, told, name
        self._thread: threading.Thread | None = None
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_read, False)
        os.set_blocking(self._wake_write, False)

    @property
    def begun(self) -> bool:
        return self._thread is not None

    def begin(self) -> None:
        """Start the thread if it does not run; let it look at once what is due."""
        with self._told:
            if self._thread is None and not self.closing:
                self._thread = threading.Thread(target=self._keep, name=self._name, daemon=True)
                self._thread.start()
        self.wake()

    def wake(self) -> None:
        if self._wake_write >= 0:
            with suppress(OSError):
                os.write(self._wake_write, b".")

    def break_off(self) -> None:
        """Break the line as it stands; the thread begins it anew. For checks."""
        with self._told:
            if self.connection is not None:
                with suppress(OSError):
                    self.connection.line.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        with self._told:
            self.closing = True
            self._told.notify_all()
        self.wake()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout=5)
        if self._wake_read >= 0:
            os.close(self._wake_read)
            os.close(self._wake_write)
            self._wake_read = self._wake_write = -1

    def _keep(self) -> None:
        pause_s = self.options.pause_s
        while not self.closing:
            connection = self._reach()
            if connection is None:
                self._rest(pause_s)
                pause_s = min(2 * pause_s, self.options.longest_pause_s)
                continue
            pause_s = self.options.pause_s
            why = ""
            try:
                self._use(connection)
            except WireError as error:
                why = str(error)
            except Exception as error:  # whatever this end does wrong, the next line may do better
                logger.exception("the line's thread failed")
                why = f"this end failed: {error!r}"[:200]
            finally:
                with self._told:
                    self.connection, self.why = None, why
                    self._talk.end(why)
                    self._told.notify_all()
                connection.close()
            if why:
                self._rest(pause_s)

    def _reach(self) -> Connection | None:
        try:
            return Connection(self._dial())
        except WireError as error:
            self.why = str(error)
        except Exception as error:  # noqa: BLE001 - a dial is the caller's own function and may raise anything
            self.why = f"it cannot be dialled: {error!r}"[:200]
        return None

    def _rest(self, pause_s: float) -> None:
        with self._told:
            self._told.wait_for(lambda: self.closing, pause_s)

    def _use(self, connection: Connection) -> None:
        """Talk until the line breaks or is closed."""
        with self._told:
            self.connection = connection
            self._talk.begin()
        begun = time.monotonic()
        with selectors.DefaultSelector() as selector:
            selector.register(self._wake_read, selectors.EVENT_READ)
            selector.register(connection.line, selectors.EVENT_READ)
            while True:
                now = time.monotonic()
                with self._told:
                    if self.closing:
                        connection.write()
                        return
                    self._talk.say(connection, now)
                connection.write()
                writing = selectors.EVENT_WRITE if connection.wants_to_write else 0
                selector.modify(connection.line, selectors.EVENT_READ | writing)
                selector.select(0.02)
                with suppress(OSError):
                    os.read(self._wake_read, 4096)
                for message in connection.read():
                    with self._told:
                        self.word = time.monotonic()
                        self._talk.hear(message)
                        self.closing = self.closing or self._talk.final
                        self._told.notify_all()
                if time.monotonic() - max(begun, self.word or 0.0) > self.options.dead_s:
                    raise WireError(f"no word for {self.options.dead_s:g} s")
