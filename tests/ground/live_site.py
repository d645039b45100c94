"""A signed package and a reference rover on the wire, for tests and studies of live runs."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from executive.runtime.wire import Address
from ground.uplink.training import make_team
from rover_iface.profile import standard_dictionary
from tests.ground.signed import signed_package

ROOT = Path(__file__).resolve().parents[2]
ROVER = ROOT / "examples" / "wire_rover" / "rover.py"
DICTIONARY = ROOT / "rover_iface" / "dictionaries" / "outcrop-rover.toml"
PLAN = """(plan :id day :library ((alternate :id safe :node (task :id beacon :action safemode)))
 :node (block :id all :node-list (
  (concurrent-block :id both :node-list (
    (task :id go :action navigate :parameters (x = 0.4 y = 0.3))
    (task :id look :action image)))
  (task :id rest :action wait :parameters (duration_s = 0.5))
  (task :id on :start-temporal-conditions ((rest end (0.2 60)))
    :action wait :parameters (duration_s = 0.3)))))"""


@dataclass(frozen=True)
class Site:
    """A folder with a package, keys, a world that holds the ledger, and a rover's address."""

    folder: Path
    package: Path
    trust: Path
    world: Path
    address: Address
    dictionary: tuple[str, str, str]

    @property
    def run(self) -> Path:
        return self.folder / "run"

    def command(self, *more: str, program: Sequence[str] = (sys.executable, "-m", "ground.cli")) -> list[str]:
        """Return the command that executes the package on the rover."""
        return [
            *program,
            "execute",
            str(self.package),
            *("--connect", str(self.address)),
            *("--world", str(self.world)),
            *("--trust", str(self.trust)),
            *("--out", str(self.run)),
            *("--dictionary", str(DICTIONARY)),
            *more,
        ]


def live_site(folder: Path, plan: str = PLAN) -> Site:
    team = make_team(folder / "keys", training=False)
    package, world = folder / "package.zip", folder / "world"
    package.write_bytes(signed_package(team, plan=plan))
    world.mkdir()
    language = standard_dictionary()
    named = (language.name, language.version, language.sha256)
    return Site(folder, package, team.trust, world, Address(folder / "rover.sock"), named)


def environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT)}


@contextlib.contextmanager
def lost_time(folder: Path) -> Iterator[list[float]]:
    """Give seconds that the machine takes from whoever sleeps and writes beside; they grow as it goes on.

    What a run is late by because the machine is busy, a thread beside it is late by as well.
    """
    over, lost = threading.Event(), [0.0]

    def measure() -> None:
        with (folder / "lost-time").open("wb") as file:
            while not over.is_set():
                begun = time.monotonic()
                over.wait(0.01)
                file.write(b".")
                os.fsync(file.fileno())
                lost.append(max(0.0, time.monotonic() - begun - 0.01))

    thread = threading.Thread(target=measure, daemon=True)
    thread.start()
    try:
        yield lost
    finally:
        over.set()
        thread.join()


@contextlib.contextmanager
def rover_process(address: Address) -> Iterator[subprocess.Popen[bytes]]:
    """Give the process of a reference rover that listens."""
    assert address.path is not None
    process = subprocess.Popen([sys.executable, str(ROVER), str(address)])
    try:
        end = time.monotonic() + 120
        while not address.path.exists():
            assert time.monotonic() < end
            time.sleep(0.01)
        yield process
    finally:
        process.kill()
        process.wait()
