"""Reads by key that share a statement: each has its own row, and none an older one than when it asked."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from starlette.concurrency import run_in_threadpool

from ground.api.shared_reads import SharedReads


@pytest.mark.parametrize("fails", [False, True])
def test_what_is_asked_for_meanwhile_is_read_next_and_together(fails: bool) -> None:
    asked: list[list[str]] = []
    state = {"a": 1, "b": 1}

    def read(identifiers: Any) -> dict[str, int]:
        asked.append(sorted(identifiers))
        if fails and len(asked) == 2:
            raise ConnectionError("gone")
        return {name: state[name] for name in identifiers if name in state}

    async def ask() -> list[Any]:
        reads = SharedReads(run_in_threadpool, read)
        first = asyncio.create_task(reads.get("a"))
        while not asked:
            await asyncio.sleep(0)
        state["a"] = 2
        left = asyncio.create_task(reads.get("b"))
        more = [asyncio.create_task(reads.get(name)) for name in ("a", "b", "c")]
        await asyncio.sleep(0)
        left.cancel()
        found = await asyncio.gather(first, *more, return_exceptions=True)
        return [*found, await reads.get("b")]

    found = asyncio.run(ask())
    assert asked == [["a"], ["a", "b", "c"], ["b"]]
    assert found[0] == 1
    assert found[4] == 1
    if fails:
        assert [type(one) for one in found[1:4]] == [ConnectionError] * 3
    else:
        assert found[1:4] == [2, 1, None]


def test_more_than_one_turn_can_hold_are_read_in_turns() -> None:
    turns: list[int] = []

    def read(keys: Any) -> dict[str, int]:
        turns.append(len(keys))
        return {key: int(key) for key in keys}

    async def ask() -> list[Any]:
        reads = SharedReads(run_in_threadpool, read)
        reads.AT_ONCE = 4
        return await asyncio.gather(*(reads.get(str(n)) for n in range(11)))

    assert asyncio.run(ask()) == list(range(11))
    assert max(turns) == 4
