"""A database of a study's or a benchmark's own on a PostgreSQL server, gone when it is over."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy import create_engine, text
from sqlalchemy.engine import URL, make_url

from ground.settings import load_settings


@contextmanager
def own_database(server: str) -> Iterator[str]:
    """Give the address of a new database on the PostgreSQL server at an address; of none, none: SQLite."""
    if not server:
        yield ""
        return
    there = make_url(load_settings(database_url=server).database_address)
    name = f"outcrop_study_{secrets.token_hex(4)}"
    _run(there, f'CREATE DATABASE "{name}"')
    try:
        yield there.set(database=name).render_as_string(hide_password=False)
    finally:
        _run(there, f'DROP DATABASE "{name}" WITH (FORCE)')


def _run(server: URL, statement: str) -> None:
    engine = create_engine(server, isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(text(statement))
    engine.dispose()
