"""Kills of real processes, two servers and three workers, while clients repeat what was not answered.

    .venv/bin/python -m studies.service_kills --kills 300
    .venv/bin/python -m studies.service_kills --kills 300 --database postgresql://postgres@127.0.0.1/postgres

Each kill (SIGKILL) hits one of the five processes, which is started again. Clients send every request with a
key of its own until it is answered, now to the one server, now to the other. In the end each thing that was
asked for has to be there exactly once, each job done exactly once, and no key may have been refused. With
PostgreSQL the study works in a database of its own on that server.
"""

from __future__ import annotations

import argparse
import os
import random
import secrets
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
from sqlalchemy import create_engine, func, make_url, select, text

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

SERVERS, WORKERS, CLIENTS = 2, 3, 3
LEASE_S = 3.0
PATIENCE_S = 120.0
"""A request that is not answered by then stands for a service that did not come back."""


def free_port() -> int:
    """Return a port of this machine that nobody listens on."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


@dataclass
class Service:
    """Five processes on one repository."""

    folder: Path
    address: str
    ports: list[int] = field(default_factory=lambda: [free_port() for _ in range(SERVERS)])
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    def start(self, name: str) -> None:
        kind, _, number = name.partition("-")
        arguments = ["worker"]
        if kind == "server":
            arguments = ["serve", "--no-worker", "--port", str(self.ports[int(number)])]
        environment = {
            **os.environ,
            "OUTCROP_DATA_DIR": str(self.folder),
            "OUTCROP_DATABASE_URL": self.address,
            "OUTCROP_EXECUTOR": "inline",
            "OUTCROP_WORKERS": "1",
            "OUTCROP_WARM_UP": "false",
            "OUTCROP_JOB_LEASE_S": str(LEASE_S),
            "OUTCROP_JOB_ATTEMPTS": "20",
            "OUTCROP_LOG_LEVEL": "error",
        }
        with (self.folder / "processes.log").open("ab") as log:
            self.processes[name] = subprocess.Popen(
                [sys.executable, "-m", "ground.cli", *arguments], env=environment, stdout=log, stderr=log
            )

    def kill(self, name: str) -> None:
        self.processes[name].kill()
        self.processes[name].wait()

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

    def run(self) -> None:
        count = 0
        while not self.ending.is_set():
            count += 1
            name = f"c{self.number}-{count}"
            kind = self.rng.choices(["comment", "target", "job"], [6, 3, 1])[0]
            url = f"/api/v1/missions/{self.mission_id}"
            place = {"east_m": self.rng.uniform(-8, 8), "north_m": self.rng.uniform(-8, 8)}
            asked: tuple[str, dict[str, Any]] = {
                "comment": (f"{url}/comments", {"text": name, **self._subject()}),
                "target": (f"{url}/targets", {"name": name, **place}),
                "job": (f"{url}/path-networks", {}),
            }[kind]
            answer = self._until_answered(*asked, key=f"{name}-{secrets.token_hex(4)}")
            if answer is None:
                return
            self.asked[kind].append(answer["subject_id"] if kind == "job" else name)

    def _subject(self) -> dict[str, str]:
        return {"subject_kind": "mission", "subject_id": self.mission_id}

    def _until_answered(self, url: str, body: dict[str, Any], key: str) -> dict[str, Any] | None:
        until, tries = time.monotonic() + PATIENCE_S, 0
        while time.monotonic() < until:
            tries += 1
            server = f"http://127.0.0.1:{self.rng.choice(self.service.ports)}"
            try:
                answer = httpx.post(server + url, json=body, headers={"Idempotency-Key": key}, timeout=20.0)
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
        targets = list(session.scalars(select(TargetRow.name)))
        networks = list(session.scalars(select(PathNetworkRow.id)))
        jobs = dict(session.execute(select(JobRow.subject_id, JobRow.state)).all())
        settled = select(EventRow.subject_id, func.count()).where(
            EventRow.kind == "path_network", EventRow.action != "create"
        )
        done = dict(session.execute(settled.group_by(EventRow.subject_id)).all())
        found["faults of the chain"] = len(verify_chains(session)[1])
        events, sums = session.execute(select(func.count(), func.max(EventRow.seq))).one()
        found["events"] = events + 0 * (sums or 0)
        wanted_uploads = set(session.scalars(select(UploadRow.sha256)))
    for kind, there in (("comment", comments), ("target", targets), ("job", networks)):
        asked = [name for client in clients for name in client.asked[kind]]
        found[f"{kind}s"] = len(asked)
        found["lost"] += len(set(asked) - set(there))
        found["twice"] += _twice(there) + len(set(there) - set(asked))
    found["jobs not done"] = sum(state != "succeeded" for state in jobs.values())
    found["jobs done twice"] = sum(count > 1 for count in done.values())
    found["records without file"] = len(check_files(repo).without_file) + len(
        [sha for sha in wanted_uploads if not repo.files.is_sound(sha)]
    )
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
    "faults of the chain",
    "records without file",
)


def study(folder: Path, address: str, kills: int, seed: int) -> Counter[str]:
    """Return the counts of one run of the service under so many kills."""
    repo = open_repository(load_settings(data_dir=folder, database_url=address, job_lease_s=LEASE_S))
    migrate(repo.database)
    ensure_profiles(repo)
    planner = Actor("Planner", Role.PLANNER)
    source = GeneratedTerrain(seed=1, size_m=48.0, rock_cover=0.0)
    mission = create_mission(repo, planner, name="Kills", source=source)
    create_sol(repo, planner, mission.id)
    service, rng = Service(folder, address), random.Random(seed)
    names = [f"server-{n}" for n in range(SERVERS)] + [f"worker-{n}" for n in range(WORKERS)]
    for name in names:
        service.start(name)
    clients = [Client(number, service, mission.id, seed) for number in range(CLIENTS)]
    found: Counter[str] = Counter()
    try:
        for client in clients:
            client.start()
        for _ in range(kills):
            before, wanted = _answered(clients), rng.randint(1, 12)
            until = time.monotonic() + PATIENCE_S
            while _answered(clients) < before + wanted and time.monotonic() < until:
                time.sleep(0.02)
            time.sleep(rng.uniform(0.0, 0.1))
            name = rng.choice(names)
            service.kill(name)
            found[f"kills of a {name.partition('-')[0]}"] += 1
            service.start(name)
        for client in clients:
            client.ending.set()
        for client in clients:
            client.join(PATIENCE_S + 30.0)
        until = time.monotonic() + PATIENCE_S
        while _open_jobs(repo) and time.monotonic() < until:
            time.sleep(0.3)
    finally:
        service.stop()
    found += judge(repo, clients)
    repo.database.dispose()
    return found


def _answered(clients: list[Client]) -> int:
    return sum(client.found["answered"] for client in clients)


def _open_jobs(repo: Repository) -> int:
    with repo.database.read() as session:
        query = select(func.count()).select_from(JobRow).where(JobRow.state.in_(["queued", "running"]))
        return int(session.scalar(query) or 0)


def own_database(address: str) -> tuple[str, str]:
    """Return the addresses of a new database on a PostgreSQL server, and of the server."""
    settings = load_settings(database_url=address)
    server = make_url(settings.database_address)
    name = f"outcrop_study_{secrets.token_hex(4)}"
    _run(server, f'CREATE DATABASE "{name}"')
    return server.set(database=name).render_as_string(hide_password=False), name


def _run(server: Any, statement: str) -> None:
    engine = create_engine(server, isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(text(statement))
    engine.dispose()


def main() -> None:
    """Print the counts; end with 1 if anything was lost, done twice or refused."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=300)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**31))
    parser.add_argument("--database", default="", help="a PostgreSQL server; empty = SQLite")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="outcrop-kills-") as folder:
        address, name = own_database(asked.database) if asked.database else ("", "")
        try:
            found = study(Path(folder), address, asked.kills, asked.seed)
        finally:
            if name:
                server = make_url(load_settings(database_url=asked.database).database_address)
                _run(server, f'DROP DATABASE "{name}" WITH (FORCE)')
    print(f"{'postgresql' if name else 'sqlite'}, seed {asked.seed}: {dict(found)}")
    raise SystemExit(1 if any(found[word] for word in BAD) else 0)


if __name__ == "__main__":
    main()
