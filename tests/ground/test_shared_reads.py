"""Reads by key that share a statement: each has its own row, and none an older one than when it asked."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from ground.api import shared_reads
from ground.gdr.repository import Repository
from ground.resources.kinds import KINDS

SOL = KINDS["sol"]


@pytest.mark.parametrize("fails", [False, True])
def test_what_is_asked_for_meanwhile_is_read_next_and_together(
    repo: Repository, monkeypatch: pytest.MonkeyPatch, fails: bool
) -> None:
    asked: list[list[str]] = []
    state = {"a": 1, "b": 1}

    def read(_repo: object, _kind: object, identifiers: Any) -> dict[str, int]:
        asked.append(sorted(identifiers))
        if fails and len(asked) == 2:
            raise ConnectionError("gone")
        return {name: state[name] for name in identifiers if name in state}

    monkeypatch.setattr(shared_reads, "read_rows", read)

    async def ask() -> list[Any]:
        reads = shared_reads.SharedReads(repo)
        first = asyncio.create_task(reads.row(SOL, "a"))
        while not asked:
            await asyncio.sleep(0)
        state["a"] = 2
        left = asyncio.create_task(reads.row(SOL, "b"))
        more = [asyncio.create_task(reads.row(SOL, name)) for name in ("a", "b", "c")]
        await asyncio.sleep(0)
        left.cancel()
        found = await asyncio.gather(first, *more, return_exceptions=True)
        return [*found, await reads.row(SOL, "b")]

    found = asyncio.run(ask())
    assert asked == [["a"], ["a", "b", "c"], ["b"]]
    assert found[0] == 1
    assert found[4] == 1
    if fails:
        assert [type(one) for one in found[1:4]] == [ConnectionError] * 3
    else:
        assert found[1:4] == [2, 1, None]
