"""Kills of real processes, two servers and three workers, while clients repeat what was not answered.

    .venv/bin/python -m studies.service_kills --kills 300
    .venv/bin/python -m studies.service_kills --kills 300 --database postgresql://postgres@127.0.0.1/postgres

Each kill (SIGKILL) hits one process, which is started again: an HTTP server, a worker, `outcrop execute`, or
a client of the database (`outcrop ingest`); on PostgreSQL also the database's process behind one connection.
Clients send every request with a key of its own until it is answered, now to the one server, now to the
other. In the end each thing that was asked for has to be there exactly once, each job done and each package
executed and taken in exactly once, each run as if nothing had died, and no key may have been refused. With
PostgreSQL the study works in a database of its own on that server.
"""

from __future__ import annotations

import argparse
import random
import secrets
import sys
import tempfile
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import httpx
from sqlalchemy import Engine, create_engine, func, make_url, select, text

from ground.gdr.history import EventRow, verify_chains
from ground.gdr.migrate import migrate
from ground.gdr.repository import Repository, open_repository
from ground.jobs.row import JobRow
from ground.records.actor import Actor, Role
from ground.resources.backups.check_files import check_files
from ground.resources.comments.row import CommentRow
from ground.resources.mission_setup.create_mission import GeneratedTerrain, create_mission
from ground.resources.path_networks.row import PathNetworkRow
from ground.resources.people.accounts import ensure_profiles
from ground.resources.sols.create_sol import create_sol
from ground.resources.targets.row import TargetRow
from ground.resources.uploads.row import UploadRow
from ground.settings import load_settings
from studies.common.databases import own_database
from studies.common.processes import free_port
from studies.killed_uplink import EXECUTE, INGEST, Uplink
from studies.nursery import start

SERVERS, WORKERS, CLIENTS = 2, 3, 3
LEASE_S = 3.0
PATIENCE_S = 120.0
"""A request that is not answered by then stands for a service that did not come back."""
THINKING_S = 0.2
"""Between an answer and the next request, so that the machine's time goes to deaths and starts."""
STUDY = "study"
"""Name of the study's own connections, which are not killed."""
KINDS = ("server", "worker", EXECUTE, INGEST)
CONNECTION = "connection"


@dataclass
class Service:
    """Five processes on one repository."""

    folder: Path
    address: str
    ports: list[int] = field(default_factory=lambda: [free_port() for _ in range(SERVERS)])
    processes: dict[str, BaseProcess] = field(default_factory=dict)

    @property
    def environment(self) -> dict[str, str]:
        return {
            "OUTCROP_DATA_DIR": str(self.folder),
            "OUTCROP_DATABASE_URL": self.address,
            "OUTCROP_EXECUTOR": "inline",
            "OUTCROP_WORKERS": "1",
            "OUTCROP_WARM_UP": "false",
            "OUTCROP_JOB_LEASE_S": str(LEASE_S),
            "OUTCROP_JOB_ATTEMPTS": "20",
            "OUTCROP_LOG_LEVEL": "error",
        }

    def names(self, kind: str) -> list[str]:
        return [f"{kind}-{n}" for n in range(SERVERS if kind == "server" else WORKERS)]

    def start(self, name: str) -> None:
        kind, _, number = name.partition("-")
        arguments = ["worker"]
        if kind == "server":
            arguments = ["serve", "--no-worker", "--port", str(self.ports[int(number)])]
        self.processes[name] = start(arguments, self.folder / "processes.log", self.environment)

    def kill(self, name: str) -> bool:
        """Kill a process; return whether it was alive."""
        process = self.processes[name]
        alive = process.is_alive()
        process.kill()
        process.join()
        return alive

    def stop(self) -> None:
        for name in self.processes:
            self.kill(name)


class Client(threading.Thread):
    """Asks for one thing after another, each until it is answered."""

    def __init__(self, number: int, service: Service, mission_id: str, seed: int) -> None:
        super().__init__(daemon=True)
        self.number, self.service, self.mission_id = number, service, mission_id
        self.rng = random.Random(seed * 100 + number)
        self.asked: dict[str, list[str]] = {"comment": [], "target": [], "job": [], "upload": []}
        self.found: Counter[str] = Counter()
        self.ending = threading.Event()
        self.broken = ""
        self._http = httpx.Client(timeout=20.0, trust_env=False)

    def run(self) -> None:
        count = 0
        while not self.ending.is_set():
            count += 1
            name = f"c{self.number}-{count}"
            kind = self.rng.choices(["comment", "target", "upload", "job"], [12, 6, 3, 1])[0]
            url = f"/api/v1/missions/{self.mission_id}"
            place = {"east_m": self.rng.uniform(-8, 8), "north_m": self.rng.uniform(-8, 8)}
            orders: dict[str, tuple[str, dict[str, Any]]] = {
                "comment": (f"{url}/comments", {"json": {"text": name, **self._subject()}}),
                "target": (f"{url}/targets", {"json": {"name": name, **place}}),
                "upload": (f"/api/v1/uploads?file_name={name}", {"content": name.encode() * 5000}),
                "job": (f"{url}/path-networks", {"json": {}}),
            }
            answer = self._until_answered(*orders[kind], key=f"{name}-{secrets.token_hex(4)}")
            if answer is None:
                return
            self.asked[kind].append(answer["subject_id"] if kind == "job" else name)
            time.sleep(THINKING_S)

    def _subject(self) -> dict[str, str]:
        return {"subject_kind": "mission", "subject_id": self.mission_id}

    def _until_answered(self, url: str, body: dict[str, Any], key: str) -> dict[str, Any] | None:
        until, tries = time.monotonic() + PATIENCE_S, 0
        while time.monotonic() < until:
            tries += 1
            server = f"http://127.0.0.1:{self.rng.choice(self.service.ports)}"
            try:
                answer = self._http.post(server + url, headers={"Idempotency-Key": key}, **body)
            except httpx.HTTPError:
                time.sleep(0.1)
                continue
            if answer.status_code in {201, 202}:
                self.found["answered"] += 1
                self.found["answered after a repeat"] += tries > 1
                self.found["answered from the store"] += "idempotent-replay" in answer.headers
                found: dict[str, Any] = answer.json()
                return found
            if answer.status_code < 500:
                self.found["refused"] += 1
                self.broken = answer.text
                return None
            self.found["errors of a server"] += 1
            time.sleep(0.1)
        self.broken = f"{url} was not answered in {PATIENCE_S:g} s"
        return None


def _twice(names: list[str]) -> int:
    return sum(count - 1 for count in Counter(names).values())


def judge(repo: Repository, clients: list[Client]) -> Counter[str]:
    """Return what was lost or done twice."""
    found: Counter[str] = Counter()
    with repo.database.read() as session:
        comments = list(session.scalars(select(CommentRow.text)))
        targets = list(session.scalars(select(TargetRow.name).where(TargetRow.name.like("c%-%"))))
        networks = list(session.scalars(select(PathNetworkRow.id)))
        jobs = dict(session.execute(select(JobRow.subject_id, JobRow.state)).all())
        settled = select(EventRow.subject_id, func.count()).where(
            EventRow.kind == "path_network", EventRow.action != "create"
        )
        done = dict(session.execute(settled.group_by(EventRow.subject_id)).all())
        found["faults of the chain"] = len(verify_chains(session)[1])
        uploads = dict(session.execute(select(UploadRow.file_name, UploadRow.sha256)).all())
    for kind, there in (("comment", comments), ("target", targets), ("job", networks)):
        asked = [name for client in clients for name in client.asked[kind]]
        found[f"{kind}s"] = len(asked)
        found["lost"] += len(set(asked) - set(there))
        found["twice"] += _twice(there) + len(set(there) - set(asked))
    acknowledged = {name for client in clients for name in client.asked["upload"]}
    found["uploads"] = len(acknowledged)
    found["lost"] += len(acknowledged - set(uploads))
    found["jobs not done"] = sum(state != "succeeded" for state in jobs.values())
    found["jobs done twice"] = sum(count > 1 for count in done.values())
    found["records without file"] = len(check_files(repo).without_file)
    found["records without file"] += sum(not repo.files.is_sound(sha256) for sha256 in uploads.values())
    for client in clients:
        found += client.found
        if client.broken:
            found["gave up"] += 1
            print(client.broken)
    return found


BAD = (
    "lost",
    "twice",
    "refused",
    "gave up",
    "jobs not done",
    "jobs done twice",
    "executions lost",
    "executions twice",
    "executions changed by a death",
    "faults of the chain",
    "records without file",
)


class Killer:
    """Kills one process after another, each when some more requests have been answered."""

    def __init__(self, service: Service, clients: list[Client], uplink: Uplink, seed: int) -> None:
        self.service, self.clients, self.uplink = service, clients, uplink
        self.rng, self.found = random.Random(seed), Counter[str]()
        self._server: Engine | None = None
        if make_url(service.address).get_backend_name() == "postgresql":
            self._server = create_engine(_as_study(service.address), isolation_level="AUTOCOMMIT")

    def kill(self) -> None:
        """Kill one process, and start it again unless its owner does."""
        kind = self.rng.choice([*KINDS, CONNECTION] if self._server is not None else KINDS)
        self._wait(self._answered, self._answered() + self.rng.randint(1, 4))
        time.sleep(self.rng.uniform(0.0, 0.1))
        if kind in {EXECUTE, INGEST}:
            self.uplink.wanted.add(kind)
            self._wait(lambda: kind not in self.uplink.wanted or bool(self.uplink.broken), True)
        elif kind == CONNECTION:
            self._wait(self._cut_off, True)
        else:
            name = self.rng.choice(self.service.names(kind))
            self.found[f"kills of a {kind}"] += self.service.kill(name)
            self.service.start(name)

    def _answered(self) -> int:
        return sum(client.found["answered"] for client in self.clients)

    def _wait(self, reached: Any, wanted: int) -> None:
        until = time.monotonic() + PATIENCE_S
        while reached() < wanted and time.monotonic() < until:
            time.sleep(0.02)

    def _cut_off(self) -> bool:
        """End the process of PostgreSQL behind one connection, drawn at random."""
        assert self._server is not None
        query = (
            "SELECT pid FROM pg_stat_activity WHERE datname = current_database() AND application_name <> :own"
        )
        with self._server.connect() as connection:
            found = list(connection.scalars(text(query), {"own": STUDY}))
            if not found:
                return False
            connection.execute(text("SELECT pg_terminate_backend(:pid)"), {"pid": self.rng.choice(found)})
        self.found["kills of a connection"] += 1
        return True

    def close(self) -> None:
        if self._server is not None:
            self._server.dispose()


def study(folder: Path, address: str, kills: int, seed: int) -> Counter[str]:
    """Return the counts of one run of the service under so many kills."""
    own = load_settings(data_dir=folder, database_url=_as_study(address), job_lease_s=LEASE_S)
    repo = open_repository(own)
    migrate(repo.database)
    ensure_profiles(repo)
    planner = Actor("Planner", Role.PLANNER)
    source = GeneratedTerrain(seed=1, size_m=48.0, rock_cover=0.0)
    mission = create_mission(repo, planner, name="Kills", source=source)
    create_sol(repo, planner, mission.id)
    service = Service(folder, address)
    uplink = Uplink(repo, mission, service.environment, seed)
    clients = [Client(number, service, mission.id, seed) for number in range(CLIENTS)]
    killer = Killer(service, clients, uplink, seed)
    try:
        for name in service.names("server") + service.names("worker"):
            service.start(name)
        for thread in (*clients, uplink):
            thread.start()
        for number in range(kills):
            if any(actor.broken for actor in (*clients, uplink)):
                break
            killer.kill()
            if number % 20 == 0:
                print(f"{number + 1} kills", file=sys.stderr, flush=True)
        for ending in (*(client.ending for client in clients), uplink.ending):
            ending.set()
        for thread in (*clients, uplink):
            thread.join(PATIENCE_S + 30.0)
        until = time.monotonic() + PATIENCE_S
        while _open_jobs(repo) and time.monotonic() < until:
            time.sleep(0.3)
    finally:
        service.stop()
        killer.close()
    found = killer.found + judge(repo, clients) + uplink.judge()
    found["tracebacks in the logs"] = (
        (folder / "processes.log").read_text(errors="replace").count("Traceback")
    )
    repo.database.dispose()
    return found


def _open_jobs(repo: Repository) -> int:
    with repo.database.read() as session:
        query = select(func.count()).select_from(JobRow).where(JobRow.state.in_(["queued", "running"]))
        return int(session.scalar(query) or 0)


def _as_study(address: str) -> str:
    """Return an address whose connections carry the name of the study, where connections have names."""
    if not address or make_url(address).get_backend_name() != "postgresql":
        return address
    named = make_url(address).update_query_dict({"application_name": STUDY})
    return named.render_as_string(hide_password=False)


def main() -> None:
    """Print the counts; end with 1 if anything was lost, done twice or refused."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=300)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**31))
    parser.add_argument("--database", default="", help="a PostgreSQL server; empty = SQLite")
    asked = parser.parse_args()
    begun = time.monotonic()
    with (
        tempfile.TemporaryDirectory(prefix="outcrop-kills-") as folder,
        own_database(asked.database) as own,
    ):
        address = own or f"sqlite:///{Path(folder) / 'outcrop.db'}"
        found = study(Path(folder), address, asked.kills, asked.seed)
    wall_s = time.monotonic() - begun
    print(f"{'postgresql' if own else 'sqlite'}, seed {asked.seed}, {wall_s:.0f} s: {dict(found)}")
    print({word: found[word] for word in BAD})
    raise SystemExit(1 if any(found[word] for word in BAD) else 0)


if __name__ == "__main__":
    main()
