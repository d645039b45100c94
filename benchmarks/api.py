"""Cost of the API beside a bare Starlette endpoint, in one run: CPU per request, rate, latency, conflicts.

    python -m benchmarks.api [--database URL] [--seconds 10] [--connections 16 64] [--out results.json]

Yardstick and service are asked one after the other, each in a process of its own under uvicorn, by the same
client. Rounds alternate; the figures are medians over rounds. CPU is that of the server's process.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import httpx

ROOT = Path(__file__).resolve().parents[1]
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


def free_port() -> int:
    """Return a port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def cpu_s(pid: int) -> float:
    """Return the processor seconds that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(") ", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


async def wait_ready(url: str) -> None:
    """Ask until the service answers."""
    async with httpx.AsyncClient() as client:
        for _ in range(300):
            try:
                if (await client.get(url)).status_code < 500:
                    return
            except httpx.TransportError:
                pass
            await asyncio.sleep(0.1)
    raise SystemExit(f"{url} does not answer")


async def ask(port: int, path: str, connections: int, seconds: float) -> tuple[list[float], int]:
    """Ask one path over `connections` kept-alive connections; return latencies and the number of errors.

    Raw sockets: a client library would cost more than the servers under test.
    """
    request = f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode()
    until = time.perf_counter() + seconds
    latencies: list[float] = []
    errors = 0

    async def one() -> None:
        nonlocal errors
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        try:
            while time.perf_counter() < until:
                began = time.perf_counter()
                writer.write(request)
                head = await reader.readuntil(b"\r\n\r\n")
                length = int(head.lower().split(b"content-length:")[1].split(b"\r\n")[0])
                await reader.readexactly(length)
                latencies.append(time.perf_counter() - began)
                errors += not head.startswith(b"HTTP/1.1 200")
        except (asyncio.IncompleteReadError, ConnectionError, IndexError):
            errors += 1
        finally:
            writer.close()

    await asyncio.gather(*(one() for _ in range(connections)))
    return latencies, errors


async def measure(port: int, pid: int, path: str, connections: int, seconds: float) -> dict[str, Any]:
    """Return rate, processor time and latencies of one path under load."""
    before = cpu_s(pid)
    began = time.perf_counter()
    latencies, errors = await ask(port, path, connections, seconds)
    wall = time.perf_counter() - began
    latencies.sort()
    return {
        "requests": len(latencies),
        "errors": errors,
        "rate_per_s": len(latencies) / wall,
        "cpu_ms": 1000 * (cpu_s(pid) - before) / max(len(latencies), 1),
        "p50_ms": 1000 * latencies[len(latencies) // 2],
        "p99_ms": 1000 * latencies[int(len(latencies) * 0.99)],
    }


def file_mission(base: str, secret: str = "") -> tuple[str, str]:
    """Make a mission with one target, as the owner of a secret; return the ids of both."""
    headers = {"Authorization": f"Bearer {secret}"} if secret else {}
    with httpx.Client(base_url=base, headers=headers, timeout=120.0) as client:
        mission = client.post(
            "/missions", json={"name": "Bench", "terrain": {"source": "generated", "seed": 1, "size_m": 48.0}}
        ).json()["id"]
        body = {"east_m": 2.0, "north_m": 2.0}
        target = client.post(f"/missions/{mission}/targets", json=body).json()["id"]
    return mission, target


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
    return {
        "edits": len(statuses),
        "made": statuses.count(200),
        "conflicts_412": statuses.count(412),
        "others": len(statuses) - statuses.count(200) - statuses.count(412),
        "lost": statuses.count(200) - len(final),
    }


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--database", default="", help="SQLAlchemy address; default a fresh SQLite file")
    parser.add_argument("--seconds", type=float, default=8.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--connections", type=int, nargs="+", default=[1, 16, 64])
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    bare_port, port = free_port(), free_port()
    with tempfile.TemporaryDirectory(prefix="outcrop-bench-") as folder:
        environment = {
            **os.environ,
            "OUTCROP_DATA_DIR": folder,
            "OUTCROP_DATABASE_URL": given.database,
            "OUTCROP_LOG_LEVEL": "error",
            "OUTCROP_SERVE_WORKER": "false",
            "OUTCROP_WARM_UP": "false",
        }
        outcrop = [sys.executable, "-m", "ground.cli"]
        subprocess.run([*outcrop, "migrate"], env=environment, check=True, cwd=ROOT)
        bare = subprocess.Popen([sys.executable, "-c", BARE, str(bare_port)])
        service = subprocess.Popen([*outcrop, "serve", "--port", str(port)], env=environment, cwd=ROOT)
        try:
            asyncio.run(wait_ready(f"http://127.0.0.1:{bare_port}/target"))
            asyncio.run(wait_ready(f"http://127.0.0.1:{port}/healthz"))
            base = f"http://127.0.0.1:{port}/api/v1"
            mission, target = file_mission(base)
            results: dict[str, Any] = {"database": given.database.split(":")[0] or "sqlite", "cells": []}
            places = {
                "bare": (bare_port, bare.pid, "/target"),
                "target": (port, service.pid, f"/api/v1/targets/{target}"),
                "list": (port, service.pid, f"/api/v1/missions/{mission}/targets"),
            }
            for connections in given.connections:
                rounds: dict[str, list[dict[str, Any]]] = {name: [] for name in places}
                for _ in range(given.rounds):
                    for name, (at, pid, path) in places.items():
                        found_now = measure(at, pid, path, connections, given.seconds)
                        rounds[name].append(asyncio.run(found_now))
                yard = statistics.median(r["cpu_ms"] for r in rounds["bare"])
                for name, found in rounds.items():
                    cell = {key: statistics.median(r[key] for r in found) for key in found[0]}
                    cell |= {"name": name, "connections": connections, "cpu_ratio": cell["cpu_ms"] / yard}
                    results["cells"].append(cell)
                    print(
                        f"{name:8} c={connections:3}  {cell['rate_per_s']:8.0f}/s  "
                        f"cpu {cell['cpu_ms']:.3f} ms "
                        f"(x{cell['cpu_ratio']:.1f})  p50 {cell['p50_ms']:.1f}  "
                        f"p99 {cell['p99_ms']:.1f} ms  errors {cell['errors']:.0f}"
                    )
            results["editing"] = edit_together(base, target, people=20, edits=10)
            print("20 people editing one target:", results["editing"])
        finally:
            for process in (bare, service):
                process.terminate()
                process.wait(timeout=20)
    if given.out is not None:
        given.out.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
