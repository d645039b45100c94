"""Long work as rows with a lease, and the worker that does it on an Executor.

A job is committed together with the request that made it. A worker claims it with a lease and a fencing
token that grows by one with each claim; it renews the lease while the work goes on, and its result is
written only if the token is still the newest one, in the same transaction as everything that the result
changes. So a worker that dies loses nothing (the lease runs out and any other takes the job up) and one
that was merely slow doubles nothing.

The work itself is a pure function `work(order, report, should_stop)` on a `concurrent.futures.Executor`; the
order is a frozen value that stands in the row as its codec writes it.
It may be in another process or on another host; word of its progress goes through a small file in the data
folder.
"""

from __future__ import annotations

import logging
import threading
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import cache
from typing import Any, TypedDict

from sqlalchemy import ColumnElement, Select, and_, bindparam, case, event, func, or_, select
from sqlalchemy.orm import Session, aliased, defer

from ground.errors import GroundError, JobFailedError
from ground.extras import missing_extra
from ground.gdr.base import utc_now
from ground.gdr.ids import new_id
from ground.gdr.notices import WORK, tell
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.settings import ExecutorKind, Settings
from ground.tracing import TRACEPARENT
from mission.codec import Codec, Document

logger = logging.getLogger(__name__)


Report = Callable[[float, str], None]


ShouldStop = Callable[[], bool]


Work = Callable[[Any, Report, ShouldStop], Mapping[str, object]]


Settle = Callable[[Repository, Session, JobRow, Any], str | None]


Abandon = Callable[[Session, JobRow], None]


LOG_LINES = 200


ENGINE_FAILURES = 20
"""Attempts that an engine may lose without their counting; at the worker's longest wait, three minutes.

An engine that is away is not asked at all; one that is there and loses the same job again and again loses it
because of the job.
"""


WAKE = threading.Event()
"""Set when a job was queued in this process, so that its worker need not wait for the next look."""

QUEUED = "jobs"
"""What the database tells when a job was queued or is to stop, so that no worker elsewhere need wait."""


def wake_after(session: Session) -> None:
    """Wake the workers as soon as the transaction is committed: one waits, or one is to stop."""
    tell(session, QUEUED, WORK)
    event.listen(session, "after_commit", lambda _session: WAKE.set())


class WorkStoppedError(Exception):
    """Raised by work that was asked to stop and did."""


class JobProblem(TypedDict):
    """Why a job failed, as a problem document (RFC 9457)."""

    type: str
    title: str
    status: int
    detail: str


def _nothing(_session: Session, _row: JobRow) -> None:
    """Leave the subject as it is: without a result."""


@dataclass(frozen=True, slots=True)
class JobKind:
    """One kind of long work.

    `orders` reads what stands in the job's row. `work` must be importable by name (it is sent to another
    process). `settle` writes the result into the repository and returns its address; `abandon` is called when
    the job ends without a result, `begin` when a worker takes it up, and may complete the order, `lasts` when
    the work is no longer young: what is over before need not say that it goes on. `interactive` work is short
    and somebody waits for it: it goes before all other and has a slot of its own. `live` work runs on the
    real clock, for hours, and mostly waits: it has slots of its own and takes nobody's.
    """

    name: str
    orders: Codec[Any]
    work: Work
    settle: Settle
    abandon: Abandon = _nothing
    begin: Abandon | None = None
    lasts: Abandon | None = None
    interactive: bool = False
    live: bool = False


def enqueue(
    session: Session,
    settings: Settings,
    *,
    kind: str,
    mission_id: str | None,
    subject_kind: str,
    subject_id: str,
    payload: Mapping[str, object],
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
        traceparent=TRACEPARENT.get() or None,
    )
    session.add(row)
    session.flush()
    wake_after(session)
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
    traceparent: str = ""


def _unheard(_kind: str) -> None:
    """Count nothing."""


def _log(row: JobRow, text: str) -> None:
    row.log = [*row.log, {"at_utc": utc_now().isoformat(), "text": text}][-LOG_LINES:]


def _end(row: JobRow, state: str, message: str, problem: Document | None = None) -> None:
    row.state, row.message, row.problem = state, message, None if problem is None else dict(problem)
    row.finished_utc, row.lease_until_utc = utc_now(), None
    row.revision += 1
    row.modified_utc = utc_now()
    _log(row, message or state)


def claim_job(
    repo: Repository, kinds: Mapping[str, JobKind], worker: str, lost: Callable[[str], None] = _unheard
) -> Claim | None:
    """Return the next job that waits or whose lease has run out, now leased to `worker`; None without one.

    Interactive work comes first, then missions take turns: the one with the fewest jobs running, and of its
    jobs the oldest.

    A job that was begun too often is ended as failed; one that was to be cancelled is cancelled. `lost` is
    told the kind of each whose lease had run out.
    """
    with repo.database.write() as session:
        while True:
            now = utc_now()
            row = session.scalars(_first(*_names(kinds)), {"now": now}).first()
            if row is None:
                return None
            if row.state == "running":
                lost(row.kind)
            if row.cancel_requested:
                _end(row, "cancelled", "cancelled before it began")
                kinds[row.kind].abandon(session, row)
                session.flush()
                continue
            if row.attempt >= row.max_attempts:
                last = "its worker vanished" if row.state == "running" else row.message
                detail = f"given up: it was begun {row.attempt} times; the last time: {last}"
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
            kind = kinds[row.kind]
            here = repo.settings.executor is ExecutorKind.INLINE  # nobody attends while it goes on
            for heed in (kind.begin, kind.lasts if here else None):
                if heed is not None:
                    heed(session, row)
            order, trace = dict(row.payload), row.traceparent or ""
            return Claim(row.id, row.kind, row.token, row.attempt, order, row.time_limit_s, trace)


def waiting(repo: Repository, kinds: Mapping[str, JobKind]) -> Counter[str]:
    """Return how many jobs of each kind are there to be claimed."""
    with repo.database.connection() as reader:  # a transaction round it would cost more than the answer
        return Counter(dict(reader.execute(_waiting(_names(kinds)[0]), {"now": utc_now()}).all()))


def _names(kinds: Mapping[str, JobKind]) -> tuple[frozenset[str], frozenset[str]]:
    """Return the names of kinds, and of those that are interactive."""
    return frozenset(kinds), frozenset(kind.name for kind in kinds.values() if kind.interactive)


# A statement takes longer to put together than to carry out, and workers ask these two all day.


@cache
def _waiting(kinds: frozenset[str]) -> Select[str, int]:
    return select(JobRow.kind, func.count()).where(_claimable(kinds)).group_by(JobRow.kind)


@cache
def _first(kinds: frozenset[str], interactive: frozenset[str]) -> Select[JobRow]:
    query = select(JobRow).where(_claimable(kinds)).order_by(*_turn(interactive)).limit(1)
    return query.with_for_update(skip_locked=True, of=JobRow)


def _claimable(kinds: frozenset[str]) -> ColumnElement[bool]:
    over = and_(JobRow.state == "running", JobRow.lease_until_utc < bindparam("now"))
    return and_(JobRow.kind.in_(sorted(kinds)), or_(JobRow.state == "queued", over))


def turn(kinds: Mapping[str, JobKind]) -> tuple[ColumnElement[Any], ...]:
    """Return the order in which waiting jobs are taken."""
    return _turn(_names(kinds)[1])


def _turn(interactive: frozenset[str]) -> tuple[ColumnElement[Any], ...]:
    other = aliased(JobRow)
    running = (
        select(func.count())
        .select_from(other)
        .where(other.state == "running", other.mission_id == JobRow.mission_id, other.id != JobRow.id)
        .scalar_subquery()
    )
    return case((JobRow.kind.in_(sorted(interactive)), 0), else_=1), running, JobRow.id.expression


def extend(repo: Repository, claim: Claim) -> tuple[bool, bool]:
    """Renew the lease; return (still ours, cancel wanted)."""
    with repo.database.write() as session:
        row = _ours(session, claim)
        if row is None:
            return False, True
        row.lease_until_utc = utc_now() + timedelta(seconds=repo.settings.job_lease_s)
        return True, row.cancel_requested


def renew(
    repo: Repository, claim: Claim, progress: float, message: str, lasts: Abandon | None = None
) -> tuple[bool, bool]:
    """Renew the lease and note the progress; return (still ours, cancel wanted).

    `lasts` is called with it: the first progress says on the subject that its work goes on.
    """
    with repo.database.write() as session:
        row = _ours(session, claim)
        if row is None:
            return False, True
        if lasts is not None:
            lasts(session, row)
        row.lease_until_utc = utc_now() + timedelta(seconds=repo.settings.job_lease_s)
        progress = min(1.0, max(row.progress, progress))
        if (progress, message) != (row.progress, row.message):
            if message != row.message:
                _log(row, message)
            row.progress, row.message = progress, message
            row.revision += 1
        return True, row.cancel_requested


def _ours(session: Session, claim: Claim) -> JobRow | None:
    ours = JobRow.id == claim.job_id, JobRow.token == claim.token, JobRow.state == "running"
    order_unread = defer(JobRow.payload)  # it holds the whole day, and the claim has it
    return session.scalars(select(JobRow).where(*ours).options(order_unread).with_for_update()).first()


def settle(repo: Repository, kind: JobKind, claim: Claim, result: Mapping[str, object]) -> bool:
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
        _end(row, "succeeded", str(result.get("stopped") or "done"))
        return True


def give_up(
    repo: Repository,
    kind: JobKind,
    claim: Claim,
    state: str,
    message: str,
    problem: Mapping[str, object] | None,
) -> bool:
    """End a job without a result if the claim still holds; return whether it did."""
    with repo.database.write() as session:
        row = _ours(session, claim)
        if row is None:
            return False
        _end(row, state, message, problem)
        kind.abandon(session, row)
        return True


def hand_back(repo: Repository, claim: Claim, reason: str, *, tried: bool = True) -> None:
    """Queue a job again whose worker process died or is about to stop.

    Without `tried` the attempt does not count: the engine failed, not the work. That holds for
    `ENGINE_FAILURES` of them.
    """
    with repo.database.write() as session:
        row = _ours(session, claim)
        if row is not None:
            lost = row.token - row.attempt
            row.attempt -= 0 if tried or lost >= ENGINE_FAILURES else 1
            row.state, row.lease_until_utc, row.message = "queued", None, reason
            row.revision += 1
            _log(row, reason)
            wake_after(session)


def problem_of(error: BaseException) -> JobProblem:
    """Return the problem document of work that failed."""
    if isinstance(error, GroundError):
        kind, detail = str(error.extra.get("type", "job-failed")), error.message
    elif isinstance(error, ModuleNotFoundError) and (told := missing_extra(error)):
        kind, detail = "job-failed", told
    else:
        kind, detail = "internal-error", f"{type(error).__name__}: {error}"
    return {
        "type": f"urn:outcrop:problem:{kind}",
        "title": "The work ended without a result",
        "status": 422,
        "detail": detail,
    }


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
    row.traceparent = TRACEPARENT.get() or None
    row.revision += 1
    _log(row, "queued again")
