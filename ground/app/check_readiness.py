"""Say whether everything a request needs is there."""

from __future__ import annotations

import os
from datetime import timedelta

from sqlalchemy import select

from ground.gdr.base import utc_now
from ground.gdr.migrate import current_revision, newest_revision
from ground.gdr.repository import Repository
from ground.jobs.presence import present
from ground.jobs.row import JobRow
from ground.jobs.worker import Worker

OK = "ok"
DEGRADED = "degraded: "
"""Begins the word of a part without which requests are answered all the same."""


def check_readiness(repo: Repository, worker: Worker | None = None) -> dict[str, str]:
    """Return `ok` or what is wrong for each part: database, schema, folder, object store, worker and engine.

    Workers of other processes say themselves how they fare (`ground.jobs.presence`).
    """
    repo.database.ping()
    return {
        "database": "ok",
        "schema": _schema(repo),
        **({} if worker is None else worker_checks(worker)),
        **other_workers(repo, worker),
        **_objects(repo),
        "data_dir": "ok" if os.access(repo.data_dir, os.W_OK) else f"{repo.data_dir} cannot be written",
    }


def _schema(repo: Repository) -> str:
    """Return how schema and program agree.

    While a deployment goes on, servers of the version before answer on the new schema: a migration only adds
    what they do not need to know (`tests/ground/test_rolling_upgrade.py`).
    """
    found, needed = current_revision(repo.database), newest_revision()
    if found == needed:
        return OK
    if found is not None and found > needed:
        return (
            f"{DEGRADED}the database is at revision {found}, newer than this program's {needed}: upgrade it"
        )
    return f"the database is at revision {found or 'none'}, {needed} is needed: run `outcrop migrate`"


def _objects(repo: Repository) -> dict[str, str]:
    """Return how the object store fares; nothing where a disk keeps the files."""
    if repo.files.store.is_local:
        return {}
    trouble = repo.files.store.trouble()
    return {"files": f"{DEGRADED}{trouble}" if trouble else OK}


def worker_checks(worker: Worker) -> dict[str, str]:
    """Return how the worker of this process and its engine fare."""
    engine = worker.engine
    since = "" if engine.since_utc is None else f" since {engine.since_utc:%Y-%m-%dT%H:%M:%SZ}"
    return {
        "worker": OK if worker.alive else "its thread has ended",
        "engine": f"{DEGRADED}{engine.trouble}{since}, tried again" if engine.trouble else OK,
    }


UNCLAIMED = timedelta(seconds=10)
"""A worker that is there takes a job within a second, or is busy with others."""


def other_workers(repo: Repository, own: Worker | None) -> dict[str, str]:
    """Return how the workers of other processes fare, under `workers`; nothing where nobody misses them."""
    others = [p for p in present(repo.job_dir()) if own is None or p.name != own.name]
    troubles = [f"{p.name}: {p.told()}" for p in others if p.trouble]
    if troubles:
        return {"workers": DEGRADED + "; ".join(troubles)}
    if others:
        return {"workers": OK}
    if own is None:
        with repo.database.read() as session:
            waiting = select(JobRow.id).where(
                JobRow.state == "queued", JobRow.created_utc < utc_now() - UNCLAIMED
            )
            if session.scalar(waiting.limit(1)) is not None:
                return {"workers": f"{DEGRADED}jobs wait and no worker is there: start `outcrop worker`"}
    return {}
