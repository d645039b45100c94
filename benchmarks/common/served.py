"""A service with a folder and a database of its own, in a process of its own, and what it is asked."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx

from ground.gdr.repository import Repository, open_repository
from ground.settings import load_settings
from studies.common.databases import own_database
from studies.common.processes import answers, cpu_of, free_port, until

ROOT = Path(__file__).resolve().parents[2]
OUTCROP = [sys.executable, "-m", "ground.cli"]
START_S = 60.0

Environment = dict[str, str]


@dataclass(frozen=True, slots=True)
class Server:
    """A process that listens on a port of this machine."""

    port: int
    pid: int

    @property
    def address(self) -> str:
        """Return where it is."""
        return f"http://127.0.0.1:{self.port}"

    @property
    def api(self) -> str:
        """Return where its interface is."""
        return f"{self.address}/api/v1"

    def cpu_s(self) -> float:
        """Return the processor seconds that it has used."""
        return cpu_of(self.pid)


@contextmanager
def place(database: str = "", **settings: str) -> Iterator[Environment]:
    """Give the environment of a service with a migrated database, on SQLite or the PostgreSQL server named.

    Folder and database are new, and gone afterwards. Settings are named as variables without `OUTCROP_`.
    """
    with tempfile.TemporaryDirectory(prefix="outcrop-bench-") as folder, own_database(database) as own:
        given = {"DATA_DIR": folder, "DATABASE_URL": own, "LOG_LEVEL": "error", "AUTH": "profiles"}
        given |= {"SERVE_WORKER": "false", "WARM_UP": "false", **settings}
        environment = os.environ | {f"OUTCROP_{name}": value for name, value in given.items()}
        subprocess.run([*OUTCROP, "migrate"], env=environment, check=True, cwd=ROOT, capture_output=True)
        yield environment


@contextmanager
def repository(environment: Environment) -> Iterator[Repository]:
    """Give the repository of a place."""
    names = ("DATA_DIR", "DATABASE_URL", "AUTH")
    given = {name.lower(): environment[f"OUTCROP_{name}"] for name in names}
    repo = open_repository(load_settings(**given, executor="inline"))
    try:
        yield repo
    finally:
        repo.database.dispose()


@contextmanager
def process(command: list[str], port: int, ready: str, environment: Environment) -> Iterator[Server]:
    """Give a server once it answers on the path `ready`; it ends with the block."""
    child = subprocess.Popen(command, env=environment, cwd=ROOT, stdout=subprocess.DEVNULL)
    try:
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=60.0, trust_env=False) as client:
            until(lambda: answers(client, ready), "an answer of the server", START_S)
        yield Server(port, child.pid)
    finally:
        child.terminate()
        child.wait(timeout=30)


@contextmanager
def service(environment: Environment) -> Iterator[Server]:
    """Give the service of a place."""
    port = free_port()
    with process([*OUTCROP, "serve", "--port", str(port)], port, "/healthz", environment) as server:
        yield server


def file_mission(base: str, secret: str = "") -> tuple[str, str]:
    """Make a mission with one target, as the owner of a secret; return the ids of both."""
    headers = {"Authorization": f"Bearer {secret}"} if secret else {}
    with httpx.Client(base_url=base, headers=headers, timeout=120.0) as client:
        terrain = {"source": "generated", "seed": 1, "size_m": 48.0}
        mission = client.post("/missions", json={"name": "Bench", "terrain": terrain}).json()["id"]
        body = {"east_m": 2.0, "north_m": 2.0}
        target = client.post(f"/missions/{mission}/targets", json=body).json()["id"]
    return mission, target


async def ask(port: int, path: str, connections: int, more: Callable[[int], bool]) -> tuple[list[float], int]:
    """Ask one path over kept-alive connections; return latencies, seconds, and the number of errors.

    Each connection goes on while `more`, given the number of its answers, is true. Raw sockets: a client
    library would cost more than the servers under test.
    """
    request = f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode()
    latencies: list[float] = []
    errors = 0

    async def one() -> None:
        nonlocal errors
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        answered = 0
        try:
            while more(answered):
                began = time.perf_counter()
                writer.write(request)
                head = await reader.readuntil(b"\r\n\r\n")
                length = int(head.lower().split(b"content-length:")[1].split(b"\r\n")[0])
                await reader.readexactly(length)
                latencies.append(time.perf_counter() - began)
                answered += 1
                errors += not head.startswith(b"HTTP/1.1 200")
        except (asyncio.IncompleteReadError, ConnectionError, IndexError):
            errors += 1
        finally:
            writer.close()

    await asyncio.gather(*(one() for _ in range(connections)))
    return latencies, errors
