"""A job is never lost and never done twice, whoever dies."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections import Counter
from collections.abc import Iterator
from datetime import timedelta
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule, run_state_machine_as_test
from hypothesis.strategies import integers
from sqlalchemy import event, select, update
from sqlalchemy.orm import Session

from ground.gdr import notices
from ground.gdr.base import utc_now
from ground.gdr.repository import Repository
from ground.jobs import queue as queue_module
from ground.jobs import worker as worker_module
from ground.jobs.queue import Claim, JobKind, claim_job, enqueue, give_up, hand_back, renew, settle
from ground.jobs.row import JobRow
from ground.jobs.worker import Worker
from ground.records.actor import Actor
from ground.resources.jobs.cancel_job import cancel_job, retry_job
from ground.settings import ExecutorKind, Settings
from tests.ground import work_for_tests
from tests.ground.conftest import PLANNER, Api

SETTLED: list[tuple[str, dict[str, Any]]] = []
ABANDONED: list[str] = []


def _settle(_repo: Repository, _session: Session, job: JobRow, result: dict[str, Any]) -> str:
    SETTLED.append((job.id, result))
    return f"/api/v1/done/{job.id}"


KIND = JobKind(
    "count",
    work_for_tests.ORDERS,
    work_for_tests.count,
    _settle,
    lambda _session, job: ABANDONED.append(job.id),
)
KINDS = {"count": KIND}


@pytest.fixture(autouse=True)
def _forget() -> None:
    SETTLED.clear()
    ABANDONED.clear()


def queue(repo: Repository, what: str, **changes: Any) -> str:
    with repo.database.write() as session:
        row = enqueue(
            session,
            repo.settings,
            kind="count",
            mission_id=None,
            subject_kind="none",
            subject_id="none",
            payload={"format": "count/1", "what": what, "log": str(repo.data_dir / "starts.log")},
            author="Planner",
        )
        for name, value in changes.items():
            setattr(row, name, value)
        return row.id


def row_of(repo: Repository, job_id: str) -> JobRow:
    with repo.database.read() as session:
        return session.get_one(JobRow, job_id)


def let_lease_run_out(repo: Repository, job_id: str) -> None:
    with repo.database.write() as session:
        past = utc_now() - timedelta(seconds=1)
        session.execute(update(JobRow).where(JobRow.id == job_id).values(lease_until_utc=past))


def with_settings(repo: Repository, **changes: Any) -> Repository:
    return dataclasses.replace(repo, settings=Settings(**{**repo.settings.model_dump(), **changes}))


def test_a_job_is_there_only_if_its_transaction_is_committed(repo: Repository) -> None:
    def request_that_fails() -> None:
        with repo.database.write() as session:
            enqueue(
                session,
                repo.settings,
                kind="count",
                mission_id=None,
                subject_kind="",
                subject_id="",
                payload={},
                author="",
            )
            raise RuntimeError("the request failed")

    with pytest.raises(RuntimeError, match="the request failed"):
        request_that_fails()
    assert claim_job(repo, KINDS, "me") is None


def test_a_job_is_done_and_its_result_written_once(repo: Repository) -> None:
    job = queue(repo, "succeed")
    assert Worker(repo, KINDS).run_until_idle() == 1
    row = row_of(repo, job)
    assert (row.state, row.progress, row.result_url) == ("succeeded", 1.0, f"/api/v1/done/{job}")
    assert [(job, {"answer": 42})] == SETTLED


def test_two_workers_never_get_the_same_job(repo: Repository) -> None:
    made = {queue(repo, "succeed") for _ in range(12)}
    claims: list[Claim] = []

    def take() -> None:
        while (claim := claim_job(repo, KINDS, threading.current_thread().name)) is not None:
            claims.append(claim)

    threads = [threading.Thread(target=take) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(c.job_id for c in claims) == sorted(made)


def test_a_job_whose_lease_ran_out_goes_to_another_and_the_first_is_fenced(repo: Repository) -> None:
    job = queue(repo, "succeed")
    first = claim_job(repo, KINDS, "first")
    assert first is not None
    assert claim_job(repo, KINDS, "second") is None
    let_lease_run_out(repo, job)
    second = claim_job(repo, KINDS, "second")
    assert second is not None
    assert (second.job_id, second.token) == (job, first.token + 1)
    assert renew(repo, first, 0.9, "late") == (False, True)
    assert settle(repo, KIND, first, {"answer": "late"}) is False
    assert give_up(repo, KIND, first, "failed", "late", None) is False
    assert settle(repo, KIND, second, {"answer": 1}) is True
    assert settle(repo, KIND, second, {"answer": 2}) is False
    assert [(job, {"answer": 1})] == SETTLED


def test_an_expected_failure_is_a_problem_document(repo: Repository) -> None:
    job = queue(repo, "fail")
    Worker(repo, KINDS).run_until_idle()
    row = row_of(repo, job)
    assert row.state == "failed"
    assert row.problem is not None
    assert row.problem["detail"] == "as it was told"
    assert [job] == ABANDONED


def test_an_unexpected_failure_is_named_and_not_repeated(repo: Repository) -> None:
    job = queue(repo, "break")
    Worker(repo, KINDS).run_until_idle()
    row = row_of(repo, job)
    assert (row.state, row.attempt) == ("failed", 1)
    assert row.problem is not None
    assert "ZeroDivisionError" in row.problem["detail"]


def test_a_result_that_cannot_be_written_fails_the_job_and_leaves_nothing_behind(repo: Repository) -> None:
    def spoil(_repo: Repository, session: Session, job: JobRow, _result: dict[str, Any]) -> str:
        session.add(
            JobRow(
                id="job-half",
                author="",
                kind="x",
                payload={},
                subject_kind="",
                subject_id="",
                state="failed",
                max_attempts=1,
                time_limit_s=1.0,
                log=[],
            )
        )
        session.flush()
        raise ValueError("half way")

    job = queue(repo, "succeed")
    Worker(repo, {"count": dataclasses.replace(KIND, settle=spoil)}).run_until_idle()
    assert row_of(repo, job).state == "failed"
    with repo.database.read() as session:
        assert session.scalars(select(JobRow.id)).all() == [job]


def test_a_waiting_job_is_cancelled_at_once_and_can_be_queued_again(repo: Repository) -> None:
    job = queue(repo, "succeed")
    assert cancel_job(repo, PLANNER, job).state == "cancelled"
    assert Worker(repo, KINDS).run_until_idle() == 0
    assert retry_job(repo, PLANNER, job).state == "queued"
    assert Worker(repo, KINDS).run_until_idle() == 1
    assert row_of(repo, job).state == "succeeded"


def test_a_job_begun_too_often_is_given_up(repo: Repository) -> None:
    job = queue(repo, "succeed", max_attempts=2)
    for _ in range(2):
        assert claim_job(repo, KINDS, "dies") is not None
        let_lease_run_out(repo, job)
    assert claim_job(repo, KINDS, "next") is None
    row = row_of(repo, job)
    assert row.state == "failed"
    assert "begun 2 times" in row.message


def wait_for(repo: Repository, job: str, *states: str, limit_s: float = 40.0) -> JobRow:
    until = time.monotonic() + limit_s
    while (row := row_of(repo, job)).state not in states:
        assert time.monotonic() < until, (row.state, row.message)
        threading.Event().wait(0.02)
    return row


@pytest.fixture
def worker(repo: Repository) -> Iterator[Worker]:
    """Give a worker with processes of its own, running."""
    made = Worker(with_settings(repo, executor=ExecutorKind.PROCESS, job_lease_s=5.0), KINDS, slots=1)
    made.GRACE_S = 0.3  # type: ignore[misc]
    made.start()
    yield made
    made.stop()


def test_work_whose_process_is_killed_is_done_again(repo: Repository, worker: Worker) -> None:
    job = queue(repo, "die-once")
    row = wait_for(repo, job, "succeeded", "failed")
    assert (row.state, row.attempt) == ("succeeded", 2)
    assert [i for i, _ in SETTLED] == [job]


def test_work_that_kills_every_process_is_given_up_and_harms_no_other(
    repo: Repository, worker: Worker
) -> None:
    bad, good = queue(repo, "die", max_attempts=2), queue(repo, "succeed")
    assert wait_for(repo, bad, "succeeded", "failed").state == "failed"
    assert wait_for(repo, good, "succeeded", "failed").state == "succeeded"


def test_running_work_stops_when_asked(repo: Repository, worker: Worker) -> None:
    job = queue(repo, "wait")
    wait_for(repo, job, "running")
    cancel_job(repo, PLANNER, job)
    assert wait_for(repo, job, "cancelled", "failed", "succeeded").state == "cancelled"
    assert SETTLED == []


def test_what_stopped_work_still_has_is_kept(repo: Repository, worker: Worker) -> None:
    worker.GRACE_S = 20.0  # type: ignore[misc]
    job = queue(repo, "keep")
    wait_for(repo, job, "running")
    cancel_job(repo, PLANNER, job)
    row = wait_for(repo, job, "cancelled", "failed", "succeeded")
    assert (row.state, row.message) == ("succeeded", "the best so far")
    assert [(job, {"answer": 41, "stopped": "the best so far"})] == SETTLED


def test_work_that_does_not_listen_is_ended_at_its_time_limit(repo: Repository, worker: Worker) -> None:
    job = queue(repo, "hang", time_limit_s=0.5)
    row = wait_for(repo, job, "cancelled", "failed", "succeeded")
    assert row.state == "failed"
    assert "time limit of 0.5 s" in row.message


def test_a_worker_that_stops_hands_its_jobs_back(repo: Repository) -> None:
    first = Worker(with_settings(repo, executor=ExecutorKind.PROCESS), KINDS, slots=1)
    first.start()
    job = queue(repo, "wait")
    wait_for(repo, job, "running")
    first.stop()
    assert row_of(repo, job).state == "queued"


@pytest.mark.postgres
@pytest.mark.parametrize("database_address", ["postgresql"], indirect=True)
def test_a_worker_that_is_told_asks_nothing_in_silence_and_hears_of_a_job_of_another_process(
    repo: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Worker, "TOLD_LOOK_S", 600.0)
    monkeypatch.setattr(notices, "AGAIN_S", 600.0)
    looks: list[float] = []
    listens = threading.Event()
    told = Worker._told

    def heard(worker: Worker, topics: Any) -> None:
        told(worker, topics)
        listens.set()

    monkeypatch.setattr(Worker, "_told", heard)
    real = worker_module.waiting

    def counted(*given: Any) -> Counter[str]:
        looks.append(time.monotonic())
        return real(*given)

    monkeypatch.setattr(worker_module, "waiting", counted)
    settings = repo.settings.model_copy(update={"executor": ExecutorKind.INLINE})
    worker = Worker(dataclasses.replace(repo, settings=settings), KINDS, slots=1)
    worker.start()
    try:
        assert listens.wait(30.0)
        time.sleep(3.0)  # the look that comes of it may be late
        before = len(looks)
        time.sleep(2.0)
        assert len(looks) == before, "nothing was told"
        monkeypatch.setattr(queue_module, "WAKE", threading.Event())  # as in another process
        wait_for(repo, queue(repo, "succeed"), "succeeded")
        assert len(looks) > before
    finally:
        worker.stop()


@pytest.mark.postgres
@pytest.mark.parametrize("database_address", ["postgresql"], indirect=True)
def test_a_worker_that_is_told_does_not_ask_whether_its_work_is_to_stop(
    repo: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Worker, "TOLD_LOOK_S", 600.0)
    monkeypatch.setattr(notices, "AGAIN_S", 600.0)
    worker = Worker(with_settings(repo, executor=ExecutorKind.PROCESS, job_lease_s=600.0), KINDS, slots=1)
    asked: list[str] = []

    def seen(_: Any, __: Any, statement: str, *rest: Any) -> None:
        asked.append(statement)

    worker.start()
    try:
        job = queue(repo, "wait")
        until = time.monotonic() + 60.0
        while row_of(repo, job).progress < 0.5:  # the last that it tells; its process may be slow to begin
            assert time.monotonic() < until
            time.sleep(0.05)
        time.sleep(2.0)  # what was told of the job itself is heeded
        event.listen(repo.database.engine, "before_cursor_execute", seen)
        time.sleep(2.0)
        event.remove(repo.database.engine, "before_cursor_execute", seen)
        assert [statement for statement in asked if "jobs" in statement] == []
        monkeypatch.setattr(queue_module, "WAKE", threading.Event())  # as in another process
        cancel_job(repo, PLANNER, job)
        assert wait_for(repo, job, "cancelled", "failed", "succeeded").state == "cancelled"
    finally:
        worker.stop()


def test_progress_reaches_the_row(repo: Repository, worker: Worker) -> None:
    job = queue(repo, "wait")
    until = time.monotonic() + 30.0
    while row_of(repo, job).progress < 0.5:
        assert time.monotonic() < until
        threading.Event().wait(0.02)
    assert row_of(repo, job).message == "half"
    cancel_job(repo, PLANNER, job)
    wait_for(repo, job, "cancelled")


def test_work_that_is_young_tells_no_progress(
    repo: Repository, worker: Worker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Worker, "YOUNG_S", 600.0)
    job = queue(repo, "wait")
    wait_for(repo, job, "running")
    begun = row_of(repo, job).revision
    time.sleep(1.0)
    assert (row_of(repo, job).progress, row_of(repo, job).revision) == (0.0, begun)
    monkeypatch.setattr(Worker, "YOUNG_S", 0.0)
    until = time.monotonic() + 30.0
    while row_of(repo, job).progress < 0.5:
        assert time.monotonic() < until
        time.sleep(0.02)
    cancel_job(repo, PLANNER, job)
    wait_for(repo, job, "cancelled")


class Machine(RuleBasedStateMachine):
    """Any order of claims, lost leases, late results and hand-backs settles each job at most once."""

    repo: Repository
    actor: Actor = PLANNER

    def __init__(self) -> None:
        super().__init__()
        with self.repo.database.write() as session:
            session.query(JobRow).delete()
        SETTLED.clear()
        self.claims: list[Claim] = []
        self.jobs: list[str] = []

    @rule()
    def queue_one(self) -> None:
        if len(self.jobs) < 4:
            self.jobs.append(queue(self.repo, "succeed", max_attempts=50))

    @rule()
    def claim(self) -> None:
        claim = claim_job(self.repo, KINDS, "any")
        if claim is not None:
            self.claims.append(claim)

    @rule(which=integers(0, 3))
    def lose_lease(self, which: int) -> None:
        if which < len(self.jobs):
            let_lease_run_out(self.repo, self.jobs[which])

    @rule(which=integers(0, 9))
    def finish(self, which: int) -> None:
        if which < len(self.claims):
            settle(self.repo, KIND, self.claims[which], {"token": self.claims[which].token})

    @rule(which=integers(0, 9))
    def return_it(self, which: int) -> None:
        if which < len(self.claims):
            hand_back(self.repo, self.claims[which], "handed back")

    @rule(which=integers(0, 9))
    def renew_it(self, which: int) -> None:
        if which < len(self.claims):
            ours, _ = renew(self.repo, self.claims[which], 0.1, "on")
            newest = max(c.token for c in self.claims if c.job_id == self.claims[which].job_id)
            assert not ours or self.claims[which].token == newest

    @rule(which=integers(0, 3))
    def cancel(self, which: int) -> None:
        if which < len(self.jobs):
            cancel_job(self.repo, self.actor, self.jobs[which])

    @invariant()
    def each_job_is_settled_at_most_once_and_none_is_lost(self) -> None:
        settled = [job for job, _ in SETTLED]
        assert len(settled) == len(set(settled))
        with self.repo.database.read() as session:
            states = dict(session.execute(select(JobRow.id, JobRow.state)).all())  # type: ignore[arg-type]
        assert set(states) == set(self.jobs)
        for job, state in states.items():
            assert (state == "succeeded") == (job in settled)


def test_jobs_settle_once_in_any_order_of_events(repo: Repository) -> None:
    Machine.repo = repo
    run_state_machine_as_test(
        Machine,
        settings=settings(
            max_examples=12,
            stateful_step_count=20,
            deadline=None,
            suppress_health_check=list(HealthCheck),
            database=None,
        ),
    )


def test_job_states_are_streamed_with_ids_to_resume_from(api: Api) -> None:
    job = queue(api.repo, "succeed")
    Worker(api.repo, KINDS).run_until_idle()
    stream = api("GET", f"/jobs/{job}/events").text
    assert "event: job" in stream
    assert '"state":"succeeded"' in stream
    last = stream.rsplit("id: ", 1)[1].split("\n")[0]
    again = api("GET", f"/jobs/{job}/events", headers={"Last-Event-ID": last}).text
    assert again.count("event: job") == 1


@pytest.mark.parametrize(
    ("payload", "message"),
    [
        ({"format": "count/2", "what": "succeed"}, 'has the format "count/2", newer than this program'),
        ({"format": "count/1", "what": "succeed"}, "log is missing"),
        ({"format": "count/1", "what": 3, "log": ""}, "what must be a string, found 3"),
    ],
)
def test_an_order_that_cannot_be_read_fails_the_job_by_name(
    repo: Repository, payload: dict[str, Any], message: str
) -> None:
    job_id = queue(repo, "succeed", payload=payload)
    Worker(repo, KINDS).run_until_idle()
    row = row_of(repo, job_id)
    assert row.state == "failed"
    assert message in row.message
    assert [job_id] == ABANDONED


def heeding(begun: list[str], lasting: list[str]) -> dict[str, JobKind]:
    """Return a kind that notes what its subjects are told."""

    def begin(_session: Session, job: JobRow) -> None:
        begun.append(job.id)

    def lasts(_session: Session, job: JobRow) -> None:
        lasting.append(job.id)

    return {"count": dataclasses.replace(KIND, begin=begin, lasts=lasts)}


def test_only_work_that_lasts_says_that_it_goes_on(repo: Repository) -> None:
    begun: list[str] = []
    lasting: list[str] = []
    kinds = heeding(begun, lasting)
    worker = Worker(with_settings(repo, executor=ExecutorKind.PROCESS), kinds, slots=1)
    worker.start()
    try:
        wait_for(repo, queue(repo, "succeed"), "succeeded")  # its process may take long to start
        lasting.clear()
        job = queue(repo, "succeed")
        wait_for(repo, job, "succeeded")
        assert (begun[-1], lasting) == (job, [])
        job = queue(repo, "wait")
        until = time.monotonic() + 30.0
        while not lasting or row_of(repo, job).progress < 0.5:
            assert time.monotonic() < until
            time.sleep(0.02)
        assert (begun[-1], lasting) == (job, [job]), "once, not with each progress"
        cancel_job(repo, PLANNER, job)
        wait_for(repo, job, "cancelled")
    finally:
        worker.stop()


@pytest.mark.parametrize("executor", [ExecutorKind.PROCESS, ExecutorKind.INLINE])
def test_an_order_is_completed_by_who_takes_the_job(repo: Repository, executor: ExecutorKind) -> None:
    """What counts when it is taken up, not when it was asked for: the keys of signers."""

    def begin(_session: Session, job: JobRow) -> None:
        job.payload = {**job.payload, "what": "more"}

    lasting: list[str] = []
    kind = dataclasses.replace(heeding([], lasting)["count"], begin=begin)
    job = queue(repo, "succeed")
    claim = claim_job(with_settings(repo, executor=executor), {"count": kind}, "me")
    assert claim is not None
    assert claim.payload["what"] == "more"
    assert lasting == ([job] if executor is ExecutorKind.INLINE else []), (
        "nobody attends to work in this thread"
    )


@pytest.mark.postgres
@pytest.mark.parametrize("database_address", ["postgresql"], indirect=True)
def test_a_worker_that_is_told_looks_again_after_a_job_only_where_others_wait(
    repo: Repository, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks: list[float] = []
    real = worker_module.waiting

    def counted(*given: Any) -> Counter[str]:
        looks.append(time.monotonic())
        return real(*given)

    monkeypatch.setattr(worker_module, "waiting", counted)
    monkeypatch.setattr(Worker, "TOLD_LOOK_S", 600.0)
    monkeypatch.setattr(notices, "AGAIN_S", 600.0)
    worker = Worker(with_settings(repo, executor=ExecutorKind.PROCESS, job_lease_s=600.0), KINDS, slots=1)
    jobs = [queue(repo, "succeed") for _ in range(3)]
    monkeypatch.setattr(queue_module, "WAKE", threading.Event())  # as in another process
    worker.start()
    try:
        for job in jobs:
            wait_for(repo, job, "succeeded")
        time.sleep(1.0)
        before = len(looks)
        wait_for(repo, queue(repo, "succeed"), "succeeded")
        time.sleep(1.0)
        assert len(looks) == before + 1
    finally:
        worker.stop()
