"""Bring the database to the schema of this version."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import text

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

    Two servers that start at once do it one after the other.
    """
    before = current_revision(database)
    made = config()
    with database.write_engine.begin() as connection:
        if not database.is_sqlite:
            connection.execute(text(f"SELECT pg_advisory_xact_lock({_LOCK})"))
        made.attributes["connection"] = connection
        if down:
            command.downgrade(made, revision)
        else:
            command.upgrade(made, revision)
    return before, current_revision(database)
