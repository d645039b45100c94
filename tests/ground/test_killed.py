"""SIGKILL at random during writes, uploads, jobs and the downlink.

Nothing acknowledged is lost, nothing done twice, no product without record and no record without file.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import multiprocessing
import os
import random
import signal
import threading
import time
from collections import Counter

import pytest
from sqlalchemy import select

from executive.crl import digest, parse
from ground.errors import AlreadyExecutedError
from ground.gdr.history import verify_chains
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.jobs.worker import Worker
from ground.resources.backups.check_files import check_files
from ground.resources.comments.row import CommentRow
from ground.resources.downlinks.ingest_run import ingest_run
from ground.resources.missions.value import Mission
from ground.resources.observation_requests.bodies import ObservationRequestCreate
from ground.resources.observation_requests.create_request import create_request
from ground.resources.packages.row import PackageRow
from ground.resources.plans.row import PlanRow
from ground.resources.products.row import ProductRow
from ground.resources.runs.row import RunRow
from ground.resources.sols.row import SolRow
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.create_target import create_target
from ground.resources.uploads.row import UploadRow
from tests.ground.conftest import PLANNER
from tests.ground.killed import KINDS, OPERATOR, PRODUCTS, TASK, main

KILLS = int(os.environ.get("OUTCROP_KILLS", "10"))
"""How often the slow test kills; a hundred take two to five minutes on either database."""


def uplinked_plan(repo: Repository, mission: Mission) -> str:
    """File a plan with one task for one request, as it stands after its uplink; return its id."""
    target = create_target(repo, PLANNER, mission.id, TargetCreate(east_m=4.0, north_m=1.0))
    request = create_request(
        repo,
        PLANNER,
        mission.id,
        ObservationRequestCreate(target_id=target.id, instrument="science_camera", value=1.0),
    )
    text = f'(plan :id p :node (task :id {TASK} :action image :metadata (request = "{request.id}")))'
    with repo.database.write() as session:
        plan = PlanRow(
            id=new_id("pln"),
            author="Planner",
            mission_id=mission.id,
            sol_id=session.scalars(select(SolRow.id)).one(),
            number=1,
            name="P",
            state="uplinked",
            strategy="optimal",
            max_branches=0,
            time_limit_s=1.0,
            seed=1,
            job_id="",
            crl_text=text,
            crl_sha256=digest(parse(text)),
            inputs_sha256="",
            terrain_sha256="",
            dictionary="",
            rover_profile="k9",
            findings=[],
            request_ids=[request.id],
            planned_request_ids=[request.id],
            left_out={},
        )
        session.add(plan)
        return plan.id


def kill_often(repo: Repository, mission: Mission, times: int) -> Counter[str]:
    """Kill a process at work so many times, then hold the repository to what was acknowledged.

    Returns how many acts of each kind were acknowledged.
    """
    rng = random.Random(7)
    plan = uplinked_plan(repo, mission)
    (repo.data_dir / "downlink").mkdir()
    acknowledged: dict[str, set[str]] = {"comment": set(), "job": set(), "upload": set(), "run": set()}
    address = repo.database.url.render_as_string(hide_password=False)
    nursery = multiprocessing.get_context("forkserver")  # loads our modules once for all that are to die
    nursery.set_forkserver_preload(["tests.ground.killed"])
    for _ in range(times):
        ear, mouth = nursery.Pipe(duplex=False)
        process = nursery.Process(target=main, args=(str(repo.data_dir), address, mission.id, plan, mouth))
        process.start()
        mouth.close()
        told = [ear.recv() for _ in range(rng.randint(1, 8))]  # after some acts, in the middle of the next
        timer = threading.Timer(rng.uniform(0.0, 0.05), process.kill)
        timer.start()
        with contextlib.suppress(EOFError, OSError):  # a word cut off by death was not acknowledged
            while True:
                told.append(ear.recv())
        process.join()
        timer.join()
        assert process.exitcode == -signal.SIGKILL
        ear.close()
        process.close()
        for kind, identifier in told:
            acknowledged[kind].add(identifier)
    assert all(acknowledged.values())
    finish_jobs(repo)
    hold_writes(repo, acknowledged)
    hold_runs(repo, acknowledged["run"], take_in_again(repo))
    with repo.database.read() as session:
        assert verify_chains(session)[1] == []
    return Counter({kind: len(found) for kind, found in acknowledged.items()})


def finish_jobs(repo: Repository) -> None:
    """Let a survivor take up the jobs of the dead when their leases have run out."""
    patient = dataclasses.replace(repo, settings=repo.settings.model_copy(update={"job_attempts": 50}))
    until = time.monotonic() + 60.0
    while True:
        Worker(patient, KINDS, slots=1).run_until_idle()
        with repo.database.read() as session:
            states = Counter(session.scalars(select(JobRow.state)))
        if set(states) <= {"succeeded"}:
            return
        assert time.monotonic() < until, states
        threading.Event().wait(0.1)


def hold_writes(repo: Repository, acknowledged: dict[str, set[str]]) -> None:
    with repo.database.read() as session:
        comments = list(
            session.execute(select(CommentRow.id, CommentRow.subject_kind, CommentRow.subject_id))
        )
        uploads = dict(session.execute(select(UploadRow.id, UploadRow.sha256)).all())
        jobs = set(session.scalars(select(JobRow.id)))
    assert acknowledged["comment"] <= {c.id for c in comments}
    assert acknowledged["job"] <= jobs
    assert acknowledged["upload"] <= set(uploads)
    settled = Counter(c.subject_id for c in comments if c.subject_kind == "job")
    assert settled == dict.fromkeys(jobs, 1)
    for sha256 in uploads.values():
        assert repo.files.path(sha256).is_file()


def take_in_again(repo: Repository) -> int:
    """Take in every folder once more, as an operator would after a crash; return how many there are."""
    folders = [f for f in (repo.data_dir / "downlink").iterdir() if not f.name.startswith(".")]
    for folder in folders:
        with contextlib.suppress(AlreadyExecutedError):
            ingest_run(repo, OPERATOR, folder)
    return len(folders)


def hold_runs(repo: Repository, acknowledged: set[str], folders: int) -> None:
    with repo.database.read() as session:
        runs = dict(session.execute(select(RunRow.id, RunRow.package_sha256)).all())
        packages = set(session.scalars(select(PackageRow.sha256)))
        products = list(session.execute(select(ProductRow.run_id, ProductRow.sha256, ProductRow.request_id)))
    assert acknowledged <= set(runs)
    assert len(runs) == len(set(runs.values())) == folders
    assert set(runs.values()) <= packages
    assert Counter(p.run_id for p in products) == dict.fromkeys(runs, PRODUCTS)
    assert sum(p.request_id is None for p in products) == len(runs)
    for product in products:
        assert hashlib.sha256(repo.files.read(product.sha256)).hexdigest() == product.sha256
    for run in runs:
        assert (repo.run_dir(run) / "journal.jsonl").is_file()
    assert check_files(repo).without_file == []


def test_nothing_acknowledged_is_lost_when_the_process_is_killed(repo: Repository, mission: Mission) -> None:
    kill_often(repo, mission, 3)


@pytest.mark.slow
def test_nothing_acknowledged_is_lost_in_many_kills(repo: Repository, mission: Mission) -> None:
    done = kill_often(repo, mission, KILLS)
    print(f"{repo.database.url.get_backend_name()}: {KILLS} kills, acknowledged {dict(done)}")
