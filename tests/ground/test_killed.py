"""SIGKILL at random during writes, uploads and jobs: nothing acknowledged is lost, nothing is done twice."""

from __future__ import annotations

import contextlib
import dataclasses
import multiprocessing
import random
import signal
import threading
import time
from collections import Counter

import pytest
from sqlalchemy import select

from ground.gdr.history import verify_chains
from ground.gdr.models import CommentRow, JobRow, UploadRow
from ground.gdr.repository import Repository
from ground.gdr.values import Mission
from ground.jobs import Worker
from tests.ground.killed import KINDS, main


def kill_often(repo: Repository, mission: Mission, times: int) -> None:
    rng = random.Random(7)
    acknowledged: dict[str, set[str]] = {"comment": set(), "job": set(), "upload": set()}
    address = repo.database.url.render_as_string(hide_password=False)
    nursery = multiprocessing.get_context("forkserver")  # loads our modules once for all that are to die
    nursery.set_forkserver_preload(["tests.ground.killed"])
    for _ in range(times):
        ear, mouth = nursery.Pipe(duplex=False)
        process = nursery.Process(target=main, args=(str(repo.data_dir), address, mission.id, mouth))
        process.start()
        mouth.close()
        told = [ear.recv()]  # it works: from now on it may die at any moment
        timer = threading.Timer(rng.uniform(0.0, 0.2), process.kill)
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
    patient = dataclasses.replace(repo, settings=repo.settings.model_copy(update={"job_attempts": 50}))
    until = time.monotonic() + 60.0
    while True:  # leases of the dead run out, then the survivor takes their jobs up
        Worker(patient, KINDS, slots=1).run_until_idle()
        with repo.database.read() as session:
            states = Counter(session.scalars(select(JobRow.state)))
        if set(states) <= {"succeeded"}:
            break
        assert time.monotonic() < until, states
        threading.Event().wait(0.1)
    with repo.database.read() as session:
        comments = list(
            session.execute(select(CommentRow.id, CommentRow.subject_kind, CommentRow.subject_id))
        )
        uploads = dict(session.execute(select(UploadRow.id, UploadRow.sha256)).all())  # type: ignore[arg-type]
        jobs = set(session.scalars(select(JobRow.id)))
        assert verify_chains(session)[1] == []
    assert acknowledged["comment"] <= {c.id for c in comments}
    assert acknowledged["job"] <= jobs
    assert acknowledged["upload"] <= set(uploads)
    settled = Counter(c.subject_id for c in comments if c.subject_kind == "job")
    assert settled == dict.fromkeys(jobs, 1)
    for sha256 in uploads.values():
        assert repo.files.path(sha256).is_file()


def test_nothing_acknowledged_is_lost_when_the_process_is_killed(repo: Repository, mission: Mission) -> None:
    kill_often(repo, mission, 2)


@pytest.mark.slow
def test_nothing_acknowledged_is_lost_in_a_hundred_kills(repo: Repository, mission: Mission) -> None:
    kill_often(repo, mission, 100)
