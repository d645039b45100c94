"""Packages that go to a rover and come back, by processes of `outcrop execute` and `ingest` that are killed.

Each package is executed and taken in by an operator who repeats a command until it says it is done: after
a death `execute --resume`, and a fresh start where the rover says that nothing was begun.
"""

from __future__ import annotations

import random
import shutil
import signal
import threading
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import func, select

from executive.crl import canonical_text, digest, parse
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.resources.missions.value import Mission
from ground.resources.packages.row import PackageRow
from ground.resources.plans.row import PlanRow
from ground.resources.products.row import ProductRow
from ground.resources.runs.row import RunRow
from ground.uplink.execute import Place, execute_package
from ground.uplink.ledger import Ledger
from ground.uplink.package import manifest_text
from ground.uplink.training import Team, make_team, sign_package
from studies.nursery import start
from tests.ground.signed import about, small_world
from tests.ground.test_killed import uplinked_plan

EXECUTE, INGEST = "execute", "database client"
PATIENCE_S = 120.0
"""A process that is not over by then hangs."""
SEED = 5
"""Of the simulated rover: a run that died and went on has to be the run that never died."""


@dataclass(frozen=True, slots=True)
class Ended:
    """Exit status of a process, negative the signal that killed it, and what it printed."""

    status: int
    said: str


class Uplink(threading.Thread):
    """Executes packages one by one and takes the runs in; the next process of a kind is killed on demand."""

    def __init__(self, repo: Repository, mission: Mission, environment: dict[str, str], seed: int) -> None:
        super().__init__(daemon=True)
        self.repo, self.mission, self.environment = repo, mission, environment
        self.rng = random.Random(seed * 100 + 99)
        self.folder = repo.data_dir / "rover"
        self.world = small_world(self.folder)
        self.team: Team = make_team(self.folder / "keys", training=False)
        self.plan_id, self.text = _plan(repo, mission)
        self.wanted: set[str] = set()
        self.typical_s = {EXECUTE: 0.6, INGEST: 0.6}
        self.sent: list[str] = []
        self.found: Counter[str] = Counter()
        self.ending = threading.Event()
        self.broken = ""

    def run(self) -> None:
        while not self.broken:
            while not self.wanted and not self.ending.is_set():
                time.sleep(0.05)
            if self.ending.is_set() and self.found["runs"]:
                return
            package = self._next_package()
            out = package.with_suffix("")
            if self._execute(package, out) and self._ingest(out):
                self.found["runs"] += 1

    def judge(self) -> Counter[str]:
        """Return what was executed or taken in never, twice or otherwise than without a death."""
        found = Counter(self.found)
        begun = Counter(str(entry.get("sha256")) for entry in Ledger(self.world).entries)
        with self.repo.database.read() as session:
            ran = Counter(session.scalars(select(RunRow.package_sha256)))
            counted = select(RunRow.package_sha256, func.count(ProductRow.id)).join(
                ProductRow, ProductRow.run_id == RunRow.id
            )
            products = dict(session.execute(counted.group_by(RunRow.package_sha256)).all())
        trace, wanted = self._undisturbed()
        for number, sha256 in enumerate(self.sent, 1):
            found["executions lost"] += begun[sha256] == 0 or ran[sha256] == 0
            found["executions twice"] += begun[sha256] > 1 or ran[sha256] > 1
            found["executions changed by a death"] += (
                self._path(number).with_suffix("").joinpath("trace.jsonl").read_bytes() != trace
                or products.get(sha256, 0) != wanted
            )
        if self.broken:
            found["gave up"] += 1
            print(self.broken)
        return found

    def _path(self, number: int) -> Path:
        return self.folder / f"package-{number}.zip"

    def _content(self, counter: int) -> bytes:
        said = about(counter, mission=self.mission.id, plan=self.plan_id)
        landmarks = '{"format": "landmarks/1"}\n'
        return sign_package(self.team, manifest_text(said, self.text, landmarks), self.text, landmarks)

    def _next_package(self) -> Path:
        counter = len(self.sent) + 1
        path = self._path(counter)
        path.write_bytes(self._content(counter))
        sha256 = self.repo.files.put_bytes(path.read_bytes()).sha256
        row = PackageRow(
            id=new_id("pkg"),
            author="Operator",
            mission_id=self.mission.id,
            plan_id=self.plan_id,
            sequence=counter,
            sha256=sha256,
            key_id="none",
        )
        with self.repo.database.write() as session:
            session.add(row)
        self.sent.append(sha256)
        return path

    def _undisturbed(self) -> tuple[bytes, int]:
        """Return the trace of the plan where nothing dies, and its number of products."""
        path, out = self.folder / "alone.zip", self.folder / "alone"
        path.write_bytes(self._content(1))
        place = Place("abstract", small_world(self.folder / "other"), self.team.trust, SEED)
        _, flight = execute_package(path, place, out)
        return (out / "trace.jsonl").read_bytes(), len(flight.outcome.products)

    def _execute(self, package: Path, out: Path) -> bool:
        resume = False
        common = ["--world", str(self.world), "--trust", str(self.team.trust), "--seed", str(SEED)]
        while True:
            more = ["--resume"] if resume else []
            end = self._process(
                EXECUTE,
                ["execute", str(package), *common, "--out", str(out), *more],
                package.with_suffix(".log"),
            )
            if end.status in {0, 1} and "Traceback" not in end.said:
                return True
            if end.status == -signal.SIGKILL:
                resume = True
            elif resume and "was not begun here" in end.said:
                shutil.rmtree(out, ignore_errors=True)
                resume = False
            elif resume and "came to its end" in end.said:
                return True
            else:
                return self._gave_up(end)

    def _ingest(self, out: Path) -> bool:
        while True:
            end = self._process(INGEST, ["ingest", str(out)], out.with_suffix(".ingest.log"))
            if end.status == 0 or (end.status == 2 and "was taken in before" in end.said):
                return True
            lost = end.status == 2 and "closed the connection" in end.said
            if end.status != -signal.SIGKILL and not lost:
                return self._gave_up(end)
            self.found["refused without a connection"] += lost

    def _gave_up(self, end: Ended) -> bool:
        self.broken = f"exit status {end.status}: {end.said[-2000:]}"
        return False

    def _process(self, kind: str, arguments: list[str], log: Path) -> Ended:
        log.unlink(missing_ok=True)
        process, begun = start(arguments, log, self.environment), time.monotonic()
        if kind in self.wanted:
            process.join(self.rng.uniform(0.0, self.typical_s[kind]))
            if process.is_alive():
                process.kill()
        process.join(PATIENCE_S)
        if process.exitcode is None:
            process.kill()
            process.join()
            return Ended(99, f"{arguments[0]} hung for {PATIENCE_S:g} s")
        if process.exitcode == -signal.SIGKILL:
            self.found[f"kills of {kind}"] += 1
            self.wanted.discard(kind)
        else:
            self.typical_s[kind] += 0.2 * (time.monotonic() - begun - self.typical_s[kind])
        said = log.read_text(errors="replace") if log.exists() else ""
        return Ended(process.exitcode, said)


def _plan(repo: Repository, mission: Mission) -> tuple[str, str]:
    """File a plan of pictures and waits as it stands after its uplink; return its id and its text."""
    plan_id = uplinked_plan(repo, mission)
    with repo.database.write() as session:
        plan = session.get_one(PlanRow, plan_id)
        (request,) = plan.request_ids
        goes = '(task :id go :action navigate :parameters (target = "T1") :continue-on-failure t)'
        looks = (
            f'(task :id look{n} :action image :parameters (target = "T1" instrument = "scicam") '
            f'  :metadata (observation = "T1-img" request = "{request}") :continue-on-failure t) '
            f"(task :id rest{n} :action wait :parameters (duration_s = {n + 1}))"
            for n in range(8)
        )
        steps = goes + "".join(looks)
        plan.crl_text = canonical_text(parse(f"(plan :id day :node (block :id all :node-list ({steps})))"))
        plan.crl_sha256 = digest(parse(plan.crl_text))
        return plan_id, plan.crl_text
