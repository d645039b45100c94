"""A thousand people who follow one mission: what they cost in silence, and when a change is at all of them.

    python -m benchmarks.streams [--database URL] [--listeners 1000] [--changes 60] [--idle-s 30]

One server in a process of its own under uvicorn, the listeners and whoever changes something in this one.
The delay of a change is from the moment its request is sent until the event is at the last listener; beside
it stands the same for the listener in the middle. CPU is that of the server's process.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time

import httpx

from benchmarks.api import ROOT, cpu_s, file_mission, free_port, wait_ready

IDLE_SHARE = 0.02
DELAY_S = 0.3


class Listeners:
    """Open streams on raw sockets; notes when each event came."""

    def __init__(self, port: int, mission: str) -> None:
        self.port, self.mission = port, mission
        self.came: dict[int, list[float]] = {}
        self.open = 0

    async def follow(self) -> None:
        """Read one stream until it is cancelled."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        writer.write(
            f"GET /api/v1/missions/{self.mission}/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode()
        )
        await reader.readuntil(b"\r\n\r\n")
        self.open += 1
        try:
            while True:
                line = await reader.readline()
                if line.startswith(b"id: "):
                    self.came.setdefault(int(line[4:]), []).append(time.perf_counter())
        finally:
            writer.close()

    async def until_there(self, number: int, count: int) -> tuple[float, float]:
        """Return when an event was at half of the listeners, and at the last."""
        while len(self.came.get(number, ())) < count:
            await asyncio.sleep(0.002)
        came = sorted(self.came[number])
        return came[len(came) // 2], came[-1]


async def measure(port: int, pid: int, mission: str, given: argparse.Namespace) -> dict[str, float]:
    """Return the share of a core in silence, and the delays of changes."""
    streams = Listeners(port, mission)
    tasks = []
    for _ in range(given.listeners):
        tasks.append(asyncio.create_task(streams.follow()))
        await asyncio.sleep(0.002)
    while streams.open < given.listeners:
        await asyncio.sleep(0.05)
    await asyncio.sleep(2.0)
    before, began = cpu_s(pid), time.monotonic()
    await asyncio.sleep(given.idle_s)
    idle = (cpu_s(pid) - before) / (time.monotonic() - began)
    middle, last = [], []
    async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}/api/v1", timeout=60.0) as client:
        before = cpu_s(pid)
        for number in range(given.changes):
            sent = time.perf_counter()
            body = {"subject_kind": "mission", "subject_id": mission, "text": f"{number}"}
            (await client.post(f"/missions/{mission}/comments", json=body)).raise_for_status()
            newest = (await client.get(f"/missions/{mission}/history?newest_first=true&limit=1")).json()
            half, all_of_them = await streams.until_there(newest["items"][0]["seq"], given.listeners)
            middle.append(half - sent)
            last.append(all_of_them - sent)
            await asyncio.sleep(0.2)
        each = (cpu_s(pid) - before) / given.changes
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
    }


def main() -> None:
    """Print the figures; end with 1 if they are beyond the limits."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--database", default="", help="SQLAlchemy address; default a fresh SQLite file")
    parser.add_argument("--listeners", type=int, default=1000)
    parser.add_argument("--changes", type=int, default=60)
    parser.add_argument("--idle-s", type=float, default=30.0)
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
        }
        outcrop = [sys.executable, "-m", "ground.cli"]
        subprocess.run([*outcrop, "migrate"], env=environment, check=True, cwd=ROOT)
        service = subprocess.Popen([*outcrop, "serve", "--port", str(port)], env=environment, cwd=ROOT)
        try:
            asyncio.run(wait_ready(f"http://127.0.0.1:{port}/healthz"))
            mission, _ = file_mission(f"http://127.0.0.1:{port}/api/v1")
            found = asyncio.run(measure(port, service.pid, mission, given))
        finally:
            service.terminate()
            service.wait(timeout=30)
    load = os.getloadavg()[0]
    print(json.dumps({"listeners": given.listeners, "load": load, **found}, indent=1))
    good = found["idle_share"] <= IDLE_SHARE and found["p99_last_s"] <= DELAY_S
    raise SystemExit(0 if good else 1)


if __name__ == "__main__":
    main()
