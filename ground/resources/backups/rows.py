"""The rows of a repository as lines of JSON, and back; those of an older schema are brought to this one."""

from __future__ import annotations

import json
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from datetime import datetime
from itertools import groupby
from pathlib import Path
from typing import Any

from alembic.util import CommandError
from sqlalchemy import JSON, DateTime, MetaData, Table, event, insert, select
from sqlalchemy.orm import Session

from ground.errors import ArchiveError
from ground.gdr.base import Columns, Utc
from ground.gdr.database import Database
from ground.gdr.migrate import migrate, newest_revision
from ground.resources.tables import METADATA
from mission.codec import Document

KEPT_APART = ("credentials", "webhook_states")
"""Tables of secrets: keys of API clients, and what webhooks are signed with."""
LEFT_OUT = frozenset({*KEPT_APART, "login_failures", "invitations", "idempotency_keys", "webhook_deliveries"})
"""Tables of sessions, keys and the day's answers."""

Record = tuple[str, Columns]
"""A table's name, and a row of it as JSON values."""


def plain(row: Any) -> dict[str, object]:
    """Return a row as JSON values."""
    return {k: v.isoformat() if isinstance(v, datetime) else v for k, v in row.items()}


def read_rows(session: Session, left_out: frozenset[str] = LEFT_OUT) -> Iterator[Record]:
    """Yield every row, a table after those that it refers to."""
    for table in METADATA.sorted_tables:
        if table.name not in left_out:
            for row in session.execute(select(table)).mappings():
                yield table.name, plain(row)


def parse_rows(content: bytes, secrets: Document) -> list[Record]:
    """Return the rows of a backup, with its secrets where they belong."""
    records: list[Record] = [(name, row) for name, row in map(json.loads, content.decode().splitlines())]
    hashes = secrets.get("passwords", {})
    for name, row in records:
        if name == "people" and row["id"] in hashes:
            row["password_hash"] = hashes[row["id"]]
    return records + [(name, row) for name in KEPT_APART for row in secrets.get(name, ())]


def fill(session: Session, metadata: MetaData, records: Iterable[Record]) -> None:
    """Put rows in the place of all that there are."""
    for table in reversed(metadata.sorted_tables):
        session.execute(table.delete())
    for (name, _), rows in groupby(records, key=lambda record: (record[0], tuple(record[1]))):
        table = metadata.tables[name]
        session.execute(insert(table), [_typed(table, row) for _, row in rows])


def _typed(table: Table, row: Columns) -> Columns:
    """Return a row of a backup as the database takes it."""
    return {
        name: datetime.fromisoformat(value)
        if isinstance(table.c[name].type, Utc) and isinstance(value, str)
        else value
        for name, value in row.items()
    }


def brought_up(records: list[Record], revision: str) -> list[Record]:
    """Return rows of the schema of a revision as they stand in the schema of this version.

    They are migrated as a database would be: in one that is thrown away.

    Raises
    ------
    ArchiveError
        If this version does not know the revision: the backup is of a newer one. If rows are lost on the way.
    """
    if revision == newest_revision():
        return records
    with tempfile.TemporaryDirectory(prefix="outcrop-rows-") as work:
        database = Database(f"sqlite:///{Path(work) / 'rows.db'}")
        try:
            migrate(database, revision)
            with database.write() as session:
                fill(session, _schema_of(database), records)
            migrate(database)
            with database.read() as session:
                found = list(read_rows(session, frozenset()))
        except CommandError as err:
            raise ArchiveError(
                f"the backup has the schema {revision!r}, which this version of outcrop does not know; "
                f"it knows those up to {newest_revision()}"
            ) from err
        finally:
            database.dispose()
    short = shrunken(records, found)
    if short:
        raise ArchiveError(
            f"rows were lost between the schemas {revision} and {newest_revision()}: {short[0]}"
        )
    return found


def shrunken(before: Iterable[Record], after: Iterable[Record]) -> list[str]:
    """Return a sentence for each table that has fewer rows than earlier."""
    had, has = (Counter(name for name, _ in records) for records in (before, after))
    return [
        f"{has[name]} of {n} rows of {name} came back" for name, n in sorted(had.items()) if has[name] < n
    ]


def _schema_of(database: Database) -> MetaData:
    """Return the tables of a database as they are, with our types for times and JSON."""
    found = MetaData()

    @event.listens_for(found, "column_reflect")
    def _on_column(_inspector: object, _table: object, column: Any) -> None:
        if isinstance(column["type"], DateTime):
            column["type"] = Utc()
        elif isinstance(column["type"], JSON):
            column["type"] = JSON(none_as_null=True)

    found.reflect(database.engine)
    found.remove(found.tables["alembic_version"])
    return found
