"""Say whether everything a request needs is there."""

from __future__ import annotations

import os

from ground.gdr.migrate import current_revision, newest_revision
from ground.gdr.repository import Repository
from ground.jobs.worker import Worker

OK = "ok"
DEGRADED = "degraded: "
"""Begins the word of a part without which requests are answered all the same."""


def check_readiness(repo: Repository, worker: Worker | None = None) -> dict[str, str]:
    """Return `ok` or what is wrong for each part: database, schema, data folder, worker and engine."""
    repo.database.ping()
    found, needed = current_revision(repo.database), newest_revision()
    return {
        "database": "ok",
        "schema": "ok"
        if found == needed
        else f"the database is at revision {found or 'none'}, {needed} is needed: run `outcrop migrate`",
        **({} if worker is None else worker_checks(worker)),
        "data_dir": "ok" if os.access(repo.data_dir, os.W_OK) else f"{repo.data_dir} cannot be written",
    }


def worker_checks(worker: Worker) -> dict[str, str]:
    """Return how the worker of this process and its engine fare."""
    engine = worker.engine
    since = "" if engine.since_utc is None else f" since {engine.since_utc:%Y-%m-%dT%H:%M:%SZ}"
    return {
        "worker": OK if worker.alive else "its thread has ended",
        "engine": f"{DEGRADED}{engine.trouble}{since}, tried again" if engine.trouble else OK,
    }
