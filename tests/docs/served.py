"""What stands for the placeholders of a page, and the one service on which its blocks `served` run.

The service is made when a page first needs it and ends with the program. Each page works on a mission of its
own, a copy of the first one, so that pages do not see each other's changes.
"""

from __future__ import annotations

import atexit
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

from tests.docs import made

ROOT = Path(__file__).resolve().parents[2]
START_S = 120.0
TARGETS = (("Rock1", 3.0, 3.5, "microscopic_imager", 9.0), ("Rock2", -4.0, 1.0, "science_camera", 12.0))
PLACE = '{"crs": "EPSG:32612", "x": 518334, "y": 4251500}'
KEEP_OUT = [[6.0, 2.0], [9.0, 2.0], [9.0, 5.0], [6.0, 5.0]]
PEOPLE = {"Ada": "planner", "Bo": "flight_director"}
WORDS = {"GET", "POST"}
"""Words in capital letters that stand for themselves; within quotes every word does."""
QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"")
PLACEHOLDER = re.compile(
    r"\b(?:[a-z]{2,4}-(?:\.\.\.|[A-Z]{2,}\b)|[a-z]{2}_\.\.\.)"  # msn-..., msn-COPY, oc_...
    r"|(?:--(?:out|world) )?(?<![^\s])[A-Z][A-Z0-9_]+(?![^\s])"  # --out RUN, PLAN
    r"|unix:/(?:tmp|run)/rover\.sock|127\.0\.0\.1:8000|--foxglove 8765|^ogrinfo"
    r"|naif0012\.tls|de440s\.bsp|outcrop-onboard\.pyz"
)
"""What a page writes for something that each reader has another of."""
TOLD = re.compile(r"\b(?:([a-z]{3})-[0-9a-z]{13}|(oc)_[\w-]{20,})")
"""Names and keys that the program makes."""


def outcrop(data: Path) -> tuple[list[str], dict[str, str]]:
    """Return the command of this checkout, and an environment in which it works on a data folder."""
    own = {k: v for k, v in os.environ.items() if not k.startswith("OUTCROP_")}
    more = {"OUTCROP_DATA_DIR": str(data), "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
    return [sys.executable, "-m", "ground.cli"], own | more


@dataclass(frozen=True)
class Service:
    """A running server and its data folder."""

    address: str
    data: Path

    def ask(self, path: str, body: object = None, *, who: str = "Planner") -> Any:
        """Ask the interface; a job is waited for until it is over."""
        request = Request(
            f"{self.address}/api/v1{path}",
            None if body is None else json.dumps(body).encode(),
            {"X-Outcrop-Person": who, "Content-Type": "application/json", "Prefer": "wait=60"},
        )
        with urlopen(request, timeout=120) as answer:
            found = json.load(answer)
        while (
            isinstance(found, dict) and found.get("state") in {"queued", "running"} and "subject_id" in found
        ):
            time.sleep(0.2)
            found = self.ask(f"/jobs/{found['id']}", who=who)
        return found

    @property
    def settings(self) -> dict[str, str]:
        """The environment by which commands find the service."""
        return {"OUTCROP_SERVER": self.address, "OUTCROP_DATA_DIR": str(self.data)}

    def outcrop(self, *words: str) -> str:
        """Run a command beside the service, and return what it printed."""
        command, environment = outcrop(self.data)
        environment |= self.settings
        done = subprocess.run(
            [*command, *words], env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"outcrop {' '.join(words)}: {done.stdout}{done.stderr}"
        return done.stdout

    @cached_property
    def first_mission(self) -> str:
        """The mission of which pages get copies: two targets, a request for each, a keep-out."""
        terrain = {"source": "generated", "seed": 7, "size_m": 72.0, "rock_cover": 0.03}
        about = {"name": "Yard", "notes": "", "rover_profile": "k9", "demo_content": False}
        mission = str(self.ask("/missions", {**about, "terrain": terrain})["id"])
        for name, east, north, instrument, value in TARGETS:
            target = self.ask(
                f"/missions/{mission}/targets", {"name": name, "east_m": east, "north_m": north}
            )
            order = {"target_id": target["id"], "instrument": instrument, "value": value}
            self.ask(f"/missions/{mission}/observation-requests", order)
        self.ask(f"/missions/{mission}/keep-outs", {"name": "K1", "notes": "", "polygon_m": KEEP_OUT})
        self.outcrop("mission", "set", mission, f"place={PLACE}")
        return mission


@cache
def service() -> Service:
    """Return the service; it is started on a free port, and ended with this program."""
    data = Path(tempfile.mkdtemp(prefix="outcrop-pages-"))
    atexit.register(shutil.rmtree, data, ignore_errors=True)
    command, environment = outcrop(data)
    environment |= {"OUTCROP_WEBHOOK_HOSTS": "hooks.example", "OUTCROP_WARM_UP": "false"}
    orders = [["migrate"], *(["person", "add", name, "--role", role] for name, role in PEOPLE.items())]
    for order in orders:
        subprocess.run([*command, *order], env=environment, check=True, stdout=subprocess.DEVNULL)
    log = data / "server.log"
    with log.open("w") as out:
        server = subprocess.Popen(
            [*command, "serve", "--port", "0"], env=environment, cwd=data, stdout=out, stderr=out
        )
    atexit.register(ended, server)
    end = time.monotonic() + START_S
    while "startup complete" not in log.read_text() and time.monotonic() < end and server.poll() is None:
        time.sleep(0.1)
    address = re.search(r"http://127\.0\.0\.1:\d+", log.read_text())
    if address is None:
        raise AssertionError(f"the server did not start:\n{log.read_text()}")
    return Service(address.group(), data)


def ended(process: subprocess.Popen[Any]) -> None:
    """End a process."""
    process.send_signal(signal.SIGINT)
    try:
        process.wait(20)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


class NoEntryError(LookupError):
    """A placeholder for which there is nothing."""


class Stand:
    """What the placeholders of one page stand for; each is made when it is first named."""

    def __init__(self) -> None:
        self._stack = ExitStack()
        self._folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory()))
        self._heard: dict[str, str] = {}
        self._count = 0
        self._edited: set[str] = set()
        self._run: Path | None = None
        self._plan = self._dry_run = ""

    def __enter__(self) -> Stand:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def settings(self) -> Mapping[str, str]:
        """The environment by which commands find the service."""
        return service().settings

    def heard(self, printed: str) -> None:
        """Keep the names that a command printed: they stand for later placeholders of their kind."""
        for found in TOLD.finditer(printed):
            self._heard[found[1] or found[2]] = found[0]

    def filled(self, command: str) -> str:
        """Return a command of a page with what its placeholders stand for.

        Raises
        ------
        NoEntryError
            With the placeholder that has no entry.
        """
        code, hash_, comment = command.partition(" #")
        return PLACEHOLDER.sub(lambda found: self._what(found, code), code) + hash_ + comment

    def _what(self, found: re.Match[str], code: str) -> str:
        placeholder = found[0]
        quoted = any(part.start() < found.start() < part.end() for part in QUOTED.finditer(code))
        if placeholder in WORDS or (placeholder.isupper() and quoted):
            return placeholder
        if placeholder in ENTRIES:
            return str(ENTRIES[placeholder](self))
        kind = re.fullmatch(r"([a-z]+)[-_]\.\.\.", placeholder)
        if kind is None or kind[1] not in self._heard:
            raise NoEntryError(placeholder)
        return self._heard[kind[1]]

    def fresh(self, name: str) -> Path:
        """Return a path at which nothing is yet."""
        self._count += 1
        return self._folder / f"{name}{self._count}"

    @cached_property
    def mission(self) -> str:
        """A mission of the page's own."""
        first = service().first_mission
        return str(service().ask(f"/missions/{first}/copy", {"name": self._folder.name})["id"])

    @cached_property
    def target(self) -> str:
        """The first target of the mission."""
        return str(service().ask(f"/missions/{self.mission}/targets")["items"][0]["id"])

    def plan(self) -> str:
        """Return the plan that the page is about."""
        return self._plan or self.new_plan()

    def new_plan(self) -> str:
        """Return a new plan of the mission that Ada asked for; its dry run has verified it."""
        order = {"time_limit_s": 2.0, "iterations": 2}
        self._plan = str(service().ask(f"/missions/{self.mission}/plans", order, who="Ada")["subject_id"])
        run = service().ask(f"/missions/{self.mission}/runs", {"plan_id": self._plan}, who="Ada")
        self._dry_run = str(run["subject_id"])
        return self._plan

    def dry_run(self) -> str:
        """Return the dry run of the plan."""
        self.plan()
        return self._dry_run

    def digest(self) -> str:
        """Return the digest of the plan's text."""
        return str(service().ask(f"/plans/{self.plan()}")["crl_sha256"])

    def copy(self) -> str:
        """Return the copy that the page made last; it and the mission were edited since, and differ."""
        copied = self._heard["msn"]
        if copied not in self._edited:
            self._edited.add(copied)
            for mission, notes in ((self.mission, "dusty"), (copied, "steep")):
                first = service().ask(f"/missions/{mission}/targets")["items"][0]["id"]
                service().outcrop("target", "set", first, f"notes={notes}")
        return copied

    def event(self) -> str:
        """Return the number of the mission's newest event."""
        return service().outcrop("history", "list", self.mission, "--limit", "1").split()[0]

    def approvers_key(self) -> Path:
        """Return the registered key of Bo, who may approve the plan: Ada signed it."""
        ada, bo = self.fresh("ada.key"), self.fresh("bo.key")
        for key, name in ((ada, "Ada"), (bo, "Bo")):
            service().outcrop("keys", "make", str(key))
            service().outcrop("keys", "register", str(key), "--as", name)
        service().outcrop("review", "sign", self.plan(), self.digest(), "--key", str(ada), "--as", "Ada")
        return bo

    @cached_property
    def package(self) -> Path:
        """A package whose plan is over in seconds."""
        folder = self.fresh("package")
        folder.mkdir()
        return made.package(folder, made.SHORT)

    @cached_property
    def turtles_package(self) -> Path:
        """The same for the robot of the example for ROS 2."""
        dictionary = ROOT / "examples/ros2_turtle/turtle.dictionary.toml"
        return made.package(self.package.parent, made.SHORT, dictionary)

    def world(self) -> Path:
        """Return a world in which nothing was carried out."""
        return made.world(self.fresh("world"), made.terrain(service().data / "ground"))

    def new_run(self) -> Path:
        """Return a folder for a run, which is `RUN` from now on."""
        self._run = self.fresh("run")
        return self._run

    def run(self) -> Path:
        """Return the folder of the page's last run, else of one made here."""
        if self._run is None:
            folder = self.fresh("flown")
            folder.mkdir()
            packed = made.package(folder, made.PLAN)
            self._run = made.flown(folder / "run", packed, made.terrain(service().data / "ground"))
        return self._run

    @cached_property
    def rover(self) -> str:
        """The address of a simulated rover that listens, until the page is over."""
        address = f"unix:{self.fresh('rover')}.sock"
        command, environment = outcrop(service().data)
        words = [
            "rover",
            "serve",
            "abstract",
            "--listen",
            address,
            "--world",
            str(self.world()),
            "--speed",
            "50",
        ]
        self._stack.callback(
            ended, subprocess.Popen([*command, *words], env=environment, stdout=subprocess.DEVNULL)
        )
        end = time.monotonic() + START_S
        while not Path(address.removeprefix("unix:")).exists() and time.monotonic() < end:
            time.sleep(0.1)
        return address

    @cached_property
    def onboard(self) -> Path:
        """The program for a rover."""
        return made.onboard(self.fresh("onboard"))


ENTRIES: Mapping[str, Callable[[Stand], object]] = {
    "msn-...": lambda stand: stand.mission,
    "msn-MISSION": lambda stand: stand.mission,
    "msn-COPY": Stand.copy,
    "tgt-...": lambda stand: stand.target,
    "pln-...": Stand.plan,
    "PLAN": Stand.plan,
    "OTHER_PLAN": Stand.new_plan,
    "run-...": Stand.dry_run,
    "CRL_SHA256": Stand.digest,
    "DIGEST": Stand.digest,
    "KEY": Stand.approvers_key,
    "EVENT": Stand.event,
    "PACKAGE": lambda stand: stand.package,
    "TURTLES_PACKAGE": lambda stand: stand.turtles_package,
    "TRUST": lambda stand: stand.package.parent / "keys/trust.json",
    "--world DIR": lambda stand: f"--world {stand.world()}",
    "WORLD": Stand.world,
    "--world WORLD": lambda stand: f"--world {stand.world()}",
    "--out RUN": lambda stand: f"--out {stand.new_run()}",
    "RUN": Stand.run,
    "BAG": lambda stand: made.bag(stand.fresh("bag")),
    "unix:/tmp/rover.sock": lambda stand: stand.rover,
    "unix:/run/rover.sock": lambda stand: stand.rover,
    "127.0.0.1:8000": lambda _: service().address.removeprefix("http://"),
    "--foxglove 8765": lambda _: "--foxglove 0",
    "outcrop-onboard.pyz": lambda stand: stand.onboard,
    "ogrinfo": lambda _: f"{sys.executable} -m tests.docs.ogrinfo",
    "naif0012.tls": lambda stand: made.leap_seconds(stand.fresh("leap-seconds")),
    "de440s.bsp": lambda stand: made.ephemerides(stand.fresh("ephemerides")),
}
"""What each placeholder stands for. Other names (`whk-...`) are what the page's commands printed last."""
