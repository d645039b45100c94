"""A rover of this installation behind the wire, in a process of its own."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from executive.errors import WireError
from executive.runtime.clocks import MonotonicClock
from executive.runtime.wire.address import Address, Keys, bound_address, dial, listen
from executive.runtime.wire.server import About, RoverServer
from ground.errors import InvalidInputError

ROVER_SOCKET = "rover.sock"
"""Where the rover of a run listens that is made for it, in the folder of the run."""
PROGRESS_S = 1.0
"""Seconds of the rover's clock between two reports of the pose during a drive."""


@dataclass(frozen=True, slots=True)
class Serving:
    """Which rover is served, where; `linger_s` without an executive end it, None = never."""

    rover: str
    world: Path
    address: Address
    keys: Keys | None = None
    out: Path | None = None
    seed: int | None = None
    speed: float = 1.0
    linger_s: float | None = None


def serve_rover(serving: Serving, say: Callable[[str], None]) -> None:
    """Serve a rover until the process is interrupted; `say` is told in a line where it listens.

    Raises
    ------
    RoverError
        If there is no such rover or its world cannot be read.
    WireError
        If the place is taken, or leads off the machine without keys.
    """
    from rover_iface.registry import find_rover
    from rover_iface.simulator.world import load_world

    language = load_world(serving.world).profile.language
    with tempfile.TemporaryDirectory() as scratch:
        out = serving.out or Path(scratch)
        options = {} if serving.seed is None else {"seed": serving.seed}
        rover = find_rover(serving.rover)(serving.world, out=out, progress_s=PROGRESS_S, **options)
        dictionary = {"name": language.name, "version": language.version, "sha256": language.sha256}
        server = RoverServer(
            rover,
            About(serving.rover, serving.speed, dictionary),
            MonotonicClock(speed=serving.speed),
            out=out,
            inject=_inject(rover),
        )
        door = listen(serving.address, serving.keys)  # whoever finds it finds a rover behind it
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: server.stop_serving())
        if serving.linger_s is not None:
            watch = threading.Thread(target=_end_when_alone, args=(server, serving.linger_s), daemon=True)
            watch.start()
        say(f"{serving.rover} listens on {bound_address(serving.address, door)}")
        try:
            server.serve(door, serving.keys)
        finally:
            door.close()
            if serving.address.path is not None:
                serving.address.path.unlink(missing_ok=True)


def _end_when_alone(server: RoverServer, linger_s: float) -> None:
    while not server.over.wait(0.2):
        if not server.has_executive and time.monotonic() - server.alone_since > linger_s:
            break
    server.stop_serving()


def _inject(rover: object) -> Callable[[dict[str, object]], None] | None:
    """Return how a rover is made to suffer a fault: now, unless it is tied to a task."""
    from rover_iface.simulator.engine import SimulatedRover
    from rover_iface.simulator.faults import load_faults

    if not isinstance(rover, SimulatedRover):
        return None

    def suffer(document: dict[str, object]) -> None:
        named = "task" in document or "at_s" in document
        for fault in load_faults([document if named else {**document, "at_s": rover.t_s}]):
            rover.add_fault(fault)

    return suffer


@contextlib.contextmanager
def rover_at(serving: Serving) -> Iterator[None]:
    """Give a process that serves a rover at its address, that of a run before or a new one.

    It outlives a process that is killed, and the run can be taken up again; else it ends with this.

    Raises
    ------
    InvalidInputError
        If the speed is none, or the process ends at once; the message is what it said.
    """
    if not 0.0 < serving.speed <= 1000.0:
        raise InvalidInputError(f"the speed is {serving.speed:g}; it may be up to 1000 times real time")
    assert serving.out is not None, "a rover of a run writes into the folder of the run"
    if _listens(serving.address):
        yield
        return
    serving.out.mkdir(parents=True, exist_ok=True)
    log = serving.out / "rover-process.log"
    process = _start(serving, log)
    try:
        while not _listens(serving.address):
            if process.poll() is not None:
                said = log.read_text("utf-8", "replace").strip().splitlines() or ["it said nothing"]
                raise InvalidInputError(f"the rover {serving.rover!r} did not start: {said[-1]}")
            time.sleep(0.02)
        yield
    finally:
        if process.poll() is None:
            process.terminate()
            process.wait(timeout=10)


def _listens(address: Address) -> bool:
    try:
        dial(address, timeout_s=1.0).close()
    except WireError:
        return False
    return True


def _start(serving: Serving, log: Path) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "ground.cli", "rover", "serve", serving.rover]
    command += ["--listen", str(serving.address), "--world", str(serving.world)]
    command += ["--speed", f"{serving.speed!r}"]
    for option, value in (("out", serving.out), ("seed", serving.seed), ("linger", serving.linger_s)):
        command += [] if value is None else [f"--{option}", str(value)]
    with log.open("ab") as file:
        return subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=file, stderr=file, start_new_session=True
        )
