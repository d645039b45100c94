"""Streams: one reader however many follow, nothing missed, other processes heard."""

from __future__ import annotations

import asyncio
import json
import re
import threading
from collections.abc import AsyncIterator, Collection
from dataclasses import dataclass
from typing import Any

import anyio
import pytest
from sqlalchemy import text
from starlette.datastructures import Headers

from ground.api import streams
from ground.api.hub import BACKLOG, BACKLOG_BYTES, Hub, Listener, Part
from ground.errors import AuthenticationError
from ground.gdr.history import ChainRow
from ground.gdr.packed import write_packed
from ground.gdr.repository import Repository, open_repository
from ground.jobs.value import JobState
from ground.records.actor import SYSTEM_ACTOR, Actor
from ground.records.delete_resource import delete_resource
from ground.resources.kinds import KINDS
from ground.resources.missions.value import Mission
from ground.resources.people import credentials
from ground.resources.people.authentication import Identities
from ground.resources.runs import read_run
from ground.resources.runs import stream as run_stream_module
from ground.resources.runs.stream import run_stream
from ground.resources.runs.value import RunKind
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.create_target import create_target
from tests.ground.conftest import PLANNER

LONG_S = 60.0
"""A stream that says nothing for so long on the busiest machine is broken."""


async def numbers(source: AsyncIterator[Any], count: int) -> list[int]:
    found: list[int] = []
    async for chunk in source:
        for part in chunk.split(b"\n\n"):
            if b"event: change" in part:
                found.append(json.loads(part.partition(b"data: ")[2])["seq"])
        if len(found) >= count:
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


def test_who_loses_a_stream_before_its_first_event_goes_on_from_where_it_began(
    repo: Repository, mission: Mission
) -> None:
    async def run() -> list[int]:
        hub = Hub(repo)
        answer = await streams.mission_stream(repo, hub, PLANNER, mission.id, None)
        began = ""
        async for chunk in answer.body_iterator:
            if found := re.match(rb"id: (\d+)\n\n", bytes(chunk)):
                began = found[1].decode()
                break
        await anyio.to_thread.run_sync(pick, repo, mission, 2)  # while nobody listens
        again = await streams.mission_stream(repo, hub, PLANNER, mission.id, began)
        heard = await asyncio.wait_for(numbers(again.body_iterator, 2), LONG_S)
        await anyio.to_thread.run_sync(hub.stop)
        return heard

    assert len(anyio.run(run)) == 2


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
            listener.take([Part(number, b"")])
        assert (listener.queue.qsize(), listener.queue.get_nowait()) == (1, None)
        large = [Part(1, bytes(BACKLOG_BYTES // 4))]
        for _ in range(4):
            listener.take(large)
        assert await listener.next() is large
        listener.take(large)  # there is room again
        assert listener.queue.qsize() == 4
        listener.take([Part(2, b"x")])
        assert (listener.queue.qsize(), await listener.next()) == (1, None)

    anyio.run(run)


@dataclass
class Flight:
    """A run as its stream sees it."""

    id: str
    kind: RunKind
    state: JobState


def events_of(chunks: list[bytes]) -> list[tuple[int, str]]:
    found = []
    for part in b"".join(chunks).decode().split("\n\n"):
        lines = dict(line.split(": ", 1) for line in part.splitlines() if not line.startswith(":"))
        if "event" in lines:
            found.append((int(lines["id"]), lines["event"]))
    return found


def test_a_run_is_read_once_for_all_who_follow_it_and_nobody_misses_a_line(
    repo: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    flight = Flight("run-1", RunKind.DRY_RUN, JobState.RUNNING)
    monkeypatch.setattr(run_stream_module, "get_resource", lambda *_: flight)
    monkeypatch.setattr(read_run.LiveLines, "AT_ONCE_BYTES", 64)  # many pages, and lines that are longer
    readers: set[read_run.LiveLines] = set()
    real = read_run.LiveLines._bytes

    def noted(self: read_run.LiveLines, wanted: int) -> bytes:
        found = real(self, wanted)
        if found:
            readers.add(self)
        return found

    path = repo.run_dir("run-1") / read_run.LIVE
    path.parent.mkdir(parents=True)

    def write(first: int, count: int) -> None:
        with path.open("ab", buffering=0) as out:
            for number in range(first, first + count):
                line = json.dumps(["trace", {"number": number, "text": "x" * (number * 7 % 150)}]) + "\n"
                out.write(line.encode()[:9])  # half a line is not a line
                out.write(line.encode()[9:])

    async def run() -> list[list[tuple[int, str]]]:
        hub = Hub(repo)

        heard: list[list[bytes]] = []

        async def follow(after: str | None) -> list[bytes]:
            chunks: list[bytes] = []
            heard.append(chunks)
            answer = await run_stream(repo, hub, PLANNER, "run-1", after)
            async for chunk in answer.body_iterator:
                assert isinstance(chunk, bytes)
                chunks.append(chunk)
            return chunks

        write(1, 40)
        tasks = [asyncio.create_task(follow(None)) for _ in range(20)]
        tasks += [asyncio.create_task(follow("33")), asyncio.create_task(follow("40"))]
        while hub.seen("run-1") is None or len(hub._topics["run-1"].listeners) < 22:
            await anyio.sleep(0.01)
        while sum((40, "trace") in events_of(chunks) for chunks in heard) < 21:
            await anyio.sleep(0.01)
        monkeypatch.setattr(read_run.LiveLines, "_bytes", noted)
        await anyio.to_thread.run_sync(write, 41, 60)
        late = asyncio.create_task(follow("7"))
        while hub.seen("run-1") != 100:
            await anyio.sleep(0.01)
        write_packed(path, path.read_bytes())
        path.unlink()
        flight.state = JobState.SUCCEEDED
        with repo.database.write() as session:  # as the end of a run is written
            session.add(ChainRow(id="x", seq=0, sha256=""))
            if not repo.database.is_sqlite:
                session.execute(text("SELECT pg_notify('outcrop', 'run-1')"))
        found = await asyncio.wait_for(asyncio.gather(*tasks, late), LONG_S)
        await anyio.to_thread.run_sync(hub.stop)
        return [events_of(chunks) for chunks in found]

    *many, behind, newest, late = anyio.run(run)
    whole = [(number, "trace") for number in range(1, 101)] + [(100, "end")]
    for found in many:
        assert found == whole
    assert (behind, newest, late) == (whole[33:], whole[40:], whole[7:])
    assert len(readers) == 2  # of 23 followers: the shared one, and that of who came late


def test_a_run_begun_anew_is_followed_from_its_new_lines(repo: Repository) -> None:
    path = repo.run_dir("run-1") / read_run.LIVE
    path.parent.mkdir(parents=True)
    lines = read_run.LiveLines(repo, Flight("run-1", RunKind.DRY_RUN, JobState.RUNNING))  # type: ignore[arg-type]
    path.write_text('["trace", 1]\n["trace", 2]\n')
    assert [(n, data) for n, _, data in lines.behind(0)] == [(1, 1), (2, 2)]
    path.unlink()
    path.write_text('["trace", 5]\n["trace", 6]\n["trace", 7]\n')
    assert [(n, data) for n, _, data in lines.behind(2)] == [(3, 7)]
    with path.open("a") as out:
        out.write('["tra\n["trace", 8]\n')
    assert [(n, kind) for n, kind, _ in lines.behind(3)] == [(4, "note"), (5, "trace")]


def test_who_was_asked_for_while_rights_changed_is_not_remembered(
    repo: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A read that began before a session was ended must not make it known for another second."""
    let_go, asked = threading.Event(), threading.Event()
    known = [True]

    def identify(_repo: Repository, secrets: Collection[str]) -> dict[str, Actor]:
        found = dict.fromkeys(secrets, PLANNER) if known[0] else {}
        asked.set()
        let_go.wait()
        return found

    monkeypatch.setattr(credentials, "identify", identify)

    async def run() -> None:
        identities = Identities(repo)
        headers = Headers({"authorization": "Bearer secret"})
        first = asyncio.create_task(identities.actor_of("GET", headers))
        await anyio.to_thread.run_sync(asked.wait)
        known[0] = False
        identities.forget()  # the session was ended here
        let_go.set()
        assert await first is PLANNER  # it had begun before
        with pytest.raises(AuthenticationError):
            await identities.actor_of("GET", headers)

    anyio.run(run)
