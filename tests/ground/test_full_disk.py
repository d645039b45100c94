"""A full disk is said to be one, whichever part meets it."""

from __future__ import annotations

import errno

import orjson
import pytest
from sqlalchemy import create_engine, text
from sqlalchemy.exc import OperationalError

from ground.api.problems import from_anything


def _told(error: Exception) -> tuple[int, str]:
    answer = from_anything("/api/v1/uploads", error)
    return answer.status_code, str(orjson.loads(answer.body)["type"]).removeprefix("urn:outcrop:problem:")


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT])
def test_a_file_that_finds_no_room_is_told(number: int) -> None:
    assert _told(OSError(number, "no room")) == (507, "storage-full")


def test_a_database_that_finds_no_room_is_told() -> None:
    engine = create_engine("sqlite://")
    with engine.connect() as connection:
        connection.execute(text("CREATE TABLE t (x BLOB)"))
        connection.execute(text("PRAGMA max_page_count = 8"))
        with pytest.raises(OperationalError) as caught:
            connection.execute(text("INSERT INTO t VALUES (zeroblob(1000000))"))
    assert _told(caught.value) == (507, "storage-full")


def test_what_only_came_of_it_is_told_too() -> None:
    error = RuntimeError("the upload was not kept")
    error.__cause__ = OSError(errno.ENOSPC, "no room")
    assert _told(error) == (507, "storage-full")


def test_other_errors_are_not_taken_for_it() -> None:
    assert _told(OSError(errno.EACCES, "not yours")) == (500, "internal-error")
