"""A process to be killed: writes, uploads, does jobs and takes runs in as fast as it can, and says what was
acknowledged."""

from __future__ import annotations

import hashlib
import json
import os
import random
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session, configure_mappers

from ground.gdr.ids import new_id
from ground.gdr.repository import Repository, open_repository
from ground.jobs.queue import JobKind, enqueue
from ground.jobs.row import JobRow
from ground.jobs.worker import Worker
from ground.records.actor import Actor, Role
from ground.resources.comments.bodies import CommentCreate
from ground.resources.comments.create_comment import create_comment
from ground.resources.comments.row import CommentRow
from ground.resources.downlinks.ingest_run import ingest_run
from ground.resources.missions.kind import MISSION
from ground.resources.packages.row import PackageRow
from ground.resources.plans.row import PlanRow
from ground.resources.uploads.store_upload import UploadDraft
from ground.settings import load_settings
from tests.ground import work_for_tests
from tests.ground.conftest import PLANNER

configure_mappers()  # once, before the many that are to die are forked

OPERATOR = Actor("Operator", Role.OPERATOR)
TASK = "look"
PRODUCTS = 3
"""Data products of each run; the last one matches no request."""


def _settle(_repo: Repository, session: Session, job: JobRow, _result: dict[str, Any]) -> None:
    """Leave one row for each settlement: two of one job would show."""
    done = CommentRow(
        id=f"done-{job.id}-{job.token}",
        author="",
        mission_id=job.mission_id,
        subject_kind="job",
        subject_id=job.id,
        text="done",
    )
    session.add(done)


KINDS = {
    "count": JobKind(
        "count", work_for_tests.ORDERS, work_for_tests.count, _settle, lambda _session, _job: None
    )
}


def queue_job(repo: Repository, mission_id: str) -> str:
    with repo.database.write() as session:
        return enqueue(
            session,
            repo.settings,
            kind="count",
            mission_id=mission_id,
            subject_kind="none",
            subject_id="none",
            payload={"format": "count/1", "what": "succeed", "log": str(repo.data_dir / "starts.log")},
            author="Planner",
        ).id


def write_run(repo: Repository, plan: PlanRow, number: int) -> Path:
    """Leave the folder `run/1` of an execution as it came down, with contents of its own; return it."""
    name = f"{os.getpid()}-{number}"
    package = repo.files.put_bytes(name.encode()).sha256
    with repo.database.write() as session:
        session.add(
            PackageRow(
                id=new_id("pkg"),
                author="Operator",
                mission_id=plan.mission_id,
                plan_id=plan.id,
                sequence=int(package[:7], 16),
                sha256=package,
                key_id="none",
            )
        )
    folder = repo.data_dir / "downlink" / f".{name}"
    (folder / "products").mkdir(parents=True)
    lines = []
    for index in range(PRODUCTS):
        content = f"{name} {index} ".encode() * 4000
        (folder / "products" / f"{index}.bin").write_bytes(content)
        request = plan.request_ids[0] if index < PRODUCTS - 1 else "unknown"
        lines.append(
            {
                "path": f"products/{index}.bin",
                "sha256": hashlib.sha256(content).hexdigest(),
                "kind": "image",
                "task": TASK,
                "t_s": float(index),
                "label": {"request": request},
            }
        )
    sample = {"t_s": 0.0, "east_m": 0.0, "north_m": 0.0, "heading_rad": 0.0, "task": "", "trackers": {}}
    document = {
        "format": "run/1",
        "package_sha256": package,
        "plan": plan.id,
        "mission": plan.mission_id,
        "plan_digest": plan.crl_sha256,
        "outcome": "SUCCEEDED",
        "outcomes": {TASK: "SUCCEEDED"},
        "utility": 1.0,
        "end_s": 9.0,
    }
    (folder / "products.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    (folder / "trace.jsonl").write_text(f'[{number}.0, "start", "{TASK}"]\n')
    (folder / "telemetry.jsonl").write_text(
        json.dumps({**sample, "battery_j": number, "energy_used_j": 1.0}) + "\n"
    )
    (folder / "journal.jsonl").write_text("{}\n")
    (folder / "run.json").write_text(json.dumps(document))
    return folder.rename(folder.with_name(name))


def main(folder: str, address: str, mission_id: str, plan_id: str, tell: Connection) -> None:
    """Work until killed; each acknowledged id goes down `tell` before the next step."""
    settings = load_settings(
        data_dir=Path(folder), database_url=address, executor="inline", job_lease_s=0.5, job_attempts=20
    )
    repo = open_repository(settings)
    with repo.database.read() as session:
        plan = session.get_one(PlanRow, plan_id)
    worker = Worker(repo, KINDS, slots=1)
    worker.folder.mkdir(parents=True, exist_ok=True)
    rng = random.Random(os.getpid())
    number = 0

    def comment() -> None:
        remark = CommentCreate(subject_kind="mission", subject_id=mission_id, text=f"{number}")
        made = create_comment(repo, PLANNER, mission_id, MISSION, remark)
        tell.send(("comment", made.id))

    def job() -> None:
        tell.send(("job", queue_job(repo, mission_id)))
        worker.step()

    def upload() -> None:
        draft = UploadDraft(repo, PLANNER, "x.bin")
        draft.write(f"{os.getpid()} {number}".encode() * 1000)
        tell.send(("upload", draft.finish().id))
        draft.close()

    def ingest() -> None:
        tell.send(("run", ingest_run(repo, OPERATOR, write_run(repo, plan, number)).id))

    acts: list[Callable[[], None]] = [comment, job, upload, ingest]
    while True:
        for act in rng.sample(acts, len(acts)):  # death finds it now in this, now in that
            number += 1
            act()
