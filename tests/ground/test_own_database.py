"""What a benchmark or a study makes on a PostgreSQL server is gone when it is over."""

from __future__ import annotations

import pytest
from sqlalchemy import create_engine, inspect, make_url, text

from benchmarks.common.served import place, repository
from studies.common.databases import own_database
from tests.ground.conftest import PostgresServer


def databases(address: str) -> set[str | None]:
    engine = create_engine(address)
    with engine.connect() as connection:
        found = set(connection.scalars(text("SELECT datname FROM pg_database")))
    engine.dispose()
    return found


@pytest.mark.postgres
def test_a_benchmark_works_in_a_database_of_its_own_which_is_gone_also_after_a_fault(
    postgres: PostgresServer,
) -> None:
    made: list[str | None] = []

    def fail_in_the_middle() -> None:
        with place(postgres.address) as environment, repository(environment) as repo:
            made.append(make_url(environment["OUTCROP_DATABASE_URL"]).database)
            assert "missions" in inspect(repo.database.engine).get_table_names()
            assert set(made) < databases(postgres.address)
            raise RuntimeError("in the middle")

    with pytest.raises(RuntimeError, match="in the middle"):
        fail_in_the_middle()
    assert made[0] != make_url(postgres.address).database
    assert not set(made) & databases(postgres.address)


def test_without_a_server_there_is_no_address() -> None:
    with own_database("") as own:
        assert own == ""
