"""Reads by key that share a statement: what is asked for while the database answers goes together next."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

from sqlalchemy import ARRAY, Row, Select, String, any_, bindparam
from starlette.concurrency import run_in_threadpool

from ground.gdr.repository import Repository
from ground.records.kind import Kind

_Waiting = dict[str, asyncio.Future[Any]]


@lru_cache(maxsize=64)
def _some_of(kind: Kind[Any]) -> Select[Any]:
    wanted = bindparam("wanted", type_=ARRAY(String))
    return kind.shown().where(kind.row.__table__.c.id == any_(wanted))


def read_rows(repo: Repository, kind: Kind[Any], identifiers: Iterable[str]) -> Mapping[str, Row[Any]]:
    """Return the rows that are there by their ids, read with one statement of PostgreSQL."""
    with repo.database.connection() as reader:
        found = reader.execute(_some_of(kind), {"wanted": list(identifiers)})
        return {row.id: row for row in found}


class SharedReads:
    """The reads by key of one server; each begins after it was asked for, so nobody sees an older row."""

    def __init__(self, repo: Repository) -> None:
        self._repo = repo
        self._waiting: dict[Kind[Any], _Waiting] = {}
        self._readers: dict[Kind[Any], asyncio.Task[None]] = {}

    async def row(self, kind: Kind[Any], identifier: str) -> Any:
        """Return a row for `show`, or None."""
        waiting = self._waiting.setdefault(kind, {})
        future = waiting.get(identifier)
        if future is None:
            future = waiting[identifier] = asyncio.get_running_loop().create_future()
        if kind not in self._readers:
            self._readers[kind] = asyncio.create_task(self._read(kind))
        return await asyncio.shield(future)

    async def _read(self, kind: Kind[Any]) -> None:
        """Read what is waited for, until nothing is."""
        try:
            while some := self._waiting.pop(kind, None):
                try:
                    rows = await run_in_threadpool(read_rows, self._repo, kind, some)
                except Exception as err:  # noqa: BLE001 - told to all who wait
                    for future in some.values():
                        future.set_exception(err)
                else:
                    for identifier, future in some.items():
                        future.set_result(rows.get(identifier))
        finally:
            del self._readers[kind]
