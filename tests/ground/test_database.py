"""The way to the rows: connections that the server closed while they lay in the pool."""

from __future__ import annotations

import pytest
from sqlalchemy import create_engine, text

from ground.gdr.database import Database
from tests.ground.conftest import PostgresServer

CLOSE = (
    "SELECT count(pg_terminate_backend(pid, 5000)) FROM pg_stat_activity "
    "WHERE datname = :name AND pid <> pg_backend_pid()"
)


@pytest.mark.postgres
def test_the_first_requests_after_a_restart_of_the_server_do_not_fail(postgres: PostgresServer) -> None:
    address = postgres.clone()
    database = Database(address)

    def use() -> list[int]:
        pid = text("SELECT pg_backend_pid()")
        with database.read() as one, database.read() as two, database.connection() as bare:
            found = [session.scalar(pid) for session in (one, two)] + [bare.scalar(pid)]
        with database.write() as session:
            session.execute(text("CREATE TABLE IF NOT EXISTS kept (n integer)"))
            session.execute(text("INSERT INTO kept VALUES (1)"))
        return [int(n or 0) for n in found]

    before = use()
    assert use() == before or sorted(use()) == sorted(before)  # the pool keeps what is alive
    server = create_engine(postgres.address)
    with server.connect() as connection:
        closed = connection.scalar(text(CLOSE), {"name": database.url.database})
    server.dispose()
    assert closed == len(set(before))
    after = use()
    assert not set(before) & set(after)
    with database.read() as session:
        assert session.scalar(text("SELECT count(*) FROM kept")) in {3, 4}
    database.dispose()
    postgres.drop(address)
