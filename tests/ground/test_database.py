"""The way to the rows: connections that the server closed while they lay in the pool."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer
from sqlalchemy import create_engine, event, text

from ground.cli.failure import refusals
from ground.gdr.database import Database
from ground.gdr.repository import open_repository
from ground.records.actor import Actor, Role
from ground.resources.people.accounts import create_person, ensure_profiles
from tests.ground.conftest import PostgresServer, open_api, settings_for
from tests.ground.test_missions_api import problem

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


@pytest.mark.postgres
def test_a_connection_that_is_lost_in_a_request_is_told_in_words(
    postgres: PostgresServer, tmp_path: Path
) -> None:
    address = postgres.clone()
    repo = open_repository(settings_for(tmp_path / "data", address))
    ensure_profiles(repo)
    server = create_engine(postgres.address)

    def lose(_connection: object, _cursor: object, statement: str, *_rest: object) -> None:
        if statement.startswith("INSERT INTO people"):
            with server.connect() as connection:
                connection.execute(text(CLOSE), {"name": repo.database.url.database})

    event.listen(repo.database.write_engine, "before_cursor_execute", lose)
    body = {"name": "New", "role": "viewer"}
    for api in open_api(repo):
        answer = problem(api("POST", "/people", body, who="Administrator"), 503, "unavailable")
        assert "can be sent again" in answer["detail"]
        assert api.get("/people", who="Administrator")
    with pytest.raises(typer.Exit), refusals():
        create_person(repo, Actor("Administrator", Role.ADMIN), name="New", role=Role.VIEWER)
    repo.database.dispose()
    server.dispose()
    postgres.drop(address)
