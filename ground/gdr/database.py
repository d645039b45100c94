"""Sessions on SQLite and PostgreSQL: one writer at a time on the one, row locks on the other."""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event, make_url, text
from sqlalchemy.orm import Session

_WRITE = "outcrop_write"
_PLAIN = "outcrop_plain"


class Database:
    """The way to the rows.

    On SQLite every write transaction begins with `BEGIN IMMEDIATE` behind a lock of the process, because
    SQLite's own waiting is unfair and a read lock cannot always grow into a write lock. On PostgreSQL rows
    that are about to change are locked with `FOR UPDATE` by the callers.
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
                connect_args={"check_same_thread": False, "timeout": 30.0},
                pool_size=20,
                max_overflow=60,
            )
            _prepare_sqlite(self.engine)
        else:
            self.engine = create_engine(self.url, pool_size=20, max_overflow=60, pool_pre_ping=False)
        self.write_engine = self.engine.execution_options(**{_WRITE: True})
        options = {_PLAIN: True} if self.is_sqlite else {"isolation_level": "AUTOCOMMIT"}
        self._plain_engine = self.engine.execution_options(**options)

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


def _prepare_sqlite(engine: Engine) -> None:
    @event.listens_for(engine, "connect")
    def _on_connect(connection: sqlite3.Connection, _record: Any) -> None:
        connection.isolation_level = None
        cursor = connection.cursor()
        cursor.execute("PRAGMA journal_mode=WAL")
        cursor.execute("PRAGMA synchronous=FULL")
        cursor.execute("PRAGMA foreign_keys=ON")
        cursor.execute("PRAGMA busy_timeout=30000")
        cursor.close()

    @event.listens_for(engine, "begin")
    def _on_begin(connection: Connection) -> None:
        options = connection.get_execution_options()
        if options.get(_PLAIN):
            return
        immediate = options.get(_WRITE)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if immediate else "BEGIN")
