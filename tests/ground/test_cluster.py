"""A cluster that is away, slow or killed: what the worker says, to whom, and that nothing is doubled."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ground.gdr.repository import Repository
from ground.jobs.executors import ClusterExecutor
from ground.jobs.presence import FORGOTTEN_S, GONE_S, Beat, Presence, present
from ground.jobs.worker import Worker
from ground.settings import ExecutorKind
from studies.service_kills import free_port
from tests.ground.conftest import Api
from tests.ground.test_jobs import (
    KINDS,
    SETTLED,
    claim_job,
    let_lease_run_out,
    queue,
    row_of,
    with_settings,
)

ROOT = Path(__file__).resolve().parents[2]
AWAY = Presence(
    "far:7", "distributed", 0, "OSError: the Dask scheduler does not answer", "2026-11-23T09:00:00Z"
)


def until(true: Callable[[], bool], patience_s: float = 240.0) -> None:
    end = time.monotonic() + patience_s
    while not true():
        assert time.monotonic() < end
        threading.Event().wait(0.05)


def open_files() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


def test_a_scheduler_that_is_away_is_told_within_seconds_and_leaves_nothing_open() -> None:
    """Dask itself tries for 30 s and leaves a thread and three files open each time."""
    port, threads = free_port(), threading.active_count()
    files = open_files()
    began = time.monotonic()
    with pytest.raises(
        OSError, match=rf"the Dask scheduler tcp://127.0.0.1:{port} does not answer \(Connection"
    ):
        ClusterExecutor(f"tcp://127.0.0.1:{port}")
    assert time.monotonic() - began < 5.0
    assert (threading.active_count(), open_files()) == (threads, files)


def test_a_server_without_a_worker_says_how_the_engine_of_another_process_fares(api: Api) -> None:
    beat = Beat(api.repo.job_dir())
    beat.say(AWAY)
    told = api.get("/readyz")
    assert told["status"] == "degraded"
    assert told["checks"]["workers"] == (
        "degraded: far:7: OSError: the Dask scheduler does not answer since 2026-11-23T09:00:00Z, tried again"
    )
    metrics = api("GET", "/metrics").text
    assert 'outcrop_workers{engine="down"} 1.0' in metrics
    beat.say(Presence("far:7", "distributed", 2))
    told = api.get("/readyz")
    assert (told["status"], told["checks"]["workers"]) == ("ok", "ok")
    beat.leave()
    assert "workers" not in api.get("/readyz")["checks"]


def test_a_worker_that_is_not_heard_of_is_gone_and_forgotten_in_the_end(sqlite_repo: Repository) -> None:
    folder = sqlite_repo.job_dir()
    Beat(folder).say(AWAY)
    (path,) = folder.glob("*.worker")
    assert present(folder) == [AWAY]
    os.utime(path, (0, time.time() - GONE_S - 1.0))
    assert present(folder) == []
    os.utime(path, (0, time.time() - FORGOTTEN_S - 1.0))
    Beat(folder).say(Presence("near:1", "process", 0))
    assert [p.name for p in present(folder)] == ["near:1"]
    assert not path.exists()


def test_work_of_an_attempt_before_is_asked_to_stop_by_whoever_takes_the_job_over(
    sqlite_repo: Repository,
) -> None:
    job = queue(sqlite_repo, "succeed")
    assert claim_job(sqlite_repo, KINDS, "killed") is not None
    let_lease_run_out(sqlite_repo, job)
    assert Worker(sqlite_repo, KINDS, slots=1).run_until_idle() == 1
    assert row_of(sqlite_repo, job).token == 2
    assert (sqlite_repo.job_dir() / f"{job}-1.stop").exists()
    assert not (sqlite_repo.job_dir() / f"{job}-2.stop").exists()


class Dask:
    """A scheduler and a worker of Dask on loopback."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, free_port()
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.processes: list[subprocess.Popen[bytes]] = []

    def start(self) -> None:
        """Start a scheduler and a worker."""
        where = ["scheduler", "--host", "127.0.0.1", "--port", str(self.port)]
        hand = [
            "worker",
            self.address,
            "--nthreads",
            "2",
            "--no-nanny",
            "--local-directory",
            str(self.folder),
        ]
        with (self.folder / "dask.log").open("ab") as log:
            for given in (where, hand):
                command = [sys.executable, "-m", "dask", *given, "--no-dashboard"]
                environment = {**os.environ, "PYTHONPATH": str(ROOT)}
                self.processes.append(subprocess.Popen(command, stdout=log, stderr=log, env=environment))

    def kill(self) -> None:
        """Kill all of it."""
        for process in self.processes:
            process.kill()
            process.wait()
        self.processes.clear()


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[Dask]:
    made = Dask(tmp_path)
    made.start()
    yield made
    made.kill()


@pytest.mark.slow
def test_a_worker_outlives_a_cluster_that_is_killed_and_away_for_ten_seconds(
    sqlite_repo: Repository, dask: Dask
) -> None:
    """A real scheduler and worker: the job in its middle is begun again, later ones wait."""
    repo = with_settings(
        sqlite_repo, executor=ExecutorKind.DISTRIBUTED, dask_scheduler=dask.address, workers=2
    )
    worker = Worker(repo, KINDS)
    worker.start()
    try:
        first = queue(repo, "succeed")
        until(lambda: row_of(repo, first).state == "succeeded")
        middle = queue(repo, "hang-once")
        until(lambda: row_of(repo, middle).progress == 0.5)
        dask.kill()
        meanwhile = [queue(repo, "succeed") for _ in range(3)]
        until(lambda: "does not answer" in worker.engine.trouble)
        threading.Event().wait(10.0)
        assert worker.alive
        assert {row_of(repo, job).state for job in (middle, *meanwhile)} == {"queued"}
        dask.start()
        until(lambda: {row_of(repo, job).state for job in (middle, *meanwhile)} == {"succeeded"})
        assert not worker.engine.trouble
        mine = [first, middle, *meanwhile]
        assert sorted(i for i, _ in SETTLED if i in mine) == sorted(mine)  # each once
    finally:
        worker.stop()
