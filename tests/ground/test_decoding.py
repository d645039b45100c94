"""What somebody wrote into the database behind the server is refused by the name of its column."""

from __future__ import annotations

from datetime import datetime
from typing import Any

import pytest
from sqlalchemy import Column, MetaData, Select, Table, insert, select, text

from ground.errors import DamagedDataError
from ground.gdr.repository import Repository
from ground.resources.missions.value import Mission
from ground.resources.tables import METADATA
from tests.ground.conftest import Api
from tests.ground.test_missions_api import problem

SQLITE: dict[type, list[Any]] = {
    int: ["x", "1.5", b"\xff", 1.5],
    float: ["x", b"1"],
    str: [b"x", b"\xff"],
    bool: ["x", 2, 0.5, b"1"],
    bytes: ["x", 7],
    datetime: ["x", "{}", 10**12, 1.5, b"x", "2026-13-01 00:00:00", ""],
    dict: ["", "x", "[]", "null", "7", 7, "{", '"a"', b"{}\xff", "[" * 100_000, '{"a": ' + "9" * 5000 + "}"],
    list: ["", "x", "{}", "null", "true", 1.5],
}
"""Values that SQLite keeps in a column of a type, whatever its declared type."""
POSTGRES: dict[type, list[Any]] = {
    datetime: ["infinity", "-infinity", "20000-01-01", "0044-03-15 BC"],
    dict: ["[]", "null", "7", '"a"', "[" * 3000 + "]" * 3000, '{"a": ' + "9" * 5000 + "}"],
    list: ["{}", "null", "true"],
}
"""Those that fit a column of PostgreSQL, and no value of ours."""
FITTING: dict[type, Any] = {
    int: 1,
    float: 1,
    str: "x",
    bool: True,
    bytes: b"x",
    datetime: datetime.fromisoformat("2026-01-01T00:00:00+00:00"),
    dict: {"a": None},
    list: [1, "a"],
}


def columns() -> list[Column[Any]]:
    """Return one column of each type of value."""
    found: dict[type, Column[Any]] = {}
    for table in METADATA.sorted_tables:
        for column in table.columns:
            if not column.foreign_keys and not column.primary_key:
                found.setdefault(column.type.python_type, column)
    return list(found.values())


def alone(table: Table, column: Column[Any]) -> Table:
    """Return a table of the same name with this one column, so that no key or check stands in the way."""
    return Table(table.name, MetaData(), Column(column.name, column.type, key=column.key))


def test_a_value_that_is_not_of_its_columns_type_is_refused_by_the_columns_name(repo: Repository) -> None:
    junk = SQLITE if repo.database.is_sqlite else POSTGRES
    told = 0
    for column in columns():
        python = column.type.python_type
        table = alone(column.table, column)
        with repo.database.engine.begin() as connection:
            connection.execute(
                text(f"DROP TABLE {table.name}" + ("" if repo.database.is_sqlite else " CASCADE"))
            )
            table.create(connection)
            connection.execute(insert(table), [{column.name: FITTING[python]}, {column.name: None}])
        query: Select[Any] = select(table.c[column.name]).order_by(table.c[column.name].is_(None))
        with repo.database.read() as session:
            assert session.scalars(query).all() == [FITTING[python], None]
        for value in junk.get(python, []):
            put = text(f"UPDATE {table.name} SET {column.name} = :value")
            if not repo.database.is_sqlite:
                kind = "timestamptz" if python is datetime else "json"
                put = text(f"UPDATE {table.name} SET {column.name} = CAST(:value AS {kind})")
            with repo.database.engine.begin() as connection:
                connection.execute(put, {"value": value})
            place = f"the table {table.name} holds in {column.name} "
            with pytest.raises(DamagedDataError, match=place), repo.database.read() as session:
                session.execute(query).all()
            with pytest.raises(DamagedDataError, match=place), repo.database.connection() as bare:
                bare.execute(query).all()
            told += 1
        with repo.database.engine.begin() as connection:
            table.drop(connection)
            METADATA.tables[table.name].create(connection)
    assert told == sum(len(values) for values in junk.values())


def test_a_damaged_row_is_a_problem_in_words_and_no_reason_to_stop(api: Api, mission: Mission) -> None:
    target = api.post(f"/missions/{mission.id}/targets", {"name": "T", "east_m": 2.0, "north_m": 1.0})["id"]
    junk = "{}" if api.repo.database.is_sqlite else "infinity"
    with api.repo.database.engine.begin() as connection:
        connection.execute(text("UPDATE targets SET created_utc = '" + junk + "'"))
    for path in (f"/targets/{target}", f"/missions/{mission.id}/targets", f"/missions/{mission.id}/archive"):
        answer = problem(api("GET", path), 503, "data-damaged")
        assert "the table targets holds in created_utc" in answer["detail"], path
    assert api.get(f"/missions/{mission.id}")["id"] == mission.id
    assert api.get(f"/missions/{mission.id}/sols")["items"]
