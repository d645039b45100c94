"""No migration, however it is written, loses a row: one in every table, each step up and down."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from alembic.script import ScriptDirectory
from sqlalchemy import (
    JSON,
    Boolean,
    Column,
    DateTime,
    Float,
    Integer,
    LargeBinary,
    MetaData,
    String,
    insert,
    inspect,
    select,
    text,
)
from sqlalchemy.exc import IntegrityError

from ground.errors import GroundError
from ground.gdr import migrate as migrating
from ground.gdr.database import Database
from ground.gdr.migrate import config, current_revision, migrate, newest_revision

Rows = dict[str, list[dict[str, Any]]]
VERSIONS = [s.revision for s in ScriptDirectory.from_config(config()).walk_revisions()][::-1]
CREDENTIALS = {"people", "credentials", "signing_keys"}


@pytest.fixture
def with_profiles() -> bool:
    return False  # each table gets one row of the tests' own


@pytest.fixture
def database(database_address: str) -> Iterator[Database]:
    found = Database(database_address)
    yield found
    found.dispose()


def schema(database: Database) -> MetaData:
    found = MetaData()
    found.reflect(database.engine)
    found.remove(found.tables["alembic_version"])
    return found


def rows(database: Database, tables: MetaData | None = None) -> Rows:
    """Return the rows of all tables, whose schema takes longer to read than they do."""
    with database.engine.connect() as connection:
        return {
            table.name: [dict(row) for row in connection.execute(select(table)).mappings()]
            for table in (tables or schema(database)).sorted_tables
        }


def value_of(column: Column[Any]) -> object:
    """Return something that the column takes; what refers to another table refers to its row."""
    if column.foreign_keys:
        return value_of(next(iter(column.foreign_keys)).column)
    if column.name == "in_making":
        return False  # what is being copied does not outlive a step down: the test below
    kinds: list[tuple[Any, object]] = [
        (JSON, {"some": ["thing"]}),
        (Boolean, True),
        (DateTime, datetime(2026, 1, 1, tzinfo=UTC)),
        (LargeBinary, b"some"),
        (Integer, 7),
        (Float, 0.5),
    ]
    for kind, value in kinds:
        if isinstance(column.type, kind):
            return value
    assert isinstance(column.type, String), column
    return f"{column.table.name}-1"[: column.type.length]


def fill(database: Database, tables: MetaData | None = None) -> None:
    """Put a row into every table that has none."""
    tables = tables or schema(database)
    there = rows(database, tables)
    with database.write_engine.begin() as connection:
        for table in tables.sorted_tables:
            if not there[table.name]:
                values = {column.name: value_of(column) for column in table.columns if not column.nullable}
                connection.execute(insert(table), values)


def kept(before: Rows, after: Rows) -> None:
    """Assert that the rows of tables that are still there are the same in the columns that are."""
    for name in before.keys() & after.keys():
        assert len(after[name]) == len(before[name]) > 0, name
        for old, new in zip(before[name], after[name], strict=True):
            assert {k: old[k] for k in old if k in new} == {k: new[k] for k in new if k in old}, name


def test_every_table_keeps_its_row_at_each_step_up_and_down(database: Database) -> None:
    migrate(database, VERSIONS[0], down=True)
    tables = schema(database)
    for revision in VERSIONS[1:]:
        fill(database, tables)
        before = rows(database, tables)
        migrate(database, revision)
        tables = schema(database)
        after = rows(database, tables)
        assert before.keys() <= after.keys()
        kept(before, after)
    fill(database, tables)
    before = rows(database, tables)
    for revision in VERSIONS[-2::-1]:
        migrate(database, revision, down=True)
        after = rows(database)
        kept(before, after)
        before = after


@pytest.mark.parametrize("revision", ["0009", "0013"])
def test_every_table_keeps_its_row_on_the_way_to_this_version(database: Database, revision: str) -> None:
    migrate(database, revision, down=True)
    fill(database)
    before = rows(database)
    migrate(database)
    after = rows(database)
    assert CREDENTIALS <= before.keys() <= after.keys()
    kept(before, after)


def one_more(folder: Path, monkeypatch: pytest.MonkeyPatch, upgrade: str) -> str:
    """Add a migration behind the newest; return its revision."""
    newest, revision = newest_revision(), "9000"
    shutil.copytree(migrating.migrations_dir(), folder)
    (folder / "versions" / f"{revision}_test.py").write_text(
        f'from alembic import op\nimport sqlalchemy as sa\nrevision = "{revision}"\n'
        f'down_revision = "{newest}"\n\n\ndef upgrade():\n    {upgrade}\n'
    )
    monkeypatch.setattr(migrating, "migrations_dir", lambda: folder)
    return revision


def enforced(database: Database) -> list[int]:
    """Return whether connections hold rows to what they refer to: that of the migration, and another."""
    with database.write_engine.connect() as first, database.engine.connect() as second:
        return [c.execute(text("PRAGMA foreign_keys")).scalar_one() for c in (first, second)]


@pytest.mark.parametrize("table", ["people", "missions"])
def test_a_table_that_is_made_anew_takes_no_other_with_it(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, table: str
) -> None:
    fill(database)
    before = rows(database)
    batch = f'with op.batch_alter_table("{table}", recreate="auto") as t: '
    added = batch.replace("auto", "always" if database.is_sqlite else "auto")
    revision = one_more(tmp_path / "m", monkeypatch, added + 't.add_column(sa.Column("more", sa.Text()))')
    migrate(database)
    assert current_revision(database) == revision
    kept(before, rows(database))
    if database.is_sqlite:
        assert enforced(database) == [1, 1]
        with pytest.raises(IntegrityError), database.write() as session:
            session.execute(text("UPDATE credentials SET person_id = 'nobody'"))


def test_a_migration_that_leaves_rows_without_their_owner_is_undone_and_named(
    tmp_path: Path, sqlite_template: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copyfile(sqlite_template, tmp_path / "x.db")
    database = Database(f"sqlite:///{tmp_path / 'x.db'}")
    fill(database)
    before, newest = rows(database), newest_revision()
    one_more(tmp_path / "m", monkeypatch, 'op.execute("DELETE FROM people")')
    with pytest.raises(GroundError, match=r"1 row of credentials .* people, 1 row of signing_keys .* people"):
        migrate(database)
    assert current_revision(database) == newest
    assert rows(database) == before
    assert enforced(database) == [1, 1]
    database.dispose()


@pytest.mark.parametrize("old", [False, True])
def test_a_database_whose_0014_was_made_by_a_batch_goes_down_too(database: Database, old: bool) -> None:
    if old:
        with database.write_engine.begin() as connection:
            connection.execute(text("DROP INDEX ix_people_external_sha256"))
            if not database.is_sqlite:
                connection.execute(
                    text(
                        "ALTER TABLE people ADD CONSTRAINT uq_people_external_sha256 UNIQUE (external_sha256)"
                    )
                )
        if database.is_sqlite:
            _rebuild_with_constraint(database)
    fill(database)
    before = rows(database)
    migrate(database, "0013", down=True)
    assert "external_sha256" not in {c["name"] for c in inspect(database.engine).get_columns("people")}
    below = rows(database).keys()
    migrate(database)
    kept({name: there for name, there in before.items() if name in below}, rows(database))


def test_what_was_being_copied_goes_with_all_that_is_its_own(database: Database) -> None:
    fill(database)
    with database.write_engine.begin() as connection:
        connection.execute(text("UPDATE missions SET in_making = true"))
    migrate(database, "0015", down=True)
    left = rows(database)
    assert not left["missions"]
    assert not left["targets"]
    assert left["people"]


def _rebuild_with_constraint(database: Database) -> None:
    from alembic.migration import MigrationContext
    from alembic.operations import Operations

    with database.write_engine.begin() as connection:
        op = Operations(MigrationContext.configure(connection))
        with op.batch_alter_table("people") as table:
            table.create_unique_constraint("uq_people_external_sha256", ["external_sha256"])
