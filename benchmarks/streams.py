"""A thousand people who follow one mission: what they cost in silence, and when a change is at all of them.

    python -m benchmarks.streams [--database URL] [--listeners 1000] [--changes 60] [--one-person]

One server in a process of its own under uvicorn, the listeners and whoever changes something in this one.
Each listener has a person's own session, or with `--one-person` none (local profiles). The delay of a change
is from the moment its request is sent until the event is at the last listener; beside it stands the same for
the listener in the middle. The machine's other load is in these times, so beside them stands the processor
time that a change takes from the server and from the listeners. One more listener takes nothing at all.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import resource
import secrets
import statistics
import subprocess
import sys
import tempfile
import time

import httpx

from benchmarks.api import ROOT, cpu_s, file_mission, free_port, wait_ready
from ground.gdr.ids import new_id
from ground.gdr.repository import open_repository
from ground.records.actor import Role
from ground.resources.people.authentication import COOKIE
from ground.resources.people.credentials import open_session
from ground.resources.people.kind import PERSON
from ground.resources.people.row import PersonRow
from ground.settings import load_settings

IDLE_SHARE = 0.02
DELAY_S = 0.3
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
    port: int, pid: int, mission: str, opened: list[str], given: argparse.Namespace
) -> dict[str, float]:
    """Return the share of a core in silence, and the delays of changes."""
    streams = Listeners(port, mission, opened)
    _, deaf = await streams.ask(0)
    tasks = []
    for number in range(given.listeners):
        tasks.append(asyncio.create_task(streams.follow(number)))
        await asyncio.sleep(0.002)
    while streams.open < given.listeners:
        await asyncio.sleep(0.05)
    await asyncio.sleep(2.0)
    before, began = cpu_s(pid), time.monotonic()
    await asyncio.sleep(given.idle_s)
    idle = (cpu_s(pid) - before) / (time.monotonic() - began)
    middle, last = [], []
    headers = {"Authorization": f"Bearer {opened[0]}"} if opened else {}
    base = f"http://127.0.0.1:{port}/api/v1"
    async with httpx.AsyncClient(base_url=base, headers=headers, timeout=60.0) as client:
        for number in range(-WARM, given.changes):
            if number == 0:
                before, mine = cpu_s(pid), time.process_time()
                middle, last = [], []
            sent = time.perf_counter()
            body = {"subject_kind": "mission", "subject_id": mission, "text": f"{number}"}
            (await client.post(f"/missions/{mission}/comments", json=body)).raise_for_status()
            newest = (await client.get(f"/missions/{mission}/history?newest_first=true&limit=1")).json()
            half, all_of_them = await streams.until_there(newest["items"][0]["seq"], given.listeners)
            middle.append(half - sent)
            last.append(all_of_them - sent)
            await asyncio.sleep(0.2)
        each, mine = (cpu_s(pid) - before) / given.changes, (time.process_time() - mine) / given.changes
    deaf.close()
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    last.sort()
    return {
        "idle_share": idle,
        "p50_middle_s": statistics.median(middle),
        "p50_last_s": statistics.median(last),
        "p99_last_s": last[min(len(last) - 1, int(len(last) * 0.99))],
        "cpu_s_of_a_change": each,
        "cpu_s_of_the_listeners": mine,
    }


def sessions(environment: dict[str, str], count: int) -> list[str]:
    """Return the secrets of sessions of as many people."""
    repo = open_repository(
        load_settings(
            data_dir=environment["OUTCROP_DATA_DIR"],
            database_url=environment["OUTCROP_DATABASE_URL"],
            auth=environment["OUTCROP_AUTH"],
        )
    )
    mark = secrets.token_hex(4)
    found = []
    with repo.database.together():
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
    repo.database.dispose()
    return found


def main() -> None:
    """Print the figures; end with 1 if they are beyond the limits."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--database", default="", help="SQLAlchemy address; default a fresh SQLite file")
    parser.add_argument("--listeners", type=int, default=1000)
    parser.add_argument("--changes", type=int, default=60)
    parser.add_argument("--idle-s", type=float, default=30.0)
    parser.add_argument("--one-person", action="store_true")
    given = parser.parse_args()
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    port = free_port()
    with tempfile.TemporaryDirectory(prefix="outcrop-streams-") as folder:
        environment = {
            **os.environ,
            "OUTCROP_DATA_DIR": folder,
            "OUTCROP_DATABASE_URL": given.database,
            "OUTCROP_LOG_LEVEL": "error",
            "OUTCROP_SERVE_WORKER": "false",
            "OUTCROP_WARM_UP": "false",
            "OUTCROP_AUTH": "profiles" if given.one_person else "accounts",
        }
        outcrop = [sys.executable, "-m", "ground.cli"]
        subprocess.run([*outcrop, "migrate"], env=environment, check=True, cwd=ROOT)
        service = subprocess.Popen([*outcrop, "serve", "--port", str(port)], env=environment, cwd=ROOT)
        try:
            asyncio.run(wait_ready(f"http://127.0.0.1:{port}/healthz"))
            opened = [] if given.one_person else sessions(environment, given.listeners)
            mission, _ = file_mission(f"http://127.0.0.1:{port}/api/v1", *opened[:1])
            found = asyncio.run(measure(port, service.pid, mission, opened, given))
        finally:
            service.terminate()
            service.wait(timeout=30)
    load = os.getloadavg()[0]
    print(json.dumps({"listeners": given.listeners, "load": load, **found}, indent=1))
    good = found["idle_share"] <= IDLE_SHARE and found["p99_last_s"] <= DELAY_S
    raise SystemExit(0 if good else 1)


if __name__ == "__main__":
    main()
