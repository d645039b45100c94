"""Parallel guesses of one password on a real server, and a right one from another address meanwhile.

    .venv/bin/python -m studies.guesses --guesses 5000

All connections are to this machine: guesses from 127.0.0.1, the owner from 127.0.0.2.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from ground.gdr.migrate import migrate
from ground.gdr.repository import open_repository
from ground.records.actor import SYSTEM_ACTOR, Role
from ground.resources.people.accounts import create_person, ensure_profiles
from ground.resources.people.log_in_limits import TRIES, paid
from ground.settings import load_settings
from studies.service_kills import free_port

NAME, PASSWORD = "Ann", "correct horse battery"
ALLOWED_MIB = 150.0


async def log_in(port: int, password: str, source: str) -> int:
    """Return the status of one log-in on a connection of its own, 0 if there was none."""
    body = json.dumps({"name": NAME, "password": password}).encode()
    head = (
        "POST /api/v1/session HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
        f"Content-Length: {len(body)}\r\nConnection: close\r\n\r\n"
    )
    try:
        reader, writer = await asyncio.open_connection("127.0.0.1", port, local_addr=(source, 0))
        writer.write(head.encode() + body)
        line = await asyncio.wait_for(reader.readline(), 120.0)
        writer.close()
        return int(line.split()[1])
    except (OSError, TimeoutError, IndexError):
        return 0


def memory_mib(pid: int) -> tuple[float, float]:
    """Return the memory a process holds, and the most that it held."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    found = dict(line.split(":", 1) for line in lines)
    now, most = (float(found[name].split()[0]) / 1024 for name in ("VmRSS", "VmHWM"))
    return now, most


async def attack(port: int, guesses: int) -> tuple[Counter[int], int]:
    """Return how often each status came, and the status of the right password in the middle of it."""
    tasks = [asyncio.create_task(log_in(port, f"guess {n}", "127.0.0.1")) for n in range(guesses)]
    await asyncio.sleep(0.5)
    right = await log_in(port, PASSWORD, "127.0.0.2")
    return Counter(await asyncio.gather(*tasks)), right


def main() -> None:
    """Print the counts; end with 1 if more was tried, the owner kept out, or memory grew too much."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--guesses", type=int, default=5000)
    asked = parser.parse_args()
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    with tempfile.TemporaryDirectory(prefix="outcrop-guesses-") as folder:
        repo = open_repository(load_settings(data_dir=Path(folder), auth="accounts"))
        migrate(repo.database)
        ensure_profiles(repo)
        create_person(repo, SYSTEM_ACTOR, NAME, Role.PLANNER, PASSWORD)
        port = free_port()
        environment = {
            **os.environ,
            "OUTCROP_DATA_DIR": folder,
            "OUTCROP_AUTH": "accounts",
            "OUTCROP_WARM_UP": "false",
            "OUTCROP_LOG_LEVEL": "error",
        }
        command = [sys.executable, "-m", "ground.cli", "serve", "--no-worker", "--port", str(port)]
        server = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
        try:
            until = time.monotonic() + 120.0
            while asyncio.run(log_in(port, PASSWORD, "127.0.0.2")) != 201 and time.monotonic() < until:
                time.sleep(0.2)
            before, _ = memory_mib(server.pid)
            counts, right = asyncio.run(attack(port, asked.guesses))
            after, most = memory_mib(server.pid)
        finally:
            server.kill()
            server.wait()
        tried = paid(repo, NAME, "127.0.0.1")
        repo.database.dispose()
    print(
        f"{asked.guesses} guesses: {dict(counts)}; {counts[401]} tried, {tried} paid for; the right password "
        f"from another address: {right}; memory {before:.0f} MiB, at most {most:.0f}, afterwards {after:.0f}"
    )
    good = counts[401] == tried <= TRIES and right == 201 and most - before <= ALLOWED_MIB and not counts[500]
    raise SystemExit(0 if good else 1)


if __name__ == "__main__":
    main()
