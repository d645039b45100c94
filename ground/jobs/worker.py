"""The worker: claims jobs and sees them through on executors."""

from __future__ import annotations

import contextlib
import json
import os
import random
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping, Set
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import select
from sqlalchemy.exc import OperationalError, SQLAlchemyError
from sqlalchemy.exc import TimeoutError as NoConnectionError

from ground.errors import BusyError, GroundError, JobFailedError
from ground.gdr.notices import WORK, Watch
from ground.gdr.repository import Repository
from ground.jobs.engine import EngineState, killed_its_workers, of_engine
from ground.jobs.executors import Done, _Channel, make_executor, run_work
from ground.jobs.leases import Held, LeaseKeeper
from ground.jobs.presence import Beat, Presence, utc_text
from ground.jobs.queue import (
    QUEUED,
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
    waiting,
)
from ground.jobs.row import JobRow
from ground.jobs.tally import Tally
from ground.settings import ExecutorKind
from ground.tracing import Attributes, now_ns, record, within

UNREACHABLE = (OperationalError, NoConnectionError, BusyError)
"""Of a database that is away, full, locked or in a deadlock: the same may go well in a moment."""


@dataclass(slots=True)
class _Running:
    claim: Claim
    future: Future[Done]
    channel: _Channel
    deadline: float
    renewed: float
    lease: Held
    began: float
    began_ns: int
    seen: tuple[float, str] = (0.0, "begun")
    stopping_since: float | None = None
    timed_out: bool = False
    told: bool = False
    """Whether the job's subject says that its work goes on, or has no need to."""
    rung: int = 0
    """How often the database had told of something when it was last asked whether this is to stop."""


class Worker:
    """Claims jobs and sees them through, each slot with an executor of its own that can be replaced.

    One slot takes interactive work only, so that long work cannot keep it waiting, and some take live runs,
    which keep nothing waiting. No error of an engine, a file or the database ends a worker: it says so, waits
    and tries again; a job whose engine failed is queued again and its attempt does not count, and what a job
    came to is kept until the database takes it.
    """

    GRACE_S = 15.0
    """For work that was asked to stop, to hand in what it has."""

    LOOK_S = 0.5

    TOLD_LOOK_S = 5.0
    """Where the database tells what waits and what is to stop: for leases that ran out, and words lost."""

    YOUNG_S = 0.5
    """Work tells no progress before: a dry run is over by then, and a row written costs a tenth of it."""

    CANCEL_S = 0.3
    """Least time between two looks whether a job is to stop."""

    SPREAD_S = 0.05
    """Workers that hear of one job look within so long of each other: a claim takes 5 to 10 ms, and who comes
    after it asks one question instead of claiming in vain. Of three the first looks after 12 ms in the mean.
    """

    LIVE_SLOTS = 4
    """Rovers that a control room has in hand at once; a slot that waits has no process."""

    RETRY_S = (0.5, 10.0)
    """First and longest wait before an engine that failed is tried again."""

    def __init__(self, repo: Repository, kinds: Mapping[str, JobKind], *, slots: int | None = None) -> None:
        self.repo, self.kinds = repo, dict(kinds)
        self.name = f"{socket.gethostname()}:{os.getpid()}"
        live = {name: kind for name, kind in self.kinds.items() if kind.live}
        usual = {name: kind for name, kind in self.kinds.items() if not kind.live}
        interactive = {name: kind for name, kind in usual.items() if kind.interactive}
        lanes = ((usual, slots or repo.settings.workers), (interactive, 1), (live, self.LIVE_SLOTS))
        self._kinds_of = [kinds for kinds, count in lanes if kinds for _ in range(count)]
        """What each slot takes."""
        self._slots: list[_Running | None] = [None] * len(self._kinds_of)
        self._leases = LeaseKeeper(repo)
        self.engine = EngineState()
        self._executors: list[Executor | None] = [None] * len(self._slots)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self.folder = repo.job_dir()
        self._beat = Beat(self.folder)
        self._tally = Tally()
        self._look_at = 0.0
        """When jobs are looked for again: at once when one was queued or a slot became free."""
        self._more = True
        """Whether jobs may wait that were not taken when they were last looked for."""
        self._rung = 0
        """How often the database has told that a job waits or is to stop."""
        self._over = False
        """Whether work has ended that nobody has looked at."""
        self._heard = 0
        """How much of that has been heeded."""
        self._bell: Watch | None = None
        if not repo.database.is_sqlite:
            self._bell = Watch(repo.database.url, self._told, lambda: True, wait_s=0.5, channel=WORK)

    # ---- life

    def start(self, warm_up: Callable[[], None] | None = None) -> None:
        """Begin to look for jobs, in a thread; the first process runs `warm_up` until it has one."""
        if warm_up is not None and self.repo.settings.executor is ExecutorKind.PROCESS and self._ready(0):
            executor = self._executors[0]
            assert executor is not None
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
        try:
            if self._bell is not None:
                self._bell.poke()
            if self.repo.settings.executor is ExecutorKind.DISTRIBUTED:
                self._ready(0)  # a cluster that is away is told before a job waits for it
            while not self._stop.is_set():
                try:
                    self.folder.mkdir(parents=True, exist_ok=True)
                    busy = self.step()
                    self._beat.say(self._presence(), self._tally.text)
                except (SQLAlchemyError, BusyError):
                    logger.exception("the worker cannot reach the database")
                    busy = False
                    self._stop.wait(1.0)
                except Exception:  # noqa: BLE001 - a full disk, a lost folder: no reason to leave the other jobs alone
                    logger.exception("the worker met an error and goes on")
                    busy = False
                    self._stop.wait(1.0)
                if WAKE.wait(0.05 if busy else self._rest_s()):
                    WAKE.clear()
                    self._woken()
        finally:
            if self._bell is not None:
                self._bell.stop()
            self._beat.leave()
            self._wind_down()

    def _woken(self) -> None:
        """See when jobs are to be looked for: soon where one was queued, not because work is over."""
        told, self._heard = self._rung != self._heard, self._rung
        over, self._over = self._over, False
        if told:
            self._look_at = time.monotonic() + random.uniform(0.0, self.SPREAD_S)
        elif not over:
            self._look_at = 0.0

    def _work_over(self, _future: Future[Done]) -> None:
        self._over = True
        WAKE.set()

    def _rest_s(self) -> float:
        """Return how long an idle worker sleeps; a cluster and an engine that failed are looked after."""
        told = self._bell is not None and self.repo.settings.executor is not ExecutorKind.DISTRIBUTED
        if not told or self.engine.trouble:
            return self.LOOK_S
        return max(0.0, min(self.TOLD_LOOK_S / 2, self._look_at - time.monotonic()))

    def _told(self, topics: Set[str] | None) -> None:
        if topics is None or QUEUED in topics:
            self._rung += 1
            WAKE.set()

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
        """Attend to what runs, claim what there is room for; return whether anything runs."""
        self._look_after_engine()
        for index, running in enumerate(self._slots):
            if running is not None:
                self._attend(index, running)
        if time.monotonic() >= self._look_at:
            told = self._bell is not None and not self.engine.trouble
            self._look_at = time.monotonic() + (self.TOLD_LOOK_S if told else self.LOOK_S)
            self._claim()
        return any(r is not None for r in self._slots)

    # ---- parts

    def _claim(self) -> int:
        count = 0
        full, self._more = None not in self._slots, True
        there = Counter[str]() if full else waiting(self.repo, self.kinds)
        for index, running in enumerate(self._slots):
            kinds = self._kinds_of[index]
            if running is not None or not any(there[kind] > 0 for kind in kinds):
                continue
            if not self._ready(index):
                break
            claim = claim_job(self.repo, kinds, self.name, self._lease_lost)
            if claim is None:  # another worker was first: nothing is left for a slot of the same kinds either
                for kind in kinds:
                    there[kind] = 0
                continue
            there[claim.kind] -= 1
            with within(claim.traceparent):
                taken = self._begin(index, claim)
            if taken:
                count += 1
                begun = self._slots[index]
                if (
                    begun is not None and begun.future.done()
                ):  # work in this process: over before the next begins
                    self._finish(index, begun)
        self._more = full or there.total() > 0
        return count

    def _lease_lost(self, kind: str) -> None:
        self._tally[kind].leases_lost += 1

    def _ready(self, index: int) -> bool:
        """Return whether a slot has an executor, making one if it is time to try."""
        if self._executors[index] is not None:
            return True
        if time.monotonic() < self.engine.retry_at:
            return False
        try:
            self._executors[index] = make_executor(self.repo.settings)
        except Exception as err:  # noqa: BLE001 - whatever an engine's library raises when it is not there
            self._engine_failed(err)
            return False
        self._engine_well()
        return True

    def _look_after_engine(self) -> None:
        """Notice a cluster that is lost while nothing runs, or there again while nothing waits."""
        idle = [index for index, running in enumerate(self._slots) if running is None]
        for index in idle:
            if getattr(self._executors[index], "lost", False):
                self._engine_failed(ConnectionError("the connection to the Dask scheduler was lost"))
                self._replace_executor(index)
        if self.engine.trouble and idle:
            empty = [index for index in idle if self._executors[index] is None]
            if not empty:
                self._engine_well()
            else:
                self._ready(empty[0])

    def _engine_failed(self, err: BaseException) -> None:
        riddle = not self.engine.trouble and not isinstance(err, OSError | CancelledError)
        self.engine = self.engine.failed(err, *self.RETRY_S)
        told = {"executor": str(self.repo.settings.executor), "why": self.engine.trouble}
        logger.error("the engine failed", extra=told, exc_info=err if riddle else None)

    def _engine_well(self) -> None:
        if self.engine.trouble:
            logger.warning("the engine is there again", extra={"failures": self.engine.failures})
            self.engine = EngineState(failures=self.engine.failures)

    @property
    def alive(self) -> bool:
        """Return whether the thread that `start` began still looks for jobs."""
        return self._thread is None or self._thread.is_alive()

    def _presence(self) -> Presence:
        running = sum(slot is not None for slot in self._slots)
        executor = self.repo.settings.executor.value
        return Presence(self.name, executor, running, self.engine.trouble, utc_text(self.engine.since_utc))

    def _begin(self, index: int, claim: Claim) -> bool:
        """Send a job to the slot's executor; return whether it was taken. If not, the job waits again.

        Work of an attempt before may go on where nobody hears of it, its worker killed or its scheduler lost:
        it is asked to stop, so that two do not write one folder.
        """
        channel = _Channel(str(self.folder), f"{claim.job_id}-{claim.token}")
        if claim.token > 1:
            self._call_off(f"{claim.job_id}-{claim.token - 1}")
        now, began_ns = time.monotonic(), now_ns()
        kind = self.kinds[claim.kind]
        logger.info("job begun", extra={"job_id": claim.job_id, "kind": claim.kind, "attempt": claim.attempt})
        lease = self._leases.hold(claim)
        try:
            future = self._sent(index, kind, claim, channel)
        except Exception as err:  # noqa: BLE001 - whatever an engine's library raises: the work has not begun
            self._engine_failed(err)
            self._replace_executor(index)
            self._leases.release(lease)
            hand_back(
                self.repo, claim, f"its engine failed ({self.engine.trouble}); queued again", tried=False
            )
            return False
        self._tally[claim.kind].attempts += 1
        future.add_done_callback(self._work_over)
        told = kind.lasts is None or self.repo.settings.executor is ExecutorKind.INLINE
        self._slots[index] = _Running(
            claim, future, channel, now + claim.time_limit_s, now, lease, now, began_ns, told=told
        )
        return True

    def _sent(self, index: int, kind: JobKind, claim: Claim, channel: _Channel) -> Future[Done]:
        for last in (False, True):
            executor = self._executors[index] or make_executor(self.repo.settings)
            self._executors[index] = executor
            try:
                given = (claim.payload, channel.folder, channel.name, claim.traceparent)
                return executor.submit(run_work, kind.work, kind.orders, *given)
            except BrokenExecutor:  # the process died while it had nothing to do
                self._replace_executor(index)
                if last:
                    raise
        raise AssertionError("unreachable")

    def _attend(self, index: int, running: _Running) -> None:
        now = time.monotonic()
        if running.future.done():
            self._finish(index, running)
            return
        seen = self._progress(running)
        if not running.lease.ours and running.stopping_since is None:
            self._ask_to_stop(running)
        news = seen != running.seen or not running.told
        if news and now - running.began >= self.YOUNG_S:
            lasts = None if running.told else self.kinds[running.claim.kind].lasts
            ours, cancel = renew(self.repo, running.claim, *seen, lasts)
            running.seen, running.renewed, running.told = seen, now, True
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
        told = self._bell is not None and running.rung == self._rung
        if now - running.renewed < (self.TOLD_LOOK_S if told else self.CANCEL_S):
            return False
        running.renewed, running.rung = now, self._rung
        with self.repo.database.read() as session:
            return bool(
                session.scalar(select(JobRow.cancel_requested).where(JobRow.id == running.claim.job_id))
            )

    def _ask_to_stop(self, running: _Running) -> None:
        running.stopping_since = time.monotonic()
        self._call_off(running.channel.name)

    def _call_off(self, name: str) -> None:
        try:
            (self.folder / f"{name}.stop").touch()
        except OSError:
            logger.exception("work cannot be asked to stop; its process is ended instead")

    def _progress(self, running: _Running) -> tuple[float, str]:
        path = Path(running.channel.folder) / f"{running.channel.name}.progress"
        try:
            progress, message = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return running.seen
        return float(progress), str(message)

    def _finish(self, index: int, running: _Running) -> None:
        """End a job and free its slot.

        Where the database does not answer, slot and lease stay as they are, and it is tried again.
        """
        with within(running.claim.traceparent):
            self._conclude(index, running)
        done = _done(running.future)
        _trace(running, done, "" if done else "it has no result")
        took_s = time.monotonic() - running.began
        self._tally[running.claim.kind].ended(took_s, 0 if done is None else done.peak_bytes)
        self._slots[index] = None
        if self._more or self._bell is None:  # else whatever came since was told
            self._look_at = 0.0
        self._leases.release(running.lease)
        for suffix in ("progress", "stop", "draft"):
            with contextlib.suppress(OSError):
                (Path(running.channel.folder) / f"{running.channel.name}.{suffix}").unlink(missing_ok=True)

    def _conclude(self, index: int, running: _Running) -> None:
        """Write down what a job came to."""
        claim, kind = running.claim, self.kinds[running.claim.kind]
        try:
            error = running.future.exception()
        except CancelledError as err:
            error = err
        try:
            if error is None:
                settle(self.repo, kind, claim, running.future.result().result)
            elif running.timed_out:
                detail = f"stopped: the time limit of {claim.time_limit_s:g} s is over"
                give_up(self.repo, kind, claim, "failed", detail, problem_of(JobFailedError(detail)))
            elif running.stopping_since is not None:
                give_up(self.repo, kind, claim, "cancelled", "cancelled", None)
            elif isinstance(error, BrokenExecutor):
                self._replace_executor(index)
                hand_back(self.repo, claim, "its process died; queued again")
            elif killed_its_workers(error):
                hand_back(self.repo, claim, "the cluster's workers died while doing it; queued again")
            elif of_engine(error):
                self._engine_failed(error)
                self._replace_executor(index)
                why = f"its engine failed ({self.engine.trouble}); queued again"
                hand_back(self.repo, claim, why, tried=False)
            else:
                problem = problem_of(error)
                if not isinstance(error, GroundError):
                    logger.error("job failed", exc_info=error, extra={"job_id": claim.job_id})
                give_up(self.repo, kind, claim, "failed", problem["detail"], problem)
        except UNREACHABLE:
            raise
        except GroundError as err:
            give_up(self.repo, kind, claim, "failed", err.message, problem_of(err))
        except Exception as err:  # noqa: BLE001 - one job's result must not end the worker
            logger.exception("the result of a job cannot be written", extra={"job_id": claim.job_id})
            give_up(self.repo, kind, claim, "failed", problem_of(err)["detail"], problem_of(err))

    def _replace_executor(self, index: int) -> None:
        """End the processes of a slot, whatever they are doing."""
        executor, self._executors[index] = self._executors[index], None
        if executor is None:
            return
        for process in list((getattr(executor, "_processes", None) or {}).values()):
            process.kill()
        try:
            executor.shutdown(wait=False, cancel_futures=True)
        except Exception:  # noqa: BLE001 - a lost connection cannot be ended in order
            logger.exception("an executor did not end in order")

    def _wind_down(self) -> None:
        for index, running in enumerate(self._slots):
            try:
                if running is None:
                    self._replace_executor(index)
                elif running.future.done():
                    self._finish(index, running)
                else:
                    self._leases.release(running.lease)
                    self._replace_executor(index)
                    hand_back(self.repo, running.claim, "its server stopped; queued again")
                    _trace(running, None, "its server stopped")
                    self._slots[index] = None
            except UNREACHABLE:
                logger.exception("a job stays claimed until its lease runs out")
                self._replace_executor(index)


def _done(future: Future[Done]) -> Done | None:
    """Return what work came to; None where it has no result."""
    return None if future.cancelled() or future.exception() is not None else future.result()


def _trace(running: _Running, done: Done | None, fault: str) -> None:
    """Make the spans of an attempt that ended, without a result by some `fault`, and of its work."""
    claim = running.claim
    told: Attributes = {"outcrop.job.id": claim.job_id, "outcrop.job.attempt": claim.attempt}
    job = record(f"job {claim.kind}", claim.traceparent, running.began_ns, now_ns(), told, fault)
    if done is not None:
        where: Attributes = {"outcrop.work.place": done.place, "outcrop.work.peak_bytes": done.peak_bytes}
        work = record(f"work {claim.kind}", job, done.began_ns, done.ended_ns, where)
        for part in done.parts:
            record(part.name, work, part.began_ns, part.ended_ns, {"outcrop.work.place": part.place})
