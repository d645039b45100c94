"""Read how the service fares now."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from datetime import datetime, timedelta
from heapq import nlargest

from sqlalchemy import Select, case, func, select
from sqlalchemy.orm import Session

from ground.gdr.base import utc_now
from ground.gdr.history import ChainRow
from ground.gdr.repository import Repository
from ground.jobs.presence import heard
from ground.jobs.queue import JobKind, turn
from ground.jobs.row import JobRow
from ground.jobs.value import JobState
from ground.records.actor import Action, Actor
from ground.resources.missions.row import MissionRow
from ground.resources.operations.value import Backlog, Disk, JobGlance, ServiceStatus, Upkeep, WorkerGlance
from ground.resources.products.row import ProductRow
from ground.resources.upkeep.noted import ACTS, noted
from ground.resources.upkeep.store_size import StoreSize

SHOWN = 50
SLOWEST = 10
LATELY = timedelta(days=7)
NEWEST = 5_000
"""Jobs among which the slowest are looked for, so that the answer costs the same in a busy week."""


def read_operations(
    repo: Repository, actor: Actor, kinds: Mapping[str, JobKind], store: StoreSize
) -> ServiceStatus:
    """Return workers, queue, slowest jobs, disk and upkeep of the service, for an administrator."""
    actor.require(Action.ADMINISTER)
    now = utc_now()
    with repo.database.read() as session:
        products = session.scalar(select(func.sum(ProductRow.size_bytes))) or 0
        disk = shutil.disk_usage(repo.data_dir)
        return ServiceStatus(
            at_utc=now,
            executor=repo.settings.executor.value,
            workers=[
                WorkerGlance(p.name, p.executor, p.running, round(age_s, 1), p.told() if p.trouble else "")
                for p, age_s in heard(repo.job_dir())
            ],
            backlog=_backlog(session),
            running=_running(session, now),
            waiting=_waiting(session, kinds, now),
            slowest=_slowest(session, now),
            disk=Disk(disk.free, disk.total, store.known(), int(products), repo.database.size_bytes()),
            upkeep=[Upkeep(act, *(noted(repo, act) or (None, None))) for act in ACTS],
            history_events=int(session.scalar(select(func.sum(ChainRow.seq))) or 0),
        )


def _backlog(session: Session) -> list[Backlog]:
    waiting = func.sum(case((JobRow.state == "queued", 1), else_=0))
    query = (
        select(JobRow.kind, JobRow.mission_id, MissionRow.name, waiting, func.count())
        .outerjoin(MissionRow, MissionRow.id == JobRow.mission_id)
        .where(JobRow.state.in_(("queued", "running")))
        .group_by(JobRow.kind, JobRow.mission_id, MissionRow.name)
        .order_by(waiting.desc(), JobRow.kind, MissionRow.name)
    )
    return [
        Backlog(kind, mission, name or "", int(queued), int(count - queued))
        for kind, mission, name, queued, count in session.execute(query)
    ]


def _with_mission() -> Select[JobRow, str]:
    return select(JobRow, MissionRow.name).outerjoin(MissionRow, MissionRow.id == JobRow.mission_id)


def _running(session: Session, now: datetime) -> list[JobGlance]:
    query = _with_mission().where(JobRow.state == "running").order_by(JobRow.started_utc).limit(SHOWN)
    return [_glance(row, name, now - (row.started_utc or now)) for row, name in session.execute(query)]


def _waiting(session: Session, kinds: Mapping[str, JobKind], now: datetime) -> list[JobGlance]:
    """Return the jobs that wait, in the order in which they would be begun now."""
    query = _with_mission().where(JobRow.state == "queued").order_by(*turn(kinds)).limit(SHOWN)
    found = enumerate(session.execute(query), start=1)
    return [_glance(row, name, now - row.created_utc, position) for position, (row, name) in found]


def _slowest(session: Session, now: datetime) -> list[JobGlance]:
    query = (
        select(JobRow.id, JobRow.started_utc, JobRow.finished_utc)
        .where(JobRow.finished_utc > now - LATELY)
        .order_by(JobRow.finished_utc.desc())
        .limit(NEWEST)
    )
    took = {
        name: ended - begun
        for name, begun, ended in session.execute(query)
        if begun is not None and ended is not None
    }
    worst = nlargest(SLOWEST, took, key=lambda id_: took[id_])
    rows = {row.id: (row, name) for row, name in session.execute(_with_mission().where(JobRow.id.in_(worst)))}
    return [_glance(*rows[id_], took[id_]) for id_ in worst]


def _glance(row: JobRow, mission: str | None, took: timedelta, position: int | None = None) -> JobGlance:
    return JobGlance(
        id=row.id,
        kind=row.kind,
        state=JobState(row.state),
        mission_id=row.mission_id,
        mission_name=mission or "",
        position=position,
        took_s=round(took.total_seconds(), 1),
        attempt=row.attempt,
        progress=row.progress,
        message=row.message,
        worker=row.worker,
    )
