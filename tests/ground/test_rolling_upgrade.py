"""Two versions beside each other on one database: the newer schema must do for the program before it.

Expand, then contract: a migration only adds what the version before need not know. What nobody uses any
more is removed in a later release, by a migration that is named here with the release that stopped using it.
"""

from __future__ import annotations

from pathlib import Path

import pytest
import typer
from alembic.script import ScriptDirectory
from sqlalchemy import MetaData, UniqueConstraint, text

from ground.cli.repository import require_migrated
from ground.gdr.database import Database
from ground.gdr.migrate import config, migrate, newest_revision
from tests.ground.conftest import Api

CONTRACTS: dict[str, str] = {}
"""Migrations that take away, each with the release that no longer used what goes."""
SINCE = "0017"
"""The first migration that is held to it; servers of versions before are stopped for the upgrade."""


def schema(database: Database) -> MetaData:
    found = MetaData()
    found.reflect(database.engine)
    return found


def taken_away(before: MetaData, after: MetaData) -> list[str]:
    """Return what a program that knows the schema `before` would miss or be refused by in the one `after`."""
    odd = [f"table {name} goes" for name in before.tables.keys() - after.tables.keys()]
    for name in before.tables.keys() & after.tables.keys():
        old, new = before.tables[name], after.tables[name]
        odd += [
            f"column {name}.{column} goes" for column in set(old.columns.keys()) - set(new.columns.keys())
        ]
        for column in new.columns:
            was = old.columns.get(column.name)
            if was is None and not column.nullable and column.server_default is None:
                odd.append(f"column {name}.{column.name} must be given and has no default of the database")
            if was is not None and was.nullable and not column.nullable:
                odd.append(f"column {name}.{column.name} may be empty no more")
            if was is not None and str(was.type) != str(column.type):
                odd.append(f"column {name}.{column.name} is {column.type}, it was {was.type}")
        odd += [f"{name}: {', '.join(key)} must be one of a kind" for key in _unique(new) - _unique(old)]
        old_refs, new_refs = ({str(key.target_fullname) for key in t.foreign_keys} for t in (old, new))
        odd += [f"{name} must refer to {target}" for target in new_refs - old_refs]
    return sorted(odd)


def _unique(table: object) -> set[tuple[str, ...]]:
    constraints = table.constraints  # type: ignore[attr-defined]
    found = {tuple(sorted(c.columns.keys())) for c in constraints if isinstance(c, UniqueConstraint)}
    indexes = table.indexes  # type: ignore[attr-defined]
    return found | {tuple(sorted(index.columns.keys())) for index in indexes if index.unique}


def steps() -> list[tuple[str, str]]:
    """Return each migration that is held to the rule, with the one before it."""
    walked = ScriptDirectory.from_config(config()).walk_revisions()
    return [
        (str(step.down_revision), step.revision)
        for step in walked
        if step.revision >= SINCE and step.revision not in CONTRACTS
    ]


@pytest.mark.parametrize(("before", "after"), steps())
def test_a_migration_takes_nothing_away_that_the_version_before_needs(
    before: str, after: str, tmp_path: Path
) -> None:
    database = Database(f"sqlite:///{tmp_path / 'outcrop.db'}")
    migrate(database, before)
    old = schema(database)
    migrate(database, after)
    assert taken_away(old, schema(database)) == []
    database.dispose()


CASES = {
    "DROP TABLE runs": "table runs goes",
    "ALTER TABLE runs DROP COLUMN state": "column runs.state goes",
    "ALTER TABLE runs ADD COLUMN mood TEXT NOT NULL DEFAULT 'calm'": "",
    "ALTER TABLE runs ADD COLUMN mood TEXT": "",
    "CREATE TABLE runs (id TEXT PRIMARY KEY, state TEXT NOT NULL)": "column runs.state may be empty no more",
    "CREATE TABLE runs (id TEXT PRIMARY KEY, state INTEGER)": "column runs.state is INTEGER, it was TEXT",
    "CREATE TABLE runs (id TEXT PRIMARY KEY, state TEXT, mood TEXT NOT NULL)": (
        "column runs.mood must be given and has no default of the database"
    ),
    "CREATE UNIQUE INDEX one ON runs (state)": "runs: state must be one of a kind",
    "CREATE INDEX some ON runs (state)": "",
    "CREATE TABLE moods (id TEXT PRIMARY KEY)": "",
    "CREATE TABLE runs (id TEXT PRIMARY KEY, state TEXT REFERENCES moods (id)); "
    "CREATE TABLE moods (id TEXT)": "runs must refer to moods.id",
}


@pytest.mark.parametrize("change", CASES)
def test_what_would_stop_the_version_before_is_seen(change: str, tmp_path: Path) -> None:
    database = Database(f"sqlite:///{tmp_path / 'outcrop.db'}")
    with database.engine.begin() as connection:
        connection.execute(text("CREATE TABLE runs (id TEXT PRIMARY KEY, state TEXT)"))
    before = schema(database)
    with database.engine.begin() as connection:
        for statement in change.split("; "):
            if statement.startswith("CREATE TABLE runs"):
                connection.execute(text("DROP TABLE runs"))
            connection.execute(text(statement))
    assert taken_away(before, schema(database)) == [CASES[change]] * bool(CASES[change])
    database.dispose()


def test_a_server_of_the_version_before_stays_ready_and_says_that_it_is_old(api: Api) -> None:
    newer = f"{int(newest_revision()) + 1:04d}"
    with api.repo.database.write() as session:
        session.execute(text("UPDATE alembic_version SET version_num = :newer"), {"newer": newer})
    told = api.get("/readyz")
    assert told["status"] == "degraded"
    ours = newest_revision()
    assert told["checks"]["schema"] == (
        f"degraded: the database is at revision {newer}, newer than this program's {ours}: upgrade it"
    )
    assert api.get("/missions")["items"] == []


def test_an_older_program_is_not_started_on_a_newer_schema(
    api: Api, capsys: pytest.CaptureFixture[str]
) -> None:
    newer = f"{int(newest_revision()) + 1:04d}"
    with api.repo.database.write() as session:
        session.execute(text("UPDATE alembic_version SET version_num = :newer"), {"newer": newer})
    with pytest.raises(typer.Exit) as ended:
        require_migrated(api.repo.settings)
    assert ended.value.exit_code == 2
    told = f"the database is at revision {newer}, newer than this program's {newest_revision()}"
    assert capsys.readouterr().err == f"outcrop: {told}: install the newer version\n"
