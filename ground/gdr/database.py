"""Sessions on SQLite and PostgreSQL: one writer at a time on the one, row locks on the other."""

from __future__ import annotations

import json
import select
import sqlite3
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import orjson
from sqlalchemy import Connection, Engine, create_engine, event, make_url, text
from sqlalchemy.exc import DisconnectionError
from sqlalchemy.orm import Session

if TYPE_CHECKING:
    import psycopg
    from sqlalchemy.pool import ConnectionPoolEntry

_WRITE = "outcrop_write"
_SQLITE_ARGUMENTS: dict[str, Any] = {"check_same_thread": False, "timeout": 30.0}


def _loads(text: str | bytes) -> Any:
    """Return a JSON value; the quick reader refuses NaN and infinity, which older rows may hold."""
    try:
        return orjson.loads(text)
    except orjson.JSONDecodeError:
        return json.loads(text)


class Database:
    """The way to the rows.

    On SQLite every write transaction begins with `BEGIN IMMEDIATE` behind a lock of the process, because
    SQLite's own waiting is unfair and a read lock cannot always grow into a write lock. On PostgreSQL rows
    that are about to change are locked with `FOR UPDATE` by the callers, and a connection that the server
    closed while nobody used it is made anew: a restart of the server fails no request that comes after it.
    """

    def __init__(self, address: str) -> None:
        self.url = make_url(address)
        self.is_sqlite = self.url.get_backend_name() == "sqlite"
        self._writer = threading.RLock()
        if self.is_sqlite:
            if self.url.database:
                Path(self.url.database).parent.mkdir(parents=True, exist_ok=True)
            self.engine = create_engine(
                self.url,
                connect_args=_SQLITE_ARGUMENTS,
                pool_size=20,
                max_overflow=60,
                json_deserializer=_loads,
            )
            _prepare_sqlite(self.engine)
        else:
            self.engine = create_engine(self.url, pool_size=20, max_overflow=60, json_deserializer=_loads)
            _prepare_postgres(self.engine)
        self.write_engine = self.engine.execution_options(**{_WRITE: True})
        self._plain_engine = self._make_plain_engine()

    def _make_plain_engine(self) -> Engine:
        """Return an engine whose connections never begin a transaction, so nothing is reset on their return.

        A pool of its own: switching a connection to and fro cost as much as the read itself.
        """
        more: dict[str, Any] = {"connect_args": _SQLITE_ARGUMENTS} if self.is_sqlite else {}
        engine = create_engine(
            self.url,
            isolation_level="AUTOCOMMIT",
            pool_reset_on_return=None,
            pool_use_lifo=True,
            pool_size=20,
            max_overflow=60,
            json_deserializer=_loads,
            **more,
        )
        if self.is_sqlite:
            event.listen(engine, "connect", _on_sqlite_connect)
        else:
            _prepare_postgres(engine)
        return engine

    @contextmanager
    def read(self) -> Iterator[Session]:
        """Give a session that sees one state of the database and changes nothing."""
        with Session(self.engine, autoflush=False, expire_on_commit=False) as session:
            yield session

    @contextmanager
    def connection(self) -> Iterator[Connection]:
        """Give a bare connection for a single hot read, without a transaction round it."""
        with self._plain_engine.connect() as connection:
            yield connection

    @contextmanager
    def write(self) -> Iterator[Session]:
        """Give a session whose changes are committed at the end, all or none."""
        if self.is_sqlite:
            with (
                self._writer,
                Session(self.write_engine, expire_on_commit=False) as session,
                session.begin(),
            ):
                yield session
        else:
            with Session(self.write_engine, expire_on_commit=False) as session, session.begin():
                yield session

    def ping(self) -> None:
        """Raise unless the database answers."""
        with self.engine.connect() as connection:
            connection.execute(text("SELECT 1"))

    def dispose(self) -> None:
        self.engine.dispose()
        self._plain_engine.dispose()


def _on_sqlite_connect(connection: sqlite3.Connection, _record: Any) -> None:
    connection.isolation_level = None
    cursor = connection.cursor()
    cursor.execute("PRAGMA journal_mode=WAL")
    cursor.execute("PRAGMA synchronous=FULL")
    cursor.execute("PRAGMA foreign_keys=ON")
    cursor.execute("PRAGMA busy_timeout=30000")
    cursor.close()


def _prepare_postgres(engine: Engine) -> None:
    """Let an engine's pool make anew what the server closed while it lay there.

    An idle connection has nothing to read, one that was closed has: so a look at the socket does what a round
    trip on every checkout would (`pool_pre_ping`), and only a socket with something to read is asked further.
    """

    @event.listens_for(engine, "connect")
    def _on_connect(connection: psycopg.Connection[Any], record: ConnectionPoolEntry) -> None:
        record.info["readable"] = _look_at(connection.fileno())

    @event.listens_for(engine, "checkout")
    def _on_checkout(
        connection: psycopg.Connection[Any], record: ConnectionPoolEntry, _proxy: object
    ) -> None:
        if not record.info["readable"]():
            return
        try:
            with connection.transaction():
                connection.execute("SELECT 1")
        except connection.OperationalError as err:
            raise DisconnectionError("the server closed the connection") from err


def _look_at(descriptor: int) -> Callable[[], object]:
    """Return what says whether something, be it the end, waits to be read."""
    if not hasattr(select, "poll"):  # Windows
        return lambda: select.select([descriptor], [], [], 0.0)[0]
    poll = select.poll()
    poll.register(descriptor, select.POLLIN)
    return partial(poll.poll, 0)


def _prepare_sqlite(engine: Engine) -> None:
    event.listen(engine, "connect", _on_sqlite_connect)

    @event.listens_for(engine, "begin")
    def _on_begin(connection: Connection) -> None:
        immediate = connection.get_execution_options().get(_WRITE)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if immediate else "BEGIN")
