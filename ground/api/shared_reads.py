"""Reads by key that share a statement: what is asked for while the database answers goes together next."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Collection, Iterable, Mapping
from functools import lru_cache, partial
from typing import Any, Generic, TypeVar

from sqlalchemy import ARRAY, Row, Select, String, any_, bindparam

from ground.gdr.repository import Repository
from ground.records.get_resource import shown_whole
from ground.records.kind import Kind

V = TypeVar("V")
Run = Callable[..., Awaitable[Any]]
"""Run a function in a thread and return what it returns."""


@lru_cache(maxsize=64)
def _some_of(kind: Kind[Any]) -> Select[Any]:
    wanted = bindparam("wanted", type_=ARRAY(String))
    return shown_whole(kind).where(kind.row.__table__.c.id == any_(wanted))


def read_rows(repo: Repository, kind: Kind[Any], identifiers: Iterable[str]) -> Mapping[str, Row[Any]]:
    """Return the rows that are there by their ids, read with one statement of PostgreSQL."""
    with repo.database.connection() as reader:
        found = reader.execute(_some_of(kind), {"wanted": list(identifiers)})
        return {row.id: row for row in found}


class SharedReads(Generic[V]):
    """Reads of one kind of thing; each begins after it was asked for, so nobody sees an older one."""

    AT_ONCE = 500
    """More than that are read in turns: what is read for all keeps nobody's answer long."""

    def __init__(self, run: Run, read: Callable[[Collection[str]], Mapping[str, V]]) -> None:
        self._run, self._read_many = run, read
        self._waiting: dict[str, asyncio.Future[V | None]] = {}
        self._reader: asyncio.Task[None] | None = None

    async def get(self, key: str) -> V | None:
        """Return what is there under a key, or None."""
        future = self._waiting.get(key)
        if future is None:
            future = self._waiting[key] = asyncio.get_running_loop().create_future()
        if self._reader is None:
            self._reader = asyncio.create_task(self._read())
        return await asyncio.shield(future)

    async def _read(self) -> None:
        """Read what is waited for, until nothing is."""
        try:
            while self._waiting:
                keys = list(self._waiting)[: self.AT_ONCE]
                some = {key: self._waiting.pop(key) for key in keys}
                try:
                    found = await self._run(self._read_many, keys)
                except Exception as err:  # noqa: BLE001 - told to all who wait
                    for future in some.values():
                        future.set_exception(err)
                else:
                    for key, future in some.items():
                        future.set_result(found.get(key))
        finally:
            self._reader = None


class RowReads:
    """The reads by key of one server, by kind."""

    def __init__(self, repo: Repository, run: Run) -> None:
        self._repo, self._run = repo, run
        self._kinds: dict[Kind[Any], SharedReads[Row[Any]]] = {}

    async def row(self, kind: Kind[Any], identifier: str) -> Any:
        """Return a row for `show`, or None."""
        reads = self._kinds.get(kind)
        if reads is None:
            reads = self._kinds[kind] = SharedReads(self._run, partial(read_rows, self._repo, kind))
        return await reads.get(identifier)
