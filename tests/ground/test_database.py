"""The way to the rows: connections that the server closed while they lay in the pool."""

from __future__ import annotations

from pathlib import Path

import psycopg
import pytest
import typer
from sqlalchemy import create_engine, event, text
from sqlalchemy.exc import OperationalError

from ground.cli.failure import refusals
from ground.gdr.database import Database
from ground.gdr.notices import CHANNEL, tell
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


@pytest.mark.postgres
def test_what_is_asked_often_stays_prepared_after_reads(postgres: PostgresServer) -> None:
    address = postgres.clone()
    database = Database(address)
    try:
        for _ in range(8):
            with database.read() as session:
                session.execute(text("SELECT id FROM missions")).all()
        with database.read() as session:
            held = session.execute(text("SELECT statement FROM pg_prepared_statements")).scalars().all()
        assert "SELECT id FROM missions" in held
    finally:
        database.dispose()
        postgres.drop(address)


@pytest.mark.postgres
def test_a_connection_that_is_lost_at_the_end_of_a_read_is_the_error_that_callers_know(
    postgres: PostgresServer,
) -> None:
    address = postgres.clone()
    database, server = Database(address), create_engine(postgres.address)

    def lose() -> None:
        with database.read() as session, server.connect() as connection:
            assert session.execute(text("SELECT count(*) FROM missions")).scalar() == 0
            connection.execute(text(CLOSE), {"name": database.url.database})

    try:
        with pytest.raises(OperationalError):
            lose()
        with database.read() as session:
            assert session.execute(text("SELECT count(*) FROM missions")).scalar() == 0
    finally:
        server.dispose()
        database.dispose()
        postgres.drop(address)


@pytest.mark.postgres
def test_a_read_that_fails_is_rolled_back(postgres: PostgresServer) -> None:
    address = postgres.clone()
    database = Database(address)

    def fail() -> None:
        with database.read() as session:
            session.execute(text("CREATE TABLE left_behind (id integer)"))
            raise KeyError

    try:
        with pytest.raises(KeyError):
            fail()
        with database.read() as session:
            assert session.execute(text("SELECT to_regclass('left_behind')")).scalar() is None
    finally:
        database.dispose()
        postgres.drop(address)


@pytest.mark.postgres
def test_a_transaction_tells_all_its_words_at_once(postgres: PostgresServer, tmp_path: Path) -> None:
    address = postgres.clone()
    repo = open_repository(settings_for(tmp_path / "data", address))
    ensure_profiles(repo)
    told: list[object] = []

    def note(_connection: object, _cursor: object, statement: str, given: object, *_rest: object) -> None:
        if "pg_notify" in statement:
            told.append(given)

    event.listen(repo.database.write_engine, "before_cursor_execute", note)
    plain = repo.database.url.set(drivername="postgresql").render_as_string(hide_password=False)
    try:
        with psycopg.connect(plain, autocommit=True) as listener:
            listener.execute(f"LISTEN {CHANNEL}")
            with repo.database.write() as session:
                tell(session, "one")
                tell(session, "two", "elsewhere")
                with session.begin_nested():
                    tell(session, "three")
                tell(session, "one")
            heard = [word.payload for word in listener.notifies(timeout=5.0, stop_after=2)]
        assert heard == ["one", "three"]
        assert len(told) == 1
    finally:
        repo.database.dispose()
        postgres.drop(address)
