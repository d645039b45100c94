"""Sessions on SQLite and PostgreSQL: one writer at a time on the one, row locks on the other."""

from __future__ import annotations

import os
import select
import sqlite3
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from contextvars import ContextVar
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from sqlalchemy import Connection, Engine, create_engine, event, make_url, text
from sqlalchemy.exc import DisconnectionError, NoResultFound
from sqlalchemy.orm import Session

from ground.durable import FILE_MODE, make_folder
from ground.errors import BusyError, DamagedDataError
from ground.gdr.decoding import dumps, keep_odd_times, loads, name_damage
from ground.gdr.notices import tell_of

if TYPE_CHECKING:
    import psycopg
    from sqlalchemy.pool import ConnectionPoolEntry

_WRITE = "outcrop_write"
_SQLITE_ARGUMENTS: dict[str, Any] = {"check_same_thread": False, "timeout": 30.0}
_POOL_AND_JSON: dict[str, Any] = {
    "pool_size": 20,
    "max_overflow": 60,
    "json_serializer": dumps,
    "json_deserializer": loads,
}


class ReferredSession(Session):
    """A session in which a row that another one names, and that is not there, has its own error."""

    def get_one(self, entity: Any, ident: Any, **given: Any) -> Any:
        """Return the row of an id that another row holds.

        Raises
        ------
        DamagedDataError
            If it is not there; the keys between tables forbid that.
        """
        try:
            return super().get_one(entity, ident, **given)
        except NoResultFound as err:
            table = getattr(entity, "__tablename__", entity)
            raise DamagedDataError(f"the table {table} lacks the row {ident} that another one names") from err


class _Queue:
    """A lock of the process that is given out in the order of asking.

    A plain lock goes back to whoever asks next, which is mostly the thread that has just let it go: one that
    writes often would keep all others out.
    """

    PATIENCE_S = 30.0
    """As long as SQLite waits for another process; who waits longer is told so, and counts no thread less."""

    def __init__(self) -> None:
        self._state = threading.Lock()
        self._waiting: deque[threading.Event] = deque()
        self._taken = False

    @contextmanager
    def turn(self) -> Iterator[None]:
        """Wait for the lock and hold it.

        Raises
        ------
        BusyError
            If it is not free in time.
        """
        with self._state:
            mine = None if not self._taken else threading.Event()
            self._taken = True
            if mine is not None:
                self._waiting.append(mine)
        try:
            if mine is not None and not mine.wait(self.PATIENCE_S):
                raise BusyError(
                    f"the database was busy with other writes for {self.PATIENCE_S:g} s; try again"
                )
            yield
        finally:
            with self._state:
                if mine is not None and not mine.is_set():  # it gave up
                    self._waiting.remove(mine)
                elif self._waiting:
                    self._waiting.popleft().set()
                else:
                    self._taken = False


class Act:
    """Everything that a request writes, as one transaction that begins with the first write."""

    def __init__(self, first: Callable[[Session], None]) -> None:
        self.session: Session | None = None
        self.whole = False
        """Whether a write within it that fails is an end of all of it: then none needs a savepoint."""
        self._first = first
        self._stack = ExitStack()

    def join(self, transaction: Callable[[], AbstractContextManager[Session]]) -> Session:
        """Return the session of the act, begun now if nothing was written before."""
        if self.session is None:
            self.session = self._stack.enter_context(transaction())
            self._first(self.session)
        return self.session

    def __enter__(self) -> Self:
        self._stack.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._stack.__exit__(*error)


_ACT: ContextVar[Act | None] = ContextVar("act", default=None)


def in_act() -> bool:
    """Return whether what runs now is part of an act, and so has to stay in its thread."""
    return _ACT.get() is not None


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
        self._writer = _Queue()
        if self.is_sqlite:
            if self.url.database and self.url.database != ":memory:":
                make_folder(Path(self.url.database).parent)
                os.close(os.open(self.url.database, os.O_CREAT | os.O_RDWR, FILE_MODE))
            self.engine = create_engine(self.url, connect_args=_SQLITE_ARGUMENTS, **_POOL_AND_JSON)
            _prepare_sqlite(self.engine)
        else:
            self.engine = create_engine(self.url, **_POOL_AND_JSON)
            _prepare_postgres(self.engine)
        name_damage(self.engine)
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
            **_POOL_AND_JSON,
            **more,
        )
        name_damage(engine)
        if self.is_sqlite:
            event.listen(engine, "connect", _on_sqlite_connect)
        else:
            _prepare_postgres(engine)
        return engine

    @contextmanager
    def read(self) -> Iterator[Session]:
        """Give a session that sees one state of the database and changes nothing."""
        act = _ACT.get()
        if act is not None and act.session is not None:  # what the act has written is seen by it alone
            yield act.session
            return
        with ReferredSession(self.engine, autoflush=False, expire_on_commit=False) as session:
            yield session
            if not self.is_sqlite:
                _end_read(session)

    @contextmanager
    def connection(self) -> Iterator[Connection]:
        """Give a bare connection for a single hot read, without a transaction round it."""
        act = _ACT.get()
        if act is not None and act.session is not None:
            yield act.session.connection()
            return
        with self._plain_engine.connect() as connection:
            yield connection

    @contextmanager
    def write(self) -> Iterator[Session]:
        """Give a session whose changes are committed at the end, all or none.

        Within an act they are committed with it.
        """
        act = _ACT.get()
        if act is None:
            with self._transaction() as session:
                yield session
        elif act.whole and act.session is not None:
            yield act.session
        else:
            with act.join(self._transaction).begin_nested() as savepoint:
                yield savepoint.session

    @contextmanager
    def act(self, first: Callable[[Session], None]) -> Iterator[Act]:
        """Make one transaction of all that is written inside, in this thread; `first` is done at its head.

        Nothing is locked before the first write. What was written is committed at the end, or never.
        """
        act = Act(first)
        mark = _ACT.set(act)
        try:
            with act:
                yield act
        finally:
            _ACT.reset(mark)

    @contextmanager
    def together(self) -> Iterator[None]:
        """Make one transaction of all that is written inside, or of the act that it is part of."""
        if in_act():
            yield
        else:
            with self.act(lambda _session: None):
                yield

    @contextmanager
    def whole(self) -> Iterator[Session]:
        """Give a session whose changes are committed all or none, with those of all writes inside."""
        with self.together(), self.write() as session:
            act = _ACT.get()
            assert act is not None
            before, act.whole = act.whole, True
            try:
                yield session
            finally:
                act.whole = before

    @contextmanager
    def apart(self) -> Iterator[None]:
        """Let what is written inside be committed by itself, before the act that it prepares."""
        act = _ACT.get()
        if act is not None and act.session is not None:
            yield  # too late: the act holds the database
            return
        mark = _ACT.set(None)
        try:
            yield
        finally:
            _ACT.reset(mark)

    @contextmanager
    def _transaction(self) -> Iterator[Session]:
        if self.is_sqlite:
            with (
                self._writer.turn(),
                ReferredSession(self.write_engine, expire_on_commit=False) as session,
                session.begin(),
            ):
                yield session
        else:
            with ReferredSession(self.write_engine, expire_on_commit=False) as session, session.begin():
                tell_of(session)
                yield session

    def ping(self) -> None:
        """Raise unless the database answers."""
        with self.engine.connect() as connection:
            connection.execute(text("SELECT 1"))

    def size_bytes(self) -> int:
        """Return the size of the database on disk."""
        pages = "page_count * page_size FROM pragma_page_count(), pragma_page_size()"
        what = pages if self.is_sqlite else "pg_database_size(current_database())"
        with self.engine.connect() as connection:
            return int(connection.execute(text(f"SELECT {what}")).scalar_one())

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
        keep_odd_times(connection)
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


def _end_read(session: Session) -> None:
    """End what was read: psycopg forgets what it had prepared at each rollback, and a session closes by one.

    A read of four rows takes half as much of the server's processor time so.
    """
    if session.in_transaction():
        driver = session.connection().connection.driver_connection
        assert driver is not None
        driver.commit()


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
