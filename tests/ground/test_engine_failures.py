"""No error of an engine, a file or the database ends a worker or fails a job; and jobs take fair turns."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from dataclasses import replace
from importlib import import_module
from typing import Any

import pytest

from ground.app.check_readiness import worker_checks
from ground.errors import BusyError
from ground.gdr.repository import Repository
from ground.jobs import worker as worker_module
from ground.jobs.engine import EngineState
from ground.jobs.executors import InlineExecutor
from ground.jobs.queue import claim_job
from ground.jobs.worker import Worker
from ground.resources.missions.value import Mission
from ground.settings import ExecutorKind
from tests.ground.test_jobs import KIND, KINDS, SETTLED, queue, row_of, wait_for, with_settings
from tests.waiting import until

LEASE_S = 0.6


class Cluster:
    """An engine that is lost and found: `make` refuses while it is away, futures end as a cluster's."""

    def __init__(self) -> None:
        self.away = False
        self.lost = False
        self.asked = 0
        self.spoil: BaseException | None = None
        self.slow_s = 0.0

    def make(self, _settings: Any) -> Any:
        self.asked += 1
        time.sleep(self.slow_s)
        if self.away:
            raise OSError("Timed out trying to connect to tcp://127.0.0.1:1")
        return self

    def submit(self, fn: Callable[..., Any], /, *args: Any) -> Future[Any]:
        if self.spoil is not None:
            future: Future[Any] = Future()
            future.set_exception(self.spoil)
            return future
        return InlineExecutor().submit(fn, *args)

    def shutdown(self, **_how: Any) -> None:
        if self.away:
            raise OSError("the connection is gone")


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> Cluster:
    made = Cluster()
    monkeypatch.setattr(worker_module, "make_executor", made.make)
    SETTLED.clear()
    return made


@pytest.fixture
def worker(sqlite_repo: Repository, cluster: Cluster) -> Iterator[Worker]:
    patient = with_settings(sqlite_repo, executor=ExecutorKind.INLINE, job_lease_s=LEASE_S)
    made = Worker(patient, KINDS, slots=1)
    made.RETRY_S = (0.05, 0.1)  # type: ignore[misc]
    yield made
    made.stop()


def test_a_scheduler_that_is_not_there_is_waited_for(
    sqlite_repo: Repository, cluster: Cluster, worker: Worker
) -> None:
    cluster.away = True
    job = queue(sqlite_repo, "succeed")
    worker.start()
    until(lambda: cluster.asked >= 3)
    assert worker.alive
    assert worker_checks(worker)["engine"].startswith(
        "degraded: OSError: Timed out trying to connect to tcp://127.0.0.1:1 since "
    )
    assert (row_of(sqlite_repo, job).state, row_of(sqlite_repo, job).attempt) == ("queued", 0)
    cluster.away = False
    assert wait_for(sqlite_repo, job, "succeeded", "failed").state == "succeeded"
    assert worker_checks(worker) == {"worker": "ok", "engine": "ok"}
    assert row_of(sqlite_repo, job).attempt == 1


@pytest.mark.parametrize(
    "error",
    [
        CancelledError(),
        type("FutureCancelledError", (Exception,), {"__module__": "distributed.client"})("lost"),
        type("CommClosedError", (OSError,), {"__module__": "distributed.comm.core"})("lost"),
    ],
)
def test_a_job_whose_engine_was_lost_is_queued_again_and_burns_no_attempt(
    sqlite_repo: Repository, cluster: Cluster, worker: Worker, error: BaseException
) -> None:
    cluster.spoil = error
    job = queue(sqlite_repo, "succeed", max_attempts=2)
    worker.start()
    until(lambda: worker.engine.failures >= 4)
    cluster.spoil = None
    row = wait_for(sqlite_repo, job, "succeeded", "failed")
    assert (row.state, row.attempt) == ("succeeded", 1)
    assert "its engine failed" in str(row.log)
    assert [i for i, _ in SETTLED] == [job]


def killed_worker() -> BaseException:
    return type("KilledWorker", (Exception,), {"__module__": "distributed.scheduler"})("3 times")


def test_work_that_kills_workers_of_a_cluster_is_blamed_itself(
    sqlite_repo: Repository, cluster: Cluster, worker: Worker
) -> None:
    cluster.spoil = killed_worker()
    job = queue(sqlite_repo, "succeed", max_attempts=2)
    worker.start()
    row = wait_for(sqlite_repo, job, "succeeded", "failed")
    assert (row.state, row.attempt, row.token) == ("failed", 2, 2)
    assert not worker.engine.failures


def test_work_whose_cluster_workers_somebody_killed_is_done_by_the_next(
    sqlite_repo: Repository, cluster: Cluster, worker: Worker
) -> None:
    cluster.spoil = killed_worker()
    job = queue(sqlite_repo, "succeed", max_attempts=20)
    worker.start()
    until(lambda: row_of(sqlite_repo, job).attempt >= 2)
    cluster.spoil = None
    assert wait_for(sqlite_repo, job, "succeeded", "failed").state == "succeeded"
    assert [i for i, _ in SETTLED] == [job]


def test_an_engine_that_is_lost_while_nothing_runs_is_told_and_found_again(
    sqlite_repo: Repository, cluster: Cluster, worker: Worker
) -> None:
    """No job waits: neither the loss nor the return has to wait for one."""
    job = queue(sqlite_repo, "succeed")
    worker.start()
    wait_for(sqlite_repo, job, "succeeded")
    cluster.away = cluster.lost = True
    until(lambda: bool(worker.engine.trouble))
    cluster.away = cluster.lost = False
    until(lambda: not worker.engine.trouble)
    assert worker_checks(worker) == {"worker": "ok", "engine": "ok"}


def test_failures_of_all_slots_at_one_death_make_the_wait_no_longer() -> None:
    once = EngineState().failed(CancelledError(), 0.5, 10.0)
    thrice = once.failed(CancelledError(), 0.5, 10.0).failed(CancelledError(), 0.5, 10.0)
    assert (thrice.wait_s, thrice.retry_at, thrice.failures) == (0.5, once.retry_at, 3)


def test_a_slow_engine_does_not_cost_a_lease(
    sqlite_repo: Repository, cluster: Cluster, worker: Worker
) -> None:
    """The worker's own thread is busy for three leases, with work in hand: nobody else may take the job."""
    job = queue(sqlite_repo, "succeed")
    hold = threading.Event()

    def slow(fn: Callable[..., Any], /, *args: Any) -> Future[Any]:
        hold.wait(3 * LEASE_S)
        return InlineExecutor().submit(fn, *args)

    cluster.submit = slow  # type: ignore[method-assign]
    worker.start()
    wait_for(sqlite_repo, job, "running")
    end = time.monotonic() + 2 * LEASE_S
    while time.monotonic() < end:
        assert claim_job(worker.repo, KINDS, "another") is None
        threading.Event().wait(0.05)
    hold.set()
    row = wait_for(sqlite_repo, job, "succeeded", "failed")
    assert (row.state, row.attempt) == ("succeeded", 1)


def test_a_full_disk_does_not_end_the_worker(
    sqlite_repo: Repository, cluster: Cluster, worker: Worker, monkeypatch: pytest.MonkeyPatch
) -> None:
    full = threading.Event()
    step = Worker.step
    met = []

    def no_room(self: Worker) -> bool:
        if not full.is_set():
            met.append(1)
            raise OSError(28, "No space left on device")
        return step(self)

    monkeypatch.setattr(Worker, "step", no_room)
    job = queue(sqlite_repo, "succeed")
    worker.start()
    until(lambda: bool(met))
    full.set()
    assert wait_for(sqlite_repo, job, "succeeded", "failed").state == "succeeded"


def test_missions_take_turns(repo: Repository, mission: Mission, terrain_folder: Any) -> None:
    from tests.ground.conftest import yard

    other = yard(repo, terrain_folder, "Other yard")
    many = [queue(repo, "succeed", mission_id=mission.id) for _ in range(5)]
    few = [queue(repo, "succeed", mission_id=other.id) for _ in range(2)]
    taken = []
    while (claim := claim_job(repo, KINDS, "w")) is not None:
        taken.append(claim.job_id)
    assert taken == [many[0], few[0], many[1], few[1], *many[2:]]


def test_interactive_work_goes_first_and_has_a_slot_of_its_own(sqlite_repo: Repository) -> None:
    kinds = {**KINDS, "quick": replace(KIND, name="quick", interactive=True)}
    worker = Worker(with_settings(sqlite_repo, executor=ExecutorKind.PROCESS), kinds, slots=1)
    worker.GRACE_S = 0.3  # type: ignore[misc]
    long = [queue(sqlite_repo, "wait") for _ in range(10)]
    worker.start()
    try:
        wait_for(sqlite_repo, long[0], "running")
        quick = [queue(sqlite_repo, "succeed", kind="quick") for _ in range(2)]
        for job in quick:
            assert wait_for(sqlite_repo, job, "succeeded", "failed").state == "succeeded"
        states = [row_of(sqlite_repo, job).state for job in long]
        assert states == ["running"] + ["queued"] * 9
    finally:
        worker.stop()


def test_every_kind_that_a_person_waits_for_is_interactive() -> None:
    from ground.app.job_kinds import job_kinds

    quick = {kind.name for kind in job_kinds().values() if kind.interactive}
    assert quick == {"build_path_network", "dry_run"}
    assert {kind.name for kind in job_kinds().values() if kind.live} == {"live"}


def test_live_runs_take_no_slot_of_other_work(sqlite_repo: Repository) -> None:
    kinds = {
        **KINDS,
        "quick": replace(KIND, name="quick", interactive=True),
        "live": replace(KIND, name="live", live=True),
    }
    worker = Worker(with_settings(sqlite_repo, executor=ExecutorKind.PROCESS), kinds, slots=1)
    worker.GRACE_S = 0.3  # type: ignore[misc]
    live = [queue(sqlite_repo, "wait", kind="live") for _ in range(2)]
    worker.start()
    try:
        for job in live:
            wait_for(sqlite_repo, job, "running")
        others = [queue(sqlite_repo, "succeed", kind=kind) for kind in ("quick", "count")]
        for job in others:
            assert wait_for(sqlite_repo, job, "succeeded", "failed").state == "succeeded"
        assert [row_of(sqlite_repo, job).state for job in live] == ["running"] * 2
    finally:
        worker.stop()


def test_an_engine_that_always_loses_a_job_does_not_keep_it_for_ever(
    sqlite_repo: Repository, cluster: Cluster, worker: Worker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ground.jobs.queue.ENGINE_FAILURES", 3)
    cluster.spoil = CancelledError()
    job = queue(sqlite_repo, "succeed", max_attempts=2)
    worker.start()
    row = wait_for(sqlite_repo, job, "succeeded", "failed")
    assert (row.state, row.attempt, row.token) == ("failed", 2, 5)
    assert (
        "begun 2 times; the last time: its engine failed (CancelledError: it dropped the work)" in row.message
    )


def test_work_that_is_done_waits_for_a_busy_database_and_keeps_its_lease(
    sqlite_repo: Repository, cluster: Cluster, worker: Worker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The database is busy for three leases, for results and leases alike: the work is written, and once."""
    busy = threading.Event()
    refused: list[str] = []
    for module, name in (("worker", "settle"), ("leases", "extend")):
        real = getattr(import_module(f"ground.jobs.{module}"), name)

        def slow(*args: Any, real: Any = real, name: str = name) -> Any:
            if not busy.is_set():
                refused.append(name)
                raise BusyError("the database was busy with other writes for 30 s; try again")
            return real(*args)

        monkeypatch.setattr(f"ground.jobs.{module}.{name}", slow)
    job = queue(sqlite_repo, "succeed")
    worker.start()
    until(lambda: refused.count("settle") >= 2 and refused.count("extend") >= 2)
    assert row_of(sqlite_repo, job).state == "running"
    busy.set()
    row = wait_for(sqlite_repo, job, "succeeded", "failed")
    assert (row.state, row.attempt) == ("succeeded", 1)
    assert [i for i, _ in SETTLED] == [job]
