"""Cost of the API beside a bare Starlette endpoint, in one run: processor time a request, latency, conflicts.

Yardstick and service are asked one after the other, each in a process of its own under uvicorn, by the same
client. Rounds alternate; the figures are medians over rounds, processor time that of the server's process.
`--database` is a PostgreSQL server, on which a database is made and dropped; default a fresh SQLite file.
"""

from __future__ import annotations

import asyncio
import os
import statistics
import sys
import time
from collections.abc import Iterator

import httpx

from benchmarks.common.clock import quantile
from benchmarks.common.figure import Figure, command
from benchmarks.common.served import Server, ask, file_mission, place, process, service
from studies.common.processes import free_port

BARE = """
import uvicorn, sys
from starlette.applications import Starlette
from starlette.responses import JSONResponse
from starlette.routing import Route
ROCK = {"id": "tgt-0", "name": "Rock1", "position": {"east_m": 4.2, "north_m": -1.5, "up_m": 0.1}}
async def target(request):
    return JSONResponse(ROCK)
app = Starlette(routes=[Route("/target", target)])
uvicorn.run(app, port=int(sys.argv[1]), log_level="error", access_log=False)
"""
PEER = "a bare endpoint"
MOST_TIMES = {("one target", 50): 10.0}
QUICK = {"seconds": 0.5, "rounds": 1}
BUDGET_S = 600.0


def load(server: Server, path: str, connections: int, seconds: float) -> tuple[float, float, int]:
    """Return processor milliseconds a request, the 99th percentile in milliseconds, and errors."""
    before, until = server.cpu_s(), time.perf_counter() + seconds
    latencies, errors = asyncio.run(
        ask(server.port, path, connections, lambda _: time.perf_counter() < until)
    )
    cpu_ms = 1000 * (server.cpu_s() - before) / max(len(latencies), 1)
    return cpu_ms, 1000 * quantile(latencies, 0.99), errors


def edit_together(base: str, target: str, people: int, edits: int) -> dict[str, int]:
    """Let many people change one target; every change is made or answered 412, none is lost."""

    async def person(client: httpx.AsyncClient, number: int) -> list[int]:
        found = []
        for edit in range(edits):
            read = await client.get(f"/targets/{target}")
            notes = f"{read.json()['notes']} {number}.{edit}"
            answer = await client.patch(
                f"/targets/{target}", json={"notes": notes}, headers={"If-Match": read.headers["etag"]}
            )
            found.append(answer.status_code)
        return found

    async def run() -> list[int]:
        async with httpx.AsyncClient(base_url=base, timeout=60.0) as client:
            answers = await asyncio.gather(*(person(client, n) for n in range(people)))
            return [status for each in answers for status in each]

    statuses = asyncio.run(run())
    final = httpx.get(f"{base}/targets/{target}").json()["notes"].split()
    made = statuses.count(200)
    other = len(statuses) - made - statuses.count(412)
    return {"made": made, "neither made nor refused by 412": other, "lost": made - len(final)}


def figures(
    database: str = "", seconds: float = 6.0, rounds: int = 3, connections: tuple[int, ...] = (16, 50)
) -> Iterator[Figure]:
    """Yield cost and latency of reads, errors, and what editing together lost."""
    port = free_port()
    bare = [sys.executable, "-c", BARE, str(port)]
    with (
        place(database) as environment,
        process(bare, port, "/target", dict(os.environ)) as yard,
        service(environment) as server,
    ):
        mission, target = file_mission(server.api)
        places = {
            PEER: (yard, "/target"),
            "one target": (server, f"/api/v1/targets/{target}"),
            "list of targets": (server, f"/api/v1/missions/{mission}/targets"),
        }
        wrong = 0
        for many in connections:
            found: dict[str, list[tuple[float, float, int]]] = {name: [] for name in places}
            for _ in range(rounds):
                for name, (at, path) in places.items():
                    found[name].append(load(at, path, many, seconds))
            yard_ms = statistics.median(cpu for cpu, _, _ in found[PEER])
            for name, cells in found.items():
                cpu_ms, p99_ms = (statistics.median(cell[k] for cell in cells) for k in (0, 1))
                wrong += sum(cell[2] for cell in cells)
                label = f"{name}, {many} connections"
                what, limit = f"{label}: processor time a request", MOST_TIMES.get((name, many))
                ratio, to = (None, "") if name == PEER else (cpu_ms / yard_ms, PEER)
                yield Figure(what, cpu_ms, "ms", limit, ratio=ratio, to=to)
                yield Figure(f"{label}: 99th percentile", p99_ms, "ms")
        yield Figure("errors of all these", wrong, limit=0)
        for what, count in edit_together(server.api, target, people=20, edits=10).items():
            limit = None if what == "made" else 0
            yield Figure(f"20 people edit one target 200 times: {what}", count, limit=limit)


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
