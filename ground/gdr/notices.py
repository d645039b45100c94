"""Hear that something was written, by whichever process: PostgreSQL tells it, SQLite's counter shows it.

What is written tells its topics in the same transaction (`LISTEN`/`NOTIFY`), so nobody hears of what was
rolled back and every server hears of what another did. SQLite has no such thing, but a number that changes
with every commit of another connection, and reading it costs some microseconds.
"""

from __future__ import annotations

import logging
import sqlite3
import threading
import time
from collections.abc import Callable, Mapping, Set
from selectors import EVENT_READ, DefaultSelector
from typing import Any

from sqlalchemy import URL, event, text
from sqlalchemy.orm import Session

logger = logging.getLogger(__name__)

CHANNEL = "outcrop"
"""What servers listen to."""
WORK = "outcrop_jobs"
"""What workers listen to: of each change that people see they hear nothing, so it wakes none of them."""
TICK_S = 0.05
"""How often SQLite's counter is read, and how often many changes are looked at: a person waits no longer."""
AGAIN_S = 10.0
"""Everything is looked at so often even in silence: a proxy between us and the server may lose a word."""

_TELL = text(
    "SELECT pg_notify(channel, topic) FROM unnest(CAST(:channels AS text[]), CAST(:topics AS text[]))"
    " AS words (channel, topic)"
)

Moved = Callable[[], Set[str] | None]
"""Gives the topics that changed without the database's telling it; None where there can be none."""
Heard = Callable[[Set[str] | None], None]
"""Takes the topics that changed; None where it may be any."""


def tell_of(session: Session) -> None:
    """Let a session on PostgreSQL tell of the rows with a topic that it writes, and what `tell` was given."""
    event.listen(session, "after_flush", _note_rows)
    event.listen(session, "before_commit", _tell_all)


def tell(session: Session, topic: str, channel: str = CHANNEL) -> None:
    """Tell of a topic when the session's transaction is committed, where the database can."""
    session.info.setdefault("words", set()).add((channel, topic))


def _note_rows(session: Session, _context: Any) -> None:
    for row in (*session.new, *session.dirty):
        topic = getattr(row, "topic", None)
        if topic is not None:
            tell(session, str(topic))


def _tell_all(session: Session) -> None:
    """Tell everything in one statement: a row flushed five times was told five times, at 1 ms each."""
    if session.in_nested_transaction():
        return
    session.flush()
    words = sorted(session.info.pop("words", ()))
    if words:
        channels, topics = map(list, zip(*words, strict=True))
        session.connection().execute(_TELL, {"channels": channels, "topics": topics})


class Watch:
    """One thread of a process that hears of changes, while somebody listens."""

    def __init__(
        self,
        address: URL,
        heard: Heard,
        wanted: Callable[[], bool],
        moved: Moved = lambda: None,
        wait_s: float = 4 * TICK_S,
        channel: str = CHANNEL,
        others: Mapping[str, Callable[[str], object]] | None = None,
    ) -> None:
        """`others` take what PostgreSQL tells on channels of their own."""
        self._others = dict(others or {})
        self._address, self._heard, self._wanted, self._moved = address, heard, wanted, moved
        self._channel = channel
        self._wait_s = wait_s
        """How long PostgreSQL is waited for before `poke` and `stop` are heard."""
        self._poked = threading.Event()
        self._stopped = False
        self._thread: threading.Thread | None = None

    def poke(self) -> None:
        """Look at everything soon; the thread begins with the first listener."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="notices", daemon=True)
            self._thread.start()
        self._poked.set()

    def stop(self) -> None:
        """End the thread."""
        self._stopped = True
        self._poked.set()
        if self._thread is not None:
            self._thread.join(timeout=5.0)

    def _run(self) -> None:
        is_sqlite = self._address.get_backend_name() == "sqlite"
        follow = self._follow_sqlite if is_sqlite else self._follow_postgres
        while not self._stopped:
            if not self._wanted():
                self._poked.wait()
                self._poked.clear()
                continue
            try:
                follow()
            except Exception:
                logger.exception("changes cannot be followed; tried again")
                time.sleep(1.0)

    def _going(self) -> bool:
        return not self._stopped and self._wanted()

    def _follow_sqlite(self) -> None:
        connection = sqlite3.connect(str(self._address.database), isolation_level=None)
        try:
            seen, looked = None, 0.0
            while self._going():
                version = connection.execute("PRAGMA data_version").fetchone()
                now = time.monotonic()
                if version != seen or self._poked.is_set() or now - looked > AGAIN_S:
                    self._poked.clear()
                    seen, looked = version, now
                    self._heard(None)
                elif moved := self._moved():
                    self._heard(moved)
                time.sleep(TICK_S)
        finally:
            connection.close()

    def _follow_postgres(self) -> None:
        import psycopg

        address = self._address.set(drivername="postgresql").render_as_string(hide_password=False)
        with psycopg.connect(address, autocommit=True) as connection, DefaultSelector() as selector:
            for channel in (self._channel, *self._others):
                connection.execute(f"LISTEN {channel}")
            selector.register(connection.fileno(), EVENT_READ)
            self._heard(None)  # what was told before somebody listened
            looked = time.monotonic()
            while self._going():
                moved = self._moved()
                wait_s = self._wait_s if moved is None else TICK_S
                topics = set(moved or ())
                if selector.select(wait_s):  # psycopg's own waiting wakes ten times a second
                    for told in list(connection.notifies(timeout=TICK_S / 2)):
                        if told.channel == self._channel:
                            topics.add(told.payload)
                        else:
                            self._tell_other(told.channel, told.payload)
                now = time.monotonic()
                if self._poked.is_set() or now - looked > AGAIN_S:
                    self._poked.clear()
                    looked = now
                    self._heard(None)
                elif topics:
                    self._heard(topics)

    def _tell_other(self, channel: str, payload: str) -> None:
        """Give what was told to its channel's taker; a word of another version is passed over."""
        try:
            self._others[channel](payload)
        except Exception:
            logger.exception("what was told is not understood", extra={"channel": channel})
