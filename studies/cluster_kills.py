"""Dask on loopback: equal to local, killed with SIGKILL, and a scheduler that is away for minutes.

    .venv/bin/python -m studies.cluster_kills --kills 30 --away-s 300
    .venv/bin/python -m studies.cluster_kills --kills 30 --database postgresql://postgres@127.0.0.1/postgres

A scheduler, two Dask workers, a server without a worker and one `outcrop worker`, each a process that is
started again when it ends. First six dry runs and six plans while nobody is killed. Then so many kills of a
Dask worker, as many of the scheduler, as many of the `outcrop worker`, while rows say that jobs run; then the
scheduler stays away while jobs are asked for. In the end each job has succeeded, each was settled once, each
run has the trace and products that its seed has in this process without a cluster, each plan the CRL.

A process is killed when it is up again, a job has made progress since the kill before, and at a random
instant after that it has work: a Dask worker or the scheduler by the scheduler's word at that instant, the
`outcrop worker` by the rows. An instant without work is let pass and another drawn, so that every kill
counted has met some; how many were let pass is printed.
"""

from __future__ import annotations

import argparse
import os
import random
import secrets
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import httpx
from distributed import Client
from distributed.comm import CommClosedError
from sqlalchemy import func, make_url, select

from ground.app.job_kinds import job_kinds
from ground.gdr.history import EventRow, verify_chains
from ground.gdr.migrate import migrate
from ground.gdr.repository import Repository, open_repository
from ground.jobs.row import JobRow
from ground.jobs.worker import Worker
from ground.records.actor import Actor, Role
from ground.resources.mission_setup.create_mission import GeneratedTerrain, create_mission
from ground.resources.observation_requests.bodies import ObservationRequestCreate
from ground.resources.observation_requests.create_request import create_request
from ground.resources.people.accounts import ensure_profiles
from ground.resources.plans.bodies import PlanCreate
from ground.resources.plans.generate_plan import generate_plan
from ground.resources.plans.row import PlanRow
from ground.resources.products.row import ProductRow
from ground.resources.runs.bodies import RunCreate
from ground.resources.runs.dry_run import dry_run
from ground.resources.runs.row import RunRow
from ground.resources.sols.create_sol import create_sol
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.create_target import create_target
from ground.settings import ExecutorKind, load_settings
from studies.common.databases import own_database
from studies.common.processes import free_port
from studies.nursery import start

TRACEBACK, SHOWN = "Traceback (most recent call last)", 4_000
"""What begins one in a log, and characters of it that are told."""

LEASE_S = 3.0
ATTEMPTS = 100
"""More than there are kills: one job may be met by each, and is to end well all the same."""
PATIENCE_S = 240.0
"""Jobs that are not over so long after the last kill, or never in their middle, stand for a hang."""
SEEDS = 6
TARGETS = ((5.0, 2.0), (-4.0, 5.0), (3.0, -6.0))
ITERATIONS = 2000
RUN_S = 2.5
"""Real seconds of a run, so that kills find it in the middle."""
IN_FLIGHT = 5
PLANNER = Actor("Planner", Role.PLANNER)
DASK_WORKERS = ("dask-worker-0", "dask-worker-1")
KINDS = (DASK_WORKERS, ("scheduler",), ("worker",))
STUDY_S = 0.05
SCHEDULER_S = 2.0
"""Longest wait for the scheduler's word of who works; it may just have been killed."""
BEGUN = 0.02
"""Progress of work that has begun."""


@dataclass
class Machines:
    """The processes of a cluster and a service; whoever ends is started again, as a supervisor would."""

    folder: Path
    database: str
    scheduler_port: int = field(default_factory=free_port)
    server_port: int = field(default_factory=free_port)
    processes: dict[str, subprocess.Popen[bytes] | BaseProcess] = field(default_factory=dict)
    away: set[str] = field(default_factory=set)
    starts: Counter[str] = field(default_factory=Counter)
    ending: threading.Event = field(default_factory=threading.Event)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _keeper: threading.Thread | None = None

    @property
    def scheduler(self) -> str:
        return f"tcp://127.0.0.1:{self.scheduler_port}"

    @property
    def environment(self) -> dict[str, str]:
        return {
            "OUTCROP_DATA_DIR": str(self.folder),
            "OUTCROP_DATABASE_URL": self.database,
            "OUTCROP_EXECUTOR": "distributed",
            "OUTCROP_DASK_SCHEDULER": self.scheduler,
            "OUTCROP_WORKERS": "3",
            "OUTCROP_WARM_UP": "false",
            "OUTCROP_JOB_LEASE_S": str(LEASE_S),
            "OUTCROP_JOB_ATTEMPTS": str(ATTEMPTS),
            "OUTCROP_LOG_LEVEL": "warning",
        }

    def begin(self) -> None:
        """Start all, and the thread that starts them again."""
        for name in ("scheduler", *DASK_WORKERS, "server", "worker"):
            self._start(name)
        self._keeper = threading.Thread(target=self._keep, daemon=True)
        self._keeper.start()

    def lives(self, name: str) -> bool:
        """Return whether a process is up."""
        with self._lock:
            return _alive(self.processes[name])

    def kill(self, name: str) -> None:
        """Kill a process."""
        with self._lock:
            process = self.processes[name]
            process.kill()
            _join(process)

    def at_work(self) -> set[str]:
        """Return the names of the Dask workers that have work now, by the scheduler's word."""
        try:
            with Client(self.scheduler, timeout=SCHEDULER_S, set_as_default=False) as client:
                known = client.scheduler_info(n_workers=-1)["workers"]
                return {
                    str(known[at]["name"]) for at, work in client.processing().items() if work and at in known
                }
        except (OSError, TimeoutError, CommClosedError):
            return set()

    def end(self) -> None:
        """Kill all for good."""
        self.ending.set()
        if self._keeper is not None:
            self._keeper.join()
        for name in self.processes:
            self.kill(name)

    def _keep(self) -> None:
        while not self.ending.wait(0.2):
            with self._lock:
                for name, process in self.processes.items():
                    if not _alive(process) and name not in self.away:
                        self._start(name)

    def _start(self, name: str) -> None:
        self.starts[name] += 1
        if name == "server":
            given = ["serve", "--no-worker", "--port", str(self.server_port)]
            self.processes[name] = start(given, self.folder / "server.log", self.environment)
        elif name == "worker":
            self.processes[name] = start(["worker"], self.folder / "worker.log", self.environment)
        else:
            self.processes[name] = self._dask(name)

    def _dask(self, name: str) -> subprocess.Popen[bytes]:
        given = ["scheduler", "--host", "127.0.0.1", "--port", str(self.scheduler_port), "--no-dashboard"]
        if name != "scheduler":
            given = [
                "worker",
                self.scheduler,
                "--name",
                name,
                "--nthreads",
                "2",
                "--no-nanny",
                "--no-dashboard",
            ]
            given += ["--local-directory", str(self.folder / name)]
        with (self.folder / "dask.log").open("ab") as log:
            command = [sys.executable, "-m", "dask", *given]
            path = os.pathsep.join(filter(None, (str(Path.cwd()), os.environ.get("PYTHONPATH", ""))))
            environment = {**os.environ, "PYTHONPATH": path}
            return subprocess.Popen(command, stdout=log, stderr=log, env=environment)


def _alive(process: subprocess.Popen[bytes] | BaseProcess) -> bool:
    return process.poll() is None if isinstance(process, subprocess.Popen) else process.is_alive()


def _join(process: subprocess.Popen[bytes] | BaseProcess) -> None:
    if isinstance(process, subprocess.Popen):
        process.wait()
    else:
        process.join()


class Day:
    """A mission with a plan, the jobs that are asked of it, and what each has to come to."""

    def __init__(self, repo: Repository, seed: int) -> None:
        self.repo, self.rng = repo, random.Random(seed)
        source = GeneratedTerrain(seed=seed % 1000, size_m=48.0, rock_cover=0.0)
        self.mission = create_mission(repo, PLANNER, name="Cluster", source=source).id
        create_sol(repo, PLANNER, self.mission)
        for east_m, north_m in TARGETS:
            target = create_target(repo, PLANNER, self.mission, TargetCreate(east_m=east_m, north_m=north_m))
            asked = ObservationRequestCreate(target_id=target.id, instrument="science_camera", value=10.0)
            create_request(repo, PLANNER, self.mission, asked)
        self.plan = self.ask_plan(1)
        self.here()
        with repo.database.read() as session:
            row = session.get_one(PlanRow, self.plan)
            assert row.crl_sha256 is not None, row.status
        probe = self.ask_run(1, 0.0)
        self.here()
        with repo.database.read() as session:
            lasts_s = session.get_one(RunRow, probe).duration_s or 1.0
        self.pace = max(1.0, lasts_s / RUN_S)

    def ask_plan(self, seed: int) -> str:
        """Ask for a plan that does not depend on the machine; return its id."""
        asked = PlanCreate(iterations=ITERATIONS, time_limit_s=600.0, seed=seed, max_branches=3)
        return generate_plan(self.repo, PLANNER, self.mission, asked).subject_id

    def ask_run(self, seed: int, pace: float | None = None) -> str:
        """Ask for a dry run; return its id."""
        asked = RunCreate(plan_id=self.plan, seed=seed, pace=self.pace if pace is None else pace)
        return dry_run(self.repo, PLANNER, self.mission, asked).subject_id

    def ask_any(self) -> str:
        """Ask for a run or, one time in five, a plan."""
        seed = self.rng.randint(1, SEEDS)
        return self.ask_plan(seed) if self.rng.random() < 0.2 else self.ask_run(seed)

    def here(self) -> None:
        """Do all jobs that wait in this process."""
        there = self.repo.settings.model_copy(update={"executor": ExecutorKind.INLINE})
        Worker(replace(self.repo, settings=there), job_kinds()).run_until_idle()

    def traces(self, runs: list[str]) -> list[tuple[str | None, int]]:
        """Return trace and number of products of runs."""
        with self.repo.database.read() as session:
            rows = [session.get_one(RunRow, run) for run in runs]
            count = select(ProductRow.run_id, func.count()).group_by(ProductRow.run_id)
            products: dict[str, int] = dict(session.execute(count).all())
        return [(row.trace_sha256, products.get(row.id, 0)) for row in rows]

    def crls(self, plans: list[str]) -> list[str]:
        """Return the CRL of plans, without the plan's own id."""
        with self.repo.database.read() as session:
            return [(session.get_one(PlanRow, plan).crl_text or "").replace(plan, "PLAN") for plan in plans]

    def jobs(self) -> dict[str, JobRow]:
        """Return all jobs by their subject."""
        with self.repo.database.read() as session:
            return {row.subject_id: row for row in session.scalars(select(JobRow))}

    def count(self, *states: str) -> int:
        """Return how many jobs are in one of these states."""
        with self.repo.database.read() as session:
            query = select(func.count()).select_from(JobRow).where(JobRow.state.in_(states))
            return int(session.scalar(query) or 0)

    def progress(self) -> dict[tuple[str, int], float]:
        """Return how far each attempt is that runs and has told of progress."""
        with self.repo.database.read() as session:
            query = select(JobRow.id, JobRow.token, JobRow.progress)
            running = session.execute(query.where(JobRow.state == "running", JobRow.progress > BEGUN))
            return {(job, token): progress for job, token, progress in running}

    def goes_on(self, before: Mapping[tuple[str, int], float]) -> bool:
        """Return whether an attempt has made progress since."""
        return any(progress > before.get(attempt, BEGUN) for attempt, progress in self.progress().items())

    def settled(self) -> Counter[str]:
        """Return how often each run and plan got its result, by the history."""
        with self.repo.database.read() as session:
            events = session.execute(
                select(EventRow.subject_id, EventRow.kind, EventRow.after).where(
                    EventRow.kind.in_(("run", "plan")), EventRow.action != "create"
                )
            ).all()
        results = {"run": ("state", "succeeded"), "plan": ("state", "computed")}
        return Counter(
            subject
            for subject, kind, after in events
            if (after or {}).get(results[kind][0]) == results[kind][1]
        )


def until(true: Callable[[], bool], what: str, patience_s: float = PATIENCE_S) -> float:
    """Wait until something holds; return the seconds it took."""
    began = time.monotonic()
    while not true():
        if time.monotonic() - began > patience_s:
            raise SystemExit(f"{what}: not within {patience_s:g} s")
        time.sleep(STUDY_S)
    return time.monotonic() - began


def undisturbed(day: Day) -> list[str]:
    """Have six runs and six plans done on the cluster while nobody is killed; return their ids."""
    seeds = range(1, SEEDS + 1)
    asked = [day.ask_run(seed) for seed in seeds] + [day.ask_plan(seed) for seed in seeds]
    until(lambda: not day.count("queued", "running"), "six runs and six plans on the cluster")
    return asked


def _with_work(day: Day, machines: Machines, names: tuple[str, ...]) -> str | None:
    """Return one of these processes that has work at a random instant from now; None if none has."""
    time.sleep(day.rng.uniform(0.0, 0.5))
    if names == ("worker",):
        busy = set(names) if day.progress() else set()
    else:
        busy = machines.at_work()
        if busy and names == ("scheduler",):
            busy = set(names)
    up = [name for name in names if name in busy and machines.lives(name)]
    return day.rng.choice(up) if up else None


def kills(day: Day, machines: Machines, count: int) -> tuple[Counter[str], list[str]]:
    """Kill so many of each kind while jobs run; return what was met, and the subjects asked for."""
    found: Counter[str] = Counter()
    asked: list[str] = []
    before: dict[tuple[str, int], float] = {}
    for names in KINDS:
        for number in range(count):
            while day.count("queued", "running") < IN_FLIGHT:
                asked.append(day.ask_any())
            until(partial(day.goes_on, before), "a job that goes on")
            began = time.monotonic()
            while (victim := _with_work(day, machines, names)) is None:
                found["instants without work"] += 1
                if not day.count("queued", "running"):
                    asked.append(day.ask_any())
                if time.monotonic() - began > PATIENCE_S:
                    raise SystemExit(f"{names[0]} had no work within {PATIENCE_S:g} s")
            found["jobs running at a kill"] += day.count("running")
            before = day.progress()
            machines.kill(victim)
            found[f"kills of a {names[0].removesuffix('-0')}"] += 1
            if number % 10 == 9:
                print(f"{number + 1} kills of {names[0]}", file=sys.stderr, flush=True)
    found["seconds until all was done"] = round(
        until(lambda: not day.count("queued", "running"), "jobs after the last kill")
    )
    return found, asked


def outage(day: Day, machines: Machines, away_s: float) -> tuple[dict[str, Any], list[str]]:
    """Take the scheduler away while jobs run and are asked for; return how the service fared."""
    asked = [day.ask_any() for _ in range(IN_FLIGHT)]
    until(lambda: day.goes_on({}), "a job that goes on")
    before = machines.starts.copy()
    machines.away.add("scheduler")
    machines.kill("scheduler")
    gone = time.monotonic()
    told_after, words, times, failed = 0.0, "", list[float](), 0
    with httpx.Client(base_url=f"http://127.0.0.1:{machines.server_port}", trust_env=False) as client:
        while time.monotonic() - gone < away_s:
            if len(asked) < 4 * IN_FLIGHT:
                asked.append(day.ask_any())
            began = time.monotonic()
            try:
                answer = client.get("/readyz", timeout=10.0)
                client.get("/api/v1/missions", timeout=10.0).raise_for_status()
                failed += answer.status_code != 200
                if answer.json()["status"] == "degraded":
                    told_after = told_after or began - gone
                    words = answer.json()["checks"].get("workers", "")
            except (httpx.HTTPError, ValueError):
                failed += 1
            times.append(time.monotonic() - began)
            time.sleep(min(1.0, away_s / 20))
        done = sum(row.state == "succeeded" for subject, row in day.jobs().items() if subject in asked)
        machines.away.discard("scheduler")
        caught_up = until(lambda: not day.count("queued", "running"), "jobs after the scheduler came back")
        well = until(lambda: client.get("/readyz").json()["status"] == "ok", "the service to be well again")
    same = ("worker", "server")
    return {
        "away_s": round(away_s),
        "asked": len(asked),
        "done while it was away": done,
        "answers": len(times),
        "failed answers": failed,
        "median and longest answer_s": (round(statistics.median(times), 3), round(max(times), 3)),
        "said after_s": round(told_after, 1),
        "said": words,
        "caught up after_s": round(caught_up, 1),
        "ok again after another_s": round(well, 1),
        "restarts of worker and server": sum(machines.starts[n] - before[n] for n in same),
    }, asked


def judge(day: Day, subjects: list[str]) -> Counter[str]:
    """Return what was lost, doubled or other than here."""
    seeds = range(1, SEEDS + 1)
    runs, plans = [day.ask_run(seed) for seed in seeds], [day.ask_plan(seed) for seed in seeds]
    day.here()
    trace_of, crl_of = (
        dict(zip(seeds, day.traces(runs), strict=True)),
        dict(zip(seeds, day.crls(plans), strict=True)),
    )
    jobs, settled = day.jobs(), day.settled()
    found: Counter[str] = Counter()
    with day.repo.database.read() as session:
        flown = {row.id: row.seed for row in session.scalars(select(RunRow)) if row.id in set(subjects)}
        drawn = {row.id: row.seed for row in session.scalars(select(PlanRow)) if row.id in set(subjects)}
        found["faults of the chain"] = len(verify_chains(session)[1])
    found["runs"], found["plans"] = len(flown), len(drawn)
    found["lost"] = len(set(subjects) - set(flown) - set(drawn))
    for subject in subjects:
        job = jobs[subject]
        found["not succeeded"] += job.state != "succeeded"
        found["not settled once"] += settled[subject] != 1
        found["begun more than once"] += job.token > 1
        found["most begins of a job"] = max(found["most begins of a job"], job.token)
        if job.state != "succeeded":
            print(subject, job.state, job.message)
    for run, got in zip(flown, day.traces(list(flown)), strict=True):
        found["runs other than here"] += got != trace_of[flown[run]]
    for plan, text in zip(drawn, day.crls(list(drawn)), strict=True):
        found["plans other than here"] += text != crl_of[drawn[plan]]
    return found


BAD = (
    "faults of the chain",
    "lost",
    "not succeeded",
    "not settled once",
    "runs other than here",
    "plans other than here",
)


def study(folder: Path, database: str, count: int, away_s: float, seed: int) -> bool:
    """Print what was found; return whether nothing was lost, doubled or different."""
    settings = load_settings(data_dir=folder, database_url=database, job_attempts=ATTEMPTS)
    repo = open_repository(settings)
    migrate(repo.database)
    ensure_profiles(repo)
    day = Day(repo, seed)
    machines = Machines(folder, repo.database.url.render_as_string(hide_password=False))
    try:
        machines.begin()
        subjects = undisturbed(day)
        print(f"equality: {len(subjects)} jobs done on the cluster", file=sys.stderr, flush=True)
        met, asked = kills(day, machines, count)
        subjects += asked
        fared: dict[str, Any] = {}
        if away_s > 0:
            fared, asked = outage(day, machines, away_s)
            subjects += asked
    finally:
        machines.end()
    found = judge(day, subjects)
    logs = "".join((folder / name).read_text(errors="replace") for name in ("worker.log", "server.log"))
    print(f"kills: {dict(met)}")
    print(f"outage: {fared}")
    print(f"judged: {dict(found)}")
    print(f"starts: {dict(machines.starts)}, tracebacks of worker and server: {logs.count(TRACEBACK)}")
    for told in logs.split(TRACEBACK)[1:]:
        print(TRACEBACK + told[:SHOWN])
    repo.database.dispose()
    good = not any(found[word] for word in BAD)
    if fared:
        good &= (
            not fared["failed answers"] and bool(fared["said"]) and not fared["restarts of worker and server"]
        )
    return good


def main() -> None:
    """Print the counts; end with 1 if anything was lost, doubled or different."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=30, help="of each kind of process")
    parser.add_argument("--away-s", type=float, default=300.0, help="of the scheduler; 0 = not")
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**31))
    parser.add_argument("--database", default="", help="a PostgreSQL server; empty = SQLite")
    asked = parser.parse_args()
    began = time.monotonic()
    with (
        tempfile.TemporaryDirectory(prefix="outcrop-cluster-", ignore_cleanup_errors=True) as folder,
        own_database(asked.database) as address,
    ):
        good = study(Path(folder), address, asked.kills, asked.away_s, asked.seed)
    kind = make_url(address).get_backend_name() if address else "sqlite"
    print(f"{kind}, seed {asked.seed}, {time.monotonic() - began:.0f} s, good: {good}")
    raise SystemExit(0 if good else 1)


if __name__ == "__main__":
    main()
