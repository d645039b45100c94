"""Long work as rows with a lease, and the worker that does it on an Executor.

A job is committed together with the request that made it. A worker claims it with a lease and a fencing
token that grows by one with each claim; it renews the lease while the work goes on, and its result is
written only if the token is still the newest one, in the same transaction as everything that the result
changes. So a worker that dies loses nothing (the lease runs out and any other takes the job up) and one
that was merely slow doubles nothing.

The work itself is a pure function `work(payload, report, should_stop)` on a `concurrent.futures.Executor`.
It may be in another process or on another host; word of its progress goes through a small file in the data
folder.
"""

from __future__ import annotations

import json
import logging
import os
import socket
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from sqlalchemy import and_, or_, select
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from ground.errors import GroundError, JobFailedError
from ground.gdr.ids import new_id
from ground.gdr.models import JobRow, utc_now
from ground.gdr.repository import Repository
from ground.settings import ExecutorKind, Settings

logger = logging.getLogger(__name__)

Report = Callable[[float, str], None]
ShouldStop = Callable[[], bool]
Work = Callable[[dict[str, Any], Report, ShouldStop], dict[str, Any]]
Settle = Callable[[Repository, Session, JobRow, dict[str, Any]], str | None]
Abandon = Callable[[Session, JobRow], None]

LOG_LINES = 200
WAKE = threading.Event()
"""Set when a job was queued in this process, so that its worker need not wait for the next look."""


class WorkStoppedError(Exception):
    """Raised by work that was asked to stop and did."""


@dataclass(frozen=True, slots=True)
class JobKind:
    """One kind of long work.

    `work` must be importable by name (it is sent to another process). `settle` writes the result into the
    repository and returns its address; `abandon` is called when the job ends without a result, `begin` when
    a worker takes it up.
    """

    name: str
    work: Work
    settle: Settle
    abandon: Abandon
    begin: Abandon | None = None


def enqueue(
    session: Session,
    settings: Settings,
    *,
    kind: str,
    mission_id: str | None,
    subject_kind: str,
    subject_id: str,
    payload: Mapping[str, Any],
    author: str,
    job_id: str | None = None,
) -> JobRow:
    """Return a queued job; it exists when the caller's transaction is committed."""
    row = JobRow(
        id=job_id or new_id("job"),
        author=author,
        mission_id=mission_id,
        kind=kind,
        payload=dict(payload),
        subject_kind=subject_kind,
        subject_id=subject_id,
        state="queued",
        max_attempts=settings.job_attempts,
        time_limit_s=settings.job_time_limit_s,
        log=[],
    )
    session.add(row)
    session.flush()
    return row


@dataclass(frozen=True, slots=True)
class Claim:
    """The right to do a job, until its token is outdated."""

    job_id: str
    kind: str
    token: int
    attempt: int
    payload: dict[str, Any]
    time_limit_s: float


def _log(row: JobRow, text: str) -> None:
    row.log = [*row.log, {"at_utc": utc_now().isoformat(), "text": text}][-LOG_LINES:]


def _end(row: JobRow, state: str, message: str, problem: dict[str, Any] | None = None) -> None:
    row.state, row.message, row.problem = state, message, problem
    row.finished_utc, row.lease_until_utc = utc_now(), None
    row.revision += 1
    row.modified_utc = utc_now()
    _log(row, message or state)


def claim_job(repo: Repository, kinds: Mapping[str, JobKind], worker: str) -> Claim | None:
    """Return the oldest job that waits or whose lease has run out, now leased to `worker`; None if there
    is none.

    A job that was begun too often is ended as failed; one that was to be cancelled is cancelled.
    """
    with repo.database.write() as session:
        while True:
            now = utc_now()
            query = (
                select(JobRow)
                .where(
                    JobRow.kind.in_(list(kinds)),
                    or_(
                        JobRow.state == "queued",
                        and_(JobRow.state == "running", JobRow.lease_until_utc < now),
                    ),
                )
                .order_by(JobRow.id)
                .limit(1)
                .with_for_update(skip_locked=True)
            )
            row = session.scalars(query).first()
            if row is None:
                return None
            if row.cancel_requested:
                _end(row, "cancelled", "cancelled before it began")
                kinds[row.kind].abandon(session, row)
                session.flush()
                continue
            if row.attempt >= row.max_attempts:
                detail = f"given up: it was begun {row.attempt} times and its worker vanished each time"
                _end(row, "failed", detail, problem_of(JobFailedError(detail)))
                kinds[row.kind].abandon(session, row)
                session.flush()
                continue
            row.state, row.worker = "running", worker
            row.token += 1
            row.attempt += 1
            row.revision += 1
            row.progress, row.message = 0.0, "begun"
            row.lease_until_utc = now + timedelta(seconds=repo.settings.job_lease_s)
            row.started_utc = row.started_utc or now
            _log(row, f"attempt {row.attempt} by {worker}")
            begin = kinds[row.kind].begin
            if begin is not None:
                begin(session, row)
            return Claim(row.id, row.kind, row.token, row.attempt, dict(row.payload), row.time_limit_s)


def renew(repo: Repository, claim: Claim, progress: float, message: str) -> tuple[bool, bool]:
    """Renew the lease and note the progress; return (still ours, cancel wanted)."""
    with repo.database.write() as session:
        row = _ours(session, claim)
        if row is None:
            return False, True
        row.lease_until_utc = utc_now() + timedelta(seconds=repo.settings.job_lease_s)
        progress = min(1.0, max(row.progress, progress))
        if (progress, message) != (row.progress, row.message):
            if message != row.message:
                _log(row, message)
            row.progress, row.message = progress, message
            row.revision += 1
        return True, row.cancel_requested


def _ours(session: Session, claim: Claim) -> JobRow | None:
    query = select(JobRow).where(
        JobRow.id == claim.job_id, JobRow.token == claim.token, JobRow.state == "running"
    )
    return session.scalars(query.with_for_update()).first()


def settle(repo: Repository, kind: JobKind, claim: Claim, result: dict[str, Any]) -> bool:
    """Write a result if the claim still holds; return whether it did.

    Work that was asked to stop may still have a result; then its member `stopped` says in words what it is.
    """
    with repo.database.write() as session:
        row = _ours(session, claim)
        if row is None:
            logger.warning("late result dropped", extra={"job_id": claim.job_id, "token": claim.token})
            return False
        row.result_url = kind.settle(repo, session, row, result)
        row.progress = 1.0
        _end(row, "succeeded", result.get("stopped") or "done")
        return True


def give_up(
    repo: Repository, kind: JobKind, claim: Claim, state: str, message: str, problem: dict[str, Any] | None
) -> bool:
    """End a job without a result if the claim still holds; return whether it did."""
    with repo.database.write() as session:
        row = _ours(session, claim)
        if row is None:
            return False
        _end(row, state, message, problem)
        kind.abandon(session, row)
        return True


def hand_back(repo: Repository, claim: Claim, reason: str) -> None:
    """Queue a job again whose worker process died or is about to stop."""
    with repo.database.write() as session:
        row = _ours(session, claim)
        if row is not None:
            row.state, row.lease_until_utc, row.message = "queued", None, reason
            row.revision += 1
            _log(row, reason)


def problem_of(error: BaseException) -> dict[str, Any]:
    """Return the problem document of work that failed."""
    if isinstance(error, GroundError):
        kind, detail = str(error.extra.get("type", "job-failed")), error.message
    else:
        kind, detail = "internal-error", f"{type(error).__name__}: {error}"
    return {
        "type": f"urn:outcrop:problem:{kind}",
        "title": "The work ended without a result",
        "status": 422,
        "detail": detail,
    }


# ---- what runs beside the work, in its process


@dataclass(slots=True)
class _Channel:
    """Word between work and worker: a file with the progress, a file that says stop."""

    folder: str
    name: str
    last: float = field(default=0.0)

    def report(self, progress: float, message: str) -> None:
        now = time.monotonic()
        if now - self.last < 0.1 and progress < 1.0:
            return
        self.last = now
        path = Path(self.folder) / f"{self.name}.progress"
        draft = path.with_suffix(".draft")
        draft.write_text(json.dumps([progress, message]), encoding="utf-8")
        draft.replace(path)

    def should_stop(self) -> bool:
        return (Path(self.folder) / f"{self.name}.stop").exists()


def run_work(work: Work, payload: dict[str, Any], folder: str, name: str) -> dict[str, Any]:
    """Do the work in this process; BLAS keeps to one thread."""
    from threadpoolctl import threadpool_limits

    channel = _Channel(folder, name)
    with threadpool_limits(limits=1):
        return work(payload, channel.report, channel.should_stop)


class InlineExecutor(Executor):
    """Does the work at once in the caller's thread; for tests and commands."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as err:
            future.set_exception(err)
        return future


class ClusterExecutor(Executor):
    """Does the work on a Dask cluster, over a connection of its own that ends with it.

    Dask's own executor takes no `cancel_futures`: without waiting it always cancels what is not done.
    """

    def __init__(self, address: str) -> None:
        from distributed import Client

        self._client = Client(address)
        self._inner: Executor = self._client.get_executor(pure=False)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        return self._inner.submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._inner.shutdown(wait=wait and not cancel_futures)
        self._client.close()


def _quiet() -> None:
    """Leave Ctrl-C to the server: it hands its jobs back itself."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)


def make_executor(settings: Settings) -> Executor:
    """Return an executor for one slot of a worker."""
    match settings.executor:
        case ExecutorKind.INLINE:
            return InlineExecutor()
        case ExecutorKind.DISTRIBUTED:
            return ClusterExecutor(settings.dask_scheduler)
        case ExecutorKind.PROCESS:
            import multiprocessing
            from concurrent.futures import ProcessPoolExecutor

            context = multiprocessing.get_context("forkserver")
            return ProcessPoolExecutor(1, mp_context=context, initializer=_quiet)


@dataclass(slots=True)
class _Running:
    claim: Claim
    future: Future[dict[str, Any]]
    channel: _Channel
    deadline: float
    renewed: float
    seen: tuple[float, str] = (0.0, "begun")
    stopping_since: float | None = None
    timed_out: bool = False


class Worker:
    """Claims jobs and sees them through, each slot with an executor of its own that can be replaced."""

    GRACE_S = 15.0
    """For work that was asked to stop, to hand in what it has."""

    LOOK_S = 0.5

    def __init__(self, repo: Repository, kinds: Mapping[str, JobKind], *, slots: int | None = None) -> None:
        self.repo, self.kinds = repo, dict(kinds)
        self.name = f"{socket.gethostname()}:{os.getpid()}"
        self._slots: list[_Running | None] = [None] * (slots or repo.settings.workers)
        self._executors: list[Executor | None] = [None] * len(self._slots)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self.folder = repo.job_dir()

    # ---- life

    def start(self, warm_up: Callable[[], None] | None = None) -> None:
        """Begin to look for jobs, in a thread; the first process runs `warm_up` until it has one."""
        if warm_up is not None and self.repo.settings.executor is ExecutorKind.PROCESS:
            executor = self._executors[0] = make_executor(self.repo.settings)
            executor.submit(warm_up)
        self._thread = threading.Thread(target=self.run, name="worker", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop looking, hand unfinished jobs back, end the processes."""
        self._stop.set()
        WAKE.set()
        if self._thread is not None:
            self._thread.join(timeout=20.0)

    def run(self) -> None:
        """Look for jobs until stopped."""
        self.folder.mkdir(parents=True, exist_ok=True)
        try:
            while not self._stop.is_set():
                try:
                    busy = self.step()
                except SQLAlchemyError:
                    logger.exception("the worker cannot reach the database")
                    busy = False
                    self._stop.wait(1.0)
                WAKE.wait(0.05 if busy else self.LOOK_S)
                WAKE.clear()
        finally:
            self._wind_down()

    def run_until_idle(self) -> int:
        """Do all jobs that wait, one after the other, and return how many; for tests and commands."""
        self.folder.mkdir(parents=True, exist_ok=True)
        count = 0
        while True:
            before = sum(r is not None for r in self._slots)
            claimed = self._claim()
            count += claimed
            if not before and not claimed:
                self._wind_down()
                return count
            for index, running in enumerate(self._slots):
                if running is not None:
                    self._attend(index, running)
            if any(r is not None for r in self._slots):
                WAKE.wait(0.02)
                WAKE.clear()

    def step(self) -> bool:
        """Claim what there is room for, attend to what runs; return whether anything runs."""
        self._claim()
        for index, running in enumerate(self._slots):
            if running is not None:
                self._attend(index, running)
        return any(r is not None for r in self._slots)

    # ---- parts

    def _claim(self) -> int:
        count = 0
        for index, running in enumerate(self._slots):
            if running is None:
                claim = claim_job(self.repo, self.kinds, self.name)
                if claim is None:
                    break
                self._begin(index, claim)
                count += 1
        return count

    def _begin(self, index: int, claim: Claim) -> None:
        channel = _Channel(str(self.folder), f"{claim.job_id}-{claim.token}")
        now = time.monotonic()
        kind = self.kinds[claim.kind]
        logger.info("job begun", extra={"job_id": claim.job_id, "kind": claim.kind, "attempt": claim.attempt})
        for last in (False, True):
            executor = self._executors[index] or make_executor(self.repo.settings)
            self._executors[index] = executor
            try:
                future = executor.submit(run_work, kind.work, claim.payload, channel.folder, channel.name)
            except BrokenExecutor:  # the process died while it had nothing to do
                self._replace_executor(index)
                if last:
                    raise
            else:
                break
        future.add_done_callback(lambda _: WAKE.set())
        self._slots[index] = _Running(claim, future, channel, now + claim.time_limit_s, now)

    def _attend(self, index: int, running: _Running) -> None:
        now = time.monotonic()
        if running.future.done():
            self._finish(index, running)
            return
        seen = self._progress(running)
        if seen != running.seen or now - running.renewed > self.repo.settings.job_lease_s / 3:
            ours, cancel = renew(self.repo, running.claim, *seen)
            running.seen, running.renewed = seen, now
            if (cancel or not ours) and running.stopping_since is None:
                self._ask_to_stop(running)
        elif running.stopping_since is None and self._cancel_wanted(running, now):
            self._ask_to_stop(running)
        if now > running.deadline and running.stopping_since is None:
            running.timed_out = True
            self._ask_to_stop(running)
        if running.stopping_since is not None and now - running.stopping_since > self.GRACE_S:
            self._replace_executor(index)

    def _cancel_wanted(self, running: _Running, now: float) -> bool:
        if now - running.renewed < 0.3:
            return False
        with self.repo.database.read() as session:
            return bool(
                session.scalar(select(JobRow.cancel_requested).where(JobRow.id == running.claim.job_id))
            )

    def _ask_to_stop(self, running: _Running) -> None:
        running.stopping_since = time.monotonic()
        (Path(running.channel.folder) / f"{running.channel.name}.stop").touch()

    def _progress(self, running: _Running) -> tuple[float, str]:
        path = Path(running.channel.folder) / f"{running.channel.name}.progress"
        try:
            progress, message = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return running.seen
        return float(progress), str(message)

    def _finish(self, index: int, running: _Running) -> None:
        claim, kind = running.claim, self.kinds[running.claim.kind]
        self._slots[index] = None
        try:
            error = running.future.exception()
        except CancelledError as err:
            error = err
        try:
            if error is None:
                settle(self.repo, kind, claim, running.future.result())
            elif running.timed_out:
                detail = f"stopped: the time limit of {claim.time_limit_s:g} s is over"
                give_up(self.repo, kind, claim, "failed", detail, problem_of(JobFailedError(detail)))
            elif running.stopping_since is not None:
                give_up(self.repo, kind, claim, "cancelled", "cancelled", None)
            elif isinstance(error, BrokenExecutor):
                self._replace_executor(index)
                hand_back(self.repo, claim, "its process died; queued again")
            else:
                problem = problem_of(error)
                if not isinstance(error, GroundError):
                    logger.error("job failed", exc_info=error, extra={"job_id": claim.job_id})
                give_up(self.repo, kind, claim, "failed", problem["detail"], problem)
        except GroundError as err:
            give_up(self.repo, kind, claim, "failed", err.message, problem_of(err))
        except SQLAlchemyError:
            raise
        except Exception as err:
            logger.exception("the result of a job cannot be written", extra={"job_id": claim.job_id})
            give_up(self.repo, kind, claim, "failed", problem_of(err)["detail"], problem_of(err))
        finally:
            for suffix in ("progress", "stop", "draft"):
                (Path(running.channel.folder) / f"{running.channel.name}.{suffix}").unlink(missing_ok=True)

    def _replace_executor(self, index: int) -> None:
        """End the processes of a slot, whatever they are doing."""
        executor, self._executors[index] = self._executors[index], None
        if executor is None:
            return
        for process in list((getattr(executor, "_processes", None) or {}).values()):
            process.kill()
        executor.shutdown(wait=False, cancel_futures=True)

    def _wind_down(self) -> None:
        for index, running in enumerate(self._slots):
            if running is not None:
                if running.future.done():
                    self._finish(index, running)
                else:
                    self._replace_executor(index)
                    hand_back(self.repo, running.claim, "its server stopped; queued again")
                    self._slots[index] = None
            else:
                self._replace_executor(index)


def cancel(session: Session, row: JobRow, kinds_abandon: Abandon | None, now: datetime) -> None:
    """Ask a job to stop; one that waits is over at once."""
    if row.state == "queued":
        row.cancel_requested = True
        _end(row, "cancelled", "cancelled before it began")
        if kinds_abandon is not None:
            kinds_abandon(session, row)
    elif row.state == "running" and not row.cancel_requested:
        row.cancel_requested = True
        row.revision += 1
        row.modified_utc = now


def requeue(row: JobRow) -> None:
    """Queue a job that ended without a result once more, with its attempts counted from zero."""
    row.state, row.attempt, row.cancel_requested = "queued", 0, False
    row.problem, row.finished_utc, row.progress, row.message = None, None, 0.0, "queued again"
    row.revision += 1
    _log(row, "queued again")
