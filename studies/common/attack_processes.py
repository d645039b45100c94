"""The attackers' ground and rover as processes of their own: the server, every command, every execution.

An execution is killed at times and begun anew or resumed, as an operator would.
"""

from __future__ import annotations

import os
import random
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import httpx

from ground.gdr.repository import Repository, open_repository
from ground.uplink.training import Team
from studies.nursery import start
from tests.adversary.ground import Ask
from tests.adversary.oracle import Rover
from tests.adversary.service import MOVES, Script
from tests.ground.conftest import settings_for

PATIENCE_S = 60.0
"""A process that is not over by then hangs."""
KILLED = 0.15
"""Share of the executions that are killed within `LATEST_S` of their start."""
LATEST_S = 0.8
REFUSED = 2
"""Exit status of a command that refuses."""
TRACEBACK = "Traceback (most recent call last)"
CLOCKS = {"server_clock", "rover_clock"}
"""Moves that set a clock of this process: processes of their own look at that of the machine."""


class ProcessRover(Rover):
    """A rover whose program is `outcrop execute`."""

    def __init__(self, folder: Path, team: Team, world: Path, seed: int) -> None:
        super().__init__(folder, team, world)
        self._rng = random.Random(seed)
        self._drawing = threading.Lock()

    def carry_out(self, package: Path, trust: Path, out: Path, *, resume: bool) -> None:
        with self._drawing:
            killed, late_s = self._rng.random() < KILLED, self._rng.random() * LATEST_S
            again = self._rng.random() < 0.5
        self._execute(package, trust, out, resume, late_s if killed else None)
        if killed:
            self.count("executions killed")
            if again:
                self._execute(package, trust, out, True, None)

    def _execute(self, package: Path, trust: Path, out: Path, resume: bool, late_s: float | None) -> None:
        words = [
            "execute",
            str(package),
            "--world",
            str(self.world),
            "--trust",
            str(trust),
            "--out",
            str(out),
        ]
        said = self.folder / f"said-{out.name}-{time.monotonic_ns()}"
        process = start([*words, *["--resume"] * resume], said)
        if late_s is not None:
            process.join(late_s)
            process.kill()
        self.read(process, said, "execute")

    def read(self, process: BaseProcess, said: Path, what: str) -> None:
        """Wait for the end of a command, and count what it should not have said."""
        process.join(PATIENCE_S)
        if process.is_alive():
            process.kill()
            self.count("tracebacks", f"{what}: not over after {PATIENCE_S:.0f} s")
        words = said.read_text(errors="replace") if said.exists() else ""
        if TRACEBACK in words:
            self.count("tracebacks", f"{what}: {words[-300:]}")
        if process.exitcode == REFUSED and what == "execute" and "Usage:" not in words:
            told = [line for line in words.splitlines() if not line.startswith("outcrop: the ledger")]
            if len(told) != 1:
                self.count("refusals of more than a line", words)


class _Server:
    """A server process, asked over a socket."""

    def __init__(self, repo: Repository, address: str) -> None:
        self.repo = repo
        self.http = httpx.Client(base_url=address, timeout=PATIENCE_S, trust_env=False)

    def __call__(
        self, method: str, path: str, json: Any = None, *, who: str | None = None, **options: Any
    ) -> httpx.Response:
        headers = {**options.pop("headers", {}), **({} if who is None else {"X-Outcrop-Person": who})}
        return self.http.request(method, f"/api/v1{path}", json=json, headers=headers, **options)


class ProcessScript(Script):
    """A script of moves against processes."""

    @property
    def moves_to_draw(self) -> Sequence[Callable[[Script], None]]:
        return [move for move in MOVES if move.__name__ not in CLOCKS]

    def make_rover(self, world: Path) -> ProcessRover:
        return ProcessRover(self.folder, self.ground.team, world, self.rng.randrange(2**31))

    @contextmanager
    def serve(self) -> Iterator[Ask]:
        from studies.service_kills import free_port

        log, port = self.folder / "server.log", free_port()
        process = start(["serve", "--no-worker", "--port", str(port)], log, self._environment())
        repo = open_repository(settings_for(self.folder / "data"))
        server = _Server(repo, f"http://127.0.0.1:{port}")
        try:
            _await(server.http, process, log)
            yield server
        except httpx.TransportError as err:
            process.join(1.0)
            words = log.read_text(errors="replace")
            self.rover.count(
                "requests without an answer",
                f"{err!r} of {self.moves}, server's exit {process.exitcode}: {words[-200:]}",
            )
        finally:
            server.http.close()
            repo.database.dispose()
            process.terminate()
            process.join(PATIENCE_S)
            process.kill()
            if TRACEBACK in (words := log.read_text(errors="replace")):
                self.rover.count("tracebacks", f"server after {self.moves}: {words[-600:]}")

    def run(self, arguments: list[str]) -> None:
        said = self.folder / f"said-{time.monotonic_ns()}"
        process = start(arguments, said, self._environment())
        assert isinstance(self.rover, ProcessRover)
        self.rover.read(process, said, " ".join(arguments[:2]))

    def _environment(self) -> dict[str, str]:
        return {
            "OUTCROP_DATA_DIR": str(self.folder / "data"),
            "OUTCROP_EXECUTOR": "inline",
            "OUTCROP_WARM_UP": "false",
            "OUTCROP_LOG_LEVEL": "error",
            "PATH": os.environ["PATH"],
        }


def _await(http: httpx.Client, process: BaseProcess, log: Path) -> None:
    """Return when the server answers."""
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until and process.is_alive():
        try:
            if http.get("/healthz").status_code == httpx.codes.OK:
                return
        except httpx.TransportError:
            time.sleep(0.05)
    raise RuntimeError(f"the server did not come up: {log.read_text(errors='replace')[-2000:]}")
