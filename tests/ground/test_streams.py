"""Streams: one reader however many follow, nothing missed, other processes heard."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Any

import anyio
import pytest

from ground.api import streams
from ground.api.hub import BACKLOG, Hub, Listener
from ground.gdr.repository import Repository, open_repository
from ground.records.actor import SYSTEM_ACTOR
from ground.records.delete_resource import delete_resource
from ground.resources.kinds import KINDS
from ground.resources.missions.value import Mission
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.create_target import create_target
from tests.ground.conftest import PLANNER

LONG_S = 60.0
"""A stream that says nothing for so long on the busiest machine is broken."""


async def numbers(source: AsyncIterator[Any], count: int) -> list[int]:
    found: list[int] = []
    async for part in source:
        if b"event: change" in part:
            found.append(json.loads(part.partition(b"data: ")[2])["seq"])
            if len(found) == count:
                break
    return found


def pick(repo: Repository, mission: Mission, count: int) -> None:
    for number in range(count):
        create_target(repo, PLANNER, mission.id, TargetCreate(east_m=3.0 + 0.1 * number, north_m=1.0))


def test_who_follows_a_mission_hears_what_another_process_did_and_it_is_read_once(
    repo: Repository, mission: Mission, monkeypatch: pytest.MonkeyPatch
) -> None:
    reads: list[int] = []
    real = streams.list_history

    def counted(*given: Any, **more: Any) -> Any:
        reads.append(more["after"])
        return real(*given, **more)

    monkeypatch.setattr(streams, "list_history", counted)
    other = open_repository(repo.settings)

    async def run() -> list[list[int]]:
        hub = Hub(repo)
        opened = [await streams.mission_stream(repo, hub, PLANNER, mission.id, None) for _ in range(30)]
        tasks = [asyncio.create_task(numbers(answer.body_iterator, 3)) for answer in opened]
        while not hub._topics or len(hub._topics[mission.id].listeners) < 30:
            await anyio.sleep(0.01)
        await anyio.to_thread.run_sync(pick, other, mission, 3)
        found = await asyncio.wait_for(asyncio.gather(*tasks), LONG_S)
        late = await streams.mission_stream(repo, hub, PLANNER, mission.id, str(found[0][0]))
        found.append(await asyncio.wait_for(numbers(late.body_iterator, 2), LONG_S))
        await anyio.to_thread.run_sync(hub.stop)
        return found

    *every, late = anyio.run(run)
    other.database.dispose()
    assert len(every[0]) == 3
    assert all(found == every[0] for found in every)
    assert late == every[0][1:]
    assert len(reads) < 30  # not one for each listener


def test_who_follows_a_mission_hears_that_it_was_deleted(repo: Repository, mission: Mission) -> None:
    async def run() -> None:
        hub = Hub(repo)
        answer = await streams.mission_stream(repo, hub, PLANNER, mission.id, None)
        task = asyncio.create_task(numbers(answer.body_iterator, 1))
        while not hub._topics:
            await anyio.sleep(0.01)
        delete = (repo, SYSTEM_ACTOR, KINDS["mission"], mission.id, None)
        await anyio.to_thread.run_sync(delete_resource, *delete)
        await asyncio.wait_for(task, LONG_S)
        await anyio.to_thread.run_sync(hub.stop)
        assert not hub._topics

    anyio.run(run)


def test_a_listener_that_takes_nothing_is_let_go_and_costs_no_more_than_its_backlog() -> None:
    async def run() -> None:
        listener = Listener(0, asyncio.get_running_loop())
        for number in range(BACKLOG + 1):
            listener.take([(number, b"")])
        assert (listener.queue.qsize(), listener.queue.get_nowait()) == (1, None)

    anyio.run(run)
