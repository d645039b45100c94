"""A thousand people who follow one mission: what they cost in silence, and when a change is at all of them.

One server in a process of its own under uvicorn, the listeners and whoever changes something in this one.
Each listener has a person's own session, or with `--one-person` none (local profiles). The delay of a change
is from the moment its request is sent until the event is at the last listener; beside it stands the same for
the listener in the middle. The machine's other load is in these times, so beside them stands the processor
time that a change takes from the server and from the listeners. One more listener takes nothing at all.
`--database` is a PostgreSQL server, on which a database is made and dropped; default a fresh SQLite file.
"""

from __future__ import annotations

import asyncio
import resource
import secrets
import statistics
import time
from collections.abc import Iterator

import httpx

from benchmarks.common.clock import quantile
from benchmarks.common.figure import Figure, command
from benchmarks.common.served import Environment, Server, file_mission, place, repository, service
from ground.gdr.ids import new_id
from ground.records.actor import Role
from ground.resources.people.authentication import COOKIE
from ground.resources.people.credentials import open_session
from ground.resources.people.kind import PERSON
from ground.resources.people.row import PersonRow

LISTENERS = 1000
IDLE_MOST, DELAY_MOST_S = 2.0, 0.3
"""Per cent of a core, and seconds to the last of so many listeners, 99th percentile."""
QUICK = {"listeners": 50, "changes": 5, "idle_s": 2.0}
BUDGET_S = 600.0
WARM = 2
"""Changes before those that count: the first loads code that a server loads once."""


class Listeners:
    """Open streams on raw sockets; notes when each event came."""

    def __init__(self, port: int, mission: str, opened: list[str]) -> None:
        self.port, self.mission, self.opened = port, mission, opened
        self.came: dict[int, list[float]] = {}
        self.open = 0

    async def follow(self, number: int) -> None:
        """Read one stream until it is cancelled."""
        reader, writer = await self.ask(number)
        await reader.readuntil(b"\r\n\r\n")
        self.open += 1
        try:
            while True:
                line = await reader.readline()
                if line.startswith(b"id: "):
                    self.came.setdefault(int(line[4:]), []).append(time.perf_counter())
        finally:
            writer.close()

    async def ask(self, number: int) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """Open one stream."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        who = f"Cookie: {COOKIE}={self.opened[number]}\r\n" if self.opened else ""
        head = f"GET /api/v1/missions/{self.mission}/events HTTP/1.1\r\nHost: 127.0.0.1\r\n{who}\r\n"
        writer.write(head.encode())
        return reader, writer

    async def until_there(self, number: int, count: int) -> tuple[float, float]:
        """Return when an event was at half of the listeners, and at the last."""
        while len(self.came.get(number, ())) < count:
            await asyncio.sleep(0.002)
        came = sorted(self.came[number])
        return came[len(came) // 2], came[-1]


async def measure(
    server: Server, mission: str, opened: list[str], listeners: int, changes: int, idle_s: float
) -> list[Figure]:
    """Return the share of a core in silence, and the delays of changes."""
    streams = Listeners(server.port, mission, opened)
    _, deaf = await streams.ask(0)
    tasks = []
    for number in range(listeners):
        tasks.append(asyncio.create_task(streams.follow(number)))
        await asyncio.sleep(0.002)
    while streams.open < listeners:
        await asyncio.sleep(0.05)
    await asyncio.sleep(2.0)
    before, began = server.cpu_s(), time.monotonic()
    await asyncio.sleep(idle_s)
    idle = 100 * (server.cpu_s() - before) / (time.monotonic() - began)
    middle: list[float] = []
    last: list[float] = []
    headers = {"Authorization": f"Bearer {opened[0]}"} if opened else {}
    async with httpx.AsyncClient(base_url=server.api, headers=headers, timeout=60.0) as client:
        for number in range(-WARM, changes):
            if number == 0:
                before, mine = server.cpu_s(), time.process_time()
                middle.clear()
                last.clear()
            sent = time.perf_counter()
            body = {"subject_kind": "mission", "subject_id": mission, "text": f"{number}"}
            (await client.post(f"/missions/{mission}/comments", json=body)).raise_for_status()
            newest = (await client.get(f"/missions/{mission}/history?newest_first=true&limit=1")).json()
            half, all_of_them = await streams.until_there(newest["items"][0]["seq"], listeners)
            middle.append(half - sent)
            last.append(all_of_them - sent)
            await asyncio.sleep(0.2)
        each, mine = (server.cpu_s() - before) / changes, (time.process_time() - mine) / changes
    deaf.close()
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    whole = listeners == LISTENERS
    return [
        Figure(f"{listeners:,} listeners in silence", idle, "% of a core", IDLE_MOST if whole else None),
        Figure(
            "event at the last listener, 99th percentile",
            quantile(last, 0.99),
            "s",
            DELAY_MOST_S if whole else None,
        ),
        Figure("event at the last listener, median", statistics.median(last), "s"),
        Figure("event at the listener in the middle, median", statistics.median(middle), "s"),
        Figure("a change, of the server", 1000 * each, "ms"),
        Figure("a change, of all listeners", 1000 * mine, "ms"),
    ]


def sessions(environment: Environment, count: int) -> list[str]:
    """Return the secrets of sessions of as many people."""
    mark = secrets.token_hex(4)
    found = []
    with repository(environment) as repo, repo.database.together():
        for number in range(count):
            role = Role.PLANNER if number % 2 else Role.ADMIN
            hidden = {f"mis-{number}": Role.NONE.value} if number % 2 else {}  # each has to be looked at
            name = f"Person {mark} {number}"
            with repo.database.write() as session:
                row = PersonRow(id=new_id("psn"), author="", name=name, role=role.value, mission_roles=hidden)
                session.add(row)
                session.flush()
                person = PERSON.show_one(session, row)
            found.append(open_session(repo, person))
    return found


def figures(
    database: str = "",
    listeners: int = LISTENERS,
    changes: int = 60,
    idle_s: float = 30.0,
    one_person: bool = False,
) -> Iterator[Figure]:
    """Yield cost in silence, delays, and processor time of a change."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    with (
        place(database, AUTH="profiles" if one_person else "accounts") as environment,
        service(environment) as server,
    ):
        opened = [] if one_person else sessions(environment, listeners)
        mission, _ = file_mission(server.api, *opened[:1])
        yield from asyncio.run(measure(server, mission, opened, listeners, changes, idle_s))


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
