"""Ask for long work, in the transaction that files what it is about."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy.orm import Session

from ground.gdr.repository import Repository
from ground.jobs.kind import JOB
from ground.jobs.queue import enqueue
from ground.jobs.value import Job
from ground.records.actor import Actor
from ground.records.kind import Kind


def ask_job(
    session: Session,
    repo: Repository,
    actor: Actor,
    kind: str,
    mission_id: str,
    subject: tuple[Kind[Any], str],
    payload: Mapping[str, object],
    job_id: str | None = None,
    time_limit_s: float | None = None,
) -> Job:
    """Return the queued job, whose `subject` is a resource of a kind; `payload` is its order, written."""
    subject_kind, subject_id = subject
    row = enqueue(
        session,
        repo.settings,
        kind=kind,
        mission_id=mission_id,
        subject_kind=subject_kind.name,
        subject_id=subject_id,
        payload=payload,
        author=actor.name,
        job_id=job_id,
    )
    if time_limit_s is not None:
        row.time_limit_s = time_limit_s
    return JOB.show_one(session, row)
