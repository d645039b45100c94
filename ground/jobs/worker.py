"""The worker: claims jobs and sees them through on executors."""

from __future__ import annotations

import json
import os
import socket
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError

from ground.errors import GroundError, JobFailedError
from ground.gdr.repository import Repository
from ground.jobs.executors import _Channel, make_executor, run_work
from ground.jobs.queue import (
    WAKE,
    Claim,
    JobKind,
    claim_job,
    give_up,
    hand_back,
    logger,
    problem_of,
    renew,
    settle,
)
from ground.jobs.row import JobRow
from ground.settings import ExecutorKind


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
                future = executor.submit(
                    run_work, kind.work, kind.orders, claim.payload, channel.folder, channel.name
                )
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
        except Exception as err:  # noqa: BLE001 - one job's result must not end the worker
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
