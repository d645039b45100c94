"""Who looks at a mission: told to those who may see it, at once, forgotten soon, and kept nowhere."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterable, AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

import anyio
import pytest
from sqlalchemy import event, func, select

from ground.api import streams
from ground.api.hub import Hub, lookers_topic
from ground.errors import NotFoundError
from ground.gdr.history import EventRow
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository, open_repository
from ground.records.actor import Actor, Role
from ground.records.lookers import BEAT_S, CHANNEL, EACH_MOST, GONE_S, Looker, Lookers, Selected, Word
from ground.resources.missions.value import Mission
from ground.resources.people.row import PersonRow
from ground.resources.presence.say_presence import leave_presence, list_presence, say_presence
from tests.ground.conftest import PLANNER, Api, yard
from tests.ground.test_missions_api import problem

LONG_S = 60.0
"""A stream that says nothing for so long on the busiest machine is broken."""
ROCK = Selected("target", "tgt-1")


async def told(source: AsyncIterable[Any]) -> AsyncIterator[list[dict[str, Any]]]:
    """Yield what a stream says of who looks."""
    async for chunk in source:
        for part in chunk.split(b"\n\n"):
            if b"event: presence" in part:
                assert b"id: " not in part  # it is no event to go on behind
                yield json.loads(part.partition(b"data: ")[2])


async def _until(true: Callable[[], bool]) -> None:
    while not true():
        await anyio.sleep(0.01)


async def _heard(hub: Hub, repo: Repository, mission: Mission, act: Callable[[], Awaitable[None]]) -> Any:
    """Return the first word of who looks that a stream gives while something is done."""
    answer = await streams.mission_stream(repo, hub, PLANNER, mission.id, None)
    words = told(answer.body_iterator)
    first = asyncio.ensure_future(anext(words))
    await asyncio.wait_for(_until(lambda: lookers_topic(mission.id) in hub._topics), LONG_S)
    await act()
    return await asyncio.wait_for(first, LONG_S)


def test_a_page_hears_who_else_looks_what_they_select_and_that_they_go(
    repo: Repository, mission: Mission
) -> None:
    ada = Actor("Ada", Role.SCIENTIST)

    async def run() -> list[Any]:
        hub = Hub(repo)
        answer = await streams.mission_stream(repo, hub, PLANNER, mission.id, None)
        words = told(answer.body_iterator)
        found = []

        async def say(selected: Selected | None) -> None:
            await anyio.to_thread.run_sync(say_presence, repo, ada, hub.lookers, mission.id, "p1", selected)

        first = asyncio.ensure_future(anext(words))
        await asyncio.wait_for(_until(lambda: lookers_topic(mission.id) in hub._topics), LONG_S)
        await say(None)
        found.append(await asyncio.wait_for(first, LONG_S))
        await say(None)  # said again: nobody hears of it
        await say(ROCK)
        found.append(await asyncio.wait_for(anext(words), LONG_S))
        await anyio.to_thread.run_sync(leave_presence, repo, ada, hub.lookers, mission.id, "p1")
        found.append(await asyncio.wait_for(anext(words), LONG_S))
        await anyio.to_thread.run_sync(hub.stop)
        return found

    come, selects, gone = anyio.run(run)
    assert come == [{"page_id": "p1", "person": "Ada", "selected": None}]
    assert selects == [{"page_id": "p1", "person": "Ada", "selected": {"kind": "target", "id": "tgt-1"}}]
    assert gone == []


def test_a_server_that_hears_its_own_older_word_keeps_the_newer_one() -> None:
    here, elsewhere = Lookers(), Lookers()
    come, chosen = (Word("msn-1", Looker("p1", "Ada", selected)) for selected in (None, ROCK))
    here.take(come)
    here.take(chosen)
    here.hear(here.text(come))
    assert here.of("msn-1") == [chosen.looker]
    elsewhere.hear(here.text(chosen))
    assert elsewhere.of("msn-1") == [chosen.looker]
    elsewhere.hear(here.text(Word("msn-1", come.looker, gone=True)))
    assert elsewhere.of("msn-1") == []


@pytest.mark.parametrize(
    "database_address", [pytest.param("postgresql", marks=pytest.mark.postgres)], indirect=True
)
def test_another_server_of_the_database_hears_it(repo: Repository, mission: Mission) -> None:
    other = open_repository(repo.settings)

    async def run() -> Any:
        here, there = Hub(repo), Hub(other)

        async def act() -> None:
            for _ in range(100):  # what was said before its thread listened, it hears with the next word
                await anyio.to_thread.run_sync(
                    say_presence, repo, PLANNER, here.lookers, mission.id, "p1", ROCK
                )
                await anyio.sleep(0.1)
                if there.lookers.of(mission.id):
                    return

        found = await _heard(there, other, mission, act)
        for hub in (here, there):
            await anyio.to_thread.run_sync(hub.stop)
        return found

    [looker] = anyio.run(run)
    other.database.dispose()
    assert (looker["person"], looker["page_id"]) == ("Planner", "p1")


def test_who_says_nothing_is_forgotten() -> None:
    now = [0.0]
    known = Lookers(clock=lambda: now[0])
    for person in ("Ada", "Bo"):
        assert known.take(Word("msn-1", Looker("p1", person, None)))
    now[0] = 2 * BEAT_S
    assert not known.take(Word("msn-1", Looker("p1", "Bo", None)))
    number = known.number("msn-1")
    now[0] = GONE_S + 1.0
    assert known.take(Word("msn-1", Looker("p1", "Bo", None)))  # by Bo's word others hear that Ada is gone
    assert [one.person for one in known.of("msn-1")] == ["Bo"]
    assert known.number("msn-1") > number  # others hear of it
    assert known.of("msn-2") == []
    now[0] += GONE_S + 1.0
    assert known.take(Word("msn-1", Looker("p2", "Ada", ROCK)))
    assert known.of("msn-1") == [Looker("p2", "Ada", ROCK)]


def test_nobody_fills_the_list_or_speaks_for_another() -> None:
    known = Lookers()
    known.take(Word("msn-1", Looker("p1", "Ada", None)))
    known.take(Word("msn-1", Looker("p1", "Bo", None), gone=True))
    for number in range(3 * EACH_MOST):
        known.take(Word("msn-1", Looker(f"q{number}", "Bo", None)))
    here = known.of("msn-1")
    assert [one.page_id for one in here if one.person == "Ada"] == ["p1"]
    assert sum(one.person == "Bo" for one in here) == EACH_MOST


def test_who_may_not_see_a_mission_neither_looks_nor_hears(repo: Repository, mission: Mission) -> None:
    hub = Hub(repo)
    eve = Actor("Eve", Role.VIEWER, {mission.id: "none"})
    say_presence(repo, PLANNER, hub.lookers, mission.id, "p1", ROCK)
    for act in (
        lambda: say_presence(repo, eve, hub.lookers, mission.id, "p1", None),
        lambda: list_presence(repo, eve, hub.lookers, mission.id),
        lambda: leave_presence(repo, eve, hub.lookers, mission.id, "p1"),
        lambda: say_presence(repo, PLANNER, hub.lookers, "msn-none", "p1", None),
    ):
        with pytest.raises(NotFoundError):
            act()
    viewer = Actor("Vi", Role.VIEWER)
    assert [one.person for one in list_presence(repo, viewer, hub.lookers, mission.id)] == ["Planner"]


def test_looking_writes_nothing_and_leaves_nothing_running(repo: Repository, mission: Mission) -> None:
    hub = Hub(repo)

    def events() -> int:
        with repo.database.read() as session:
            return session.scalar(select(func.count()).select_from(EventRow)) or 0

    before, written = events(), []
    for engine in {repo.database.engine, repo.database.write_engine}:
        event.listen(engine, "before_cursor_execute", lambda *given: written.append(str(given[2])))
    for number in range(20):
        say_presence(repo, PLANNER, hub.lookers, mission.id, "p1", Selected("target", f"tgt-{number}"))
    leave_presence(repo, PLANNER, hub.lookers, mission.id, "p1")
    assert not [s for s in written if s.split()[0].upper() in {"INSERT", "UPDATE", "DELETE"}], written
    assert events() == before
    assert hub.lookers._known == {}
    assert hub._watch._thread is None  # nobody follows: no thread, and so no statement


def test_presence_over_rest(sqlite_api: Api, terrain_folder: Path) -> None:
    api = sqlite_api
    mission = yard(api.repo, terrain_folder).id
    path = f"/missions/{mission}/presence"
    with api.repo.database.write() as session:
        hide = {mission: "none"}
        session.add(PersonRow(id=new_id("psn"), author="", name="Eve", role="viewer", mission_roles=hide))
    said = api("PUT", f"{path}/p1", {"selected": {"kind": "plan", "id": "pln-1"}}, who="Viewer")
    assert said.json() == [{"page_id": "p1", "person": "Viewer", "selected": {"kind": "plan", "id": "pln-1"}}]
    assert api.get(path) == said.json()
    wrong = api("PUT", f"{path}/p1", {"selected": {"kind": "person", "id": "psn-1"}})
    problem(wrong, 422, "invalid-input")
    for method, at in (("PUT", f"{path}/p1"), ("GET", path), ("DELETE", f"{path}/p1")):
        assert api(method, at, {} if method == "PUT" else None, who="Eve").status_code == 404
    assert api("DELETE", f"{path}/p1", who="Viewer").status_code == 204
    assert api.get(path) == []
    assert CHANNEL.isidentifier()  # it stands in a LISTEN
