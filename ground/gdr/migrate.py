"""Bring the database to the schema of this version."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.resources import files
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, text

from ground.errors import ConflictError
from ground.gdr.database import Database

_LOCK = 7_215_036_411


def migrations_dir() -> Path:
    """Return the folder of the migrations: in the installed package, else in the checkout."""
    packaged = Path(str(files("ground") / "migrations"))
    return packaged if packaged.is_dir() else Path(__file__).resolve().parents[2] / "migrations"


def config() -> Config:
    """Return the configuration handed to Alembic."""
    made = Config()
    made.set_main_option("script_location", str(migrations_dir()))
    made.set_main_option("path_separator", "os")
    return made


@cache
def newest_revision() -> str:
    """Return the revision this version of the program needs."""
    head = ScriptDirectory.from_config(config()).get_current_head()
    assert head is not None
    return head


def current_revision(database: Database) -> str | None:
    """Return the revision of the database, None for an empty one."""
    with database.engine.connect() as connection:
        return MigrationContext.configure(connection).get_current_revision()


def migrate(
    database: Database, revision: str = "head", *, down: bool = False
) -> tuple[str | None, str | None]:
    """Bring the database to a revision; return the revisions before and after.

    Two servers that start at once do it one after the other. Nothing is changed if a step fails.

    Raises
    ------
    ConflictError
        If rows would be left that refer to rows which are no more.
    """
    before = current_revision(database)
    made = config()
    begun = _sqlite_transaction if database.is_sqlite else _postgres_transaction
    with begun(database) as connection:
        made.attributes["connection"] = connection
        if down:
            command.downgrade(made, revision)
        else:
            command.upgrade(made, revision)
    return before, current_revision(database)


@contextmanager
def _postgres_transaction(database: Database) -> Iterator[Connection]:
    with database.write_engine.begin() as connection:
        connection.execute(text(f"SELECT pg_advisory_xact_lock({_LOCK})"))
        yield connection


@contextmanager
def _sqlite_transaction(database: Database) -> Iterator[Connection]:
    """Give a transaction that does not enforce foreign keys, and look for broken ones at its end.

    SQLite alters a table in most ways only by making it anew, and to drop the old one deletes its rows: where
    foreign keys are enforced, `ON DELETE CASCADE` takes those of other tables along. They can be switched off
    outside of a transaction alone (https://www.sqlite.org/lang_altertable.html, section 7).
    """
    with database.write_engine.connect() as connection:
        _enforce(connection, False)
        try:
            with connection.begin():
                broken = _broken(connection)
                yield connection
                _refuse(_broken(connection) - broken)
        finally:
            _enforce(connection, True)


def _enforce(connection: Connection, on: bool) -> None:
    """Switch foreign keys of a SQLite connection on or off, which a transaction would silently ignore."""
    driver = connection.connection.dbapi_connection
    assert driver is not None
    cursor = driver.cursor()
    cursor.execute(f"PRAGMA foreign_keys={'ON' if on else 'OFF'}")
    found = cursor.execute("PRAGMA foreign_keys").fetchone()
    cursor.close()
    assert found == (int(on),)


def _broken(connection: Connection) -> Counter[tuple[str, str]]:
    """Count rows that refer to none, by their table and the one that they refer to."""
    found = connection.exec_driver_sql("PRAGMA foreign_key_check").all()
    return Counter((table, parent) for table, _row, parent, _key in found)


def _refuse(broken: Counter[tuple[str, str]]) -> None:
    if broken:
        named = ", ".join(
            f"{count} {'row' if count == 1 else 'rows'} of {table} that refer to no row of {parent}"
            for (table, parent), count in sorted(broken.items())
        )
        raise ConflictError(f"the migration would leave {named}; nothing was changed")
