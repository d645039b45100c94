"""What processes of a service use: processor time, memory, files; and waiting for them."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable
from pathlib import Path

import httpx

TICKS = os.sysconf("SC_CLK_TCK")
"""Of the kernel's clock in a second."""
PATIENCE_S = 600.0


def free_port() -> int:
    """Return a port of this machine that nobody listens on."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


def answers(client: httpx.Client, path: str) -> bool:
    """Return whether a server is up."""
    try:
        return client.get(path).is_success
    except httpx.HTTPError:
        return False


def until(true: Callable[[], bool], what: str, patience_s: float = PATIENCE_S) -> None:
    """Wait until something holds."""
    end = time.monotonic() + patience_s
    while not true():
        if time.monotonic() > end:
            raise SystemExit(f"{what}: not within {patience_s:g} s")
        time.sleep(0.01)


def children(pid: int) -> list[int]:
    """Return all processes below one."""
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        direct = [int(c) for task in tasks for c in (task / "children").read_text().split()]
    except OSError:
        return []
    return direct + [below for child in direct for below in children(child)]


def cpu_of(pid: int) -> float:
    """Return user and system seconds, with those of children that were waited for."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(") ", 1)[1].split()
    except OSError:
        return 0.0
    return sum(int(fields[n]) for n in (11, 12, 13, 14)) / TICKS


def cpu_of_all(pid: int) -> float:
    """Return user and system seconds of a process and of all that run below it."""
    return sum(map(cpu_of, (pid, *children(pid))))


def resident_mib(pid: int) -> float:
    """Return the memory that is a process's own."""
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except OSError:
        return 0.0
    own = [line for line in lines if line.startswith(("Private_Clean:", "Private_Dirty:"))]
    return sum(int(line.split()[1]) for line in own) / 1024


def size_of(folder: Path) -> int:
    """Return the bytes of all files below a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
