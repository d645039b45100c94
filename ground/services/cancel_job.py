"""Cancel a job, or queue one again that ended without a result."""

from __future__ import annotations

from sqlalchemy.orm import Session

from ground import jobs
from ground.errors import StateError
from ground.gdr import models as m
from ground.gdr import values as v
from ground.gdr.models import utc_now
from ground.gdr.repository import Repository
from ground.services.actor import SYSTEM_ACTOR, Action, Actor
from ground.services.edit import update
from ground.services.get_resource import find_row
from ground.services.kinds import KINDS
from ground.services.views import show_jobs


def cancel_job(repo: Repository, actor: Actor, job_id: str) -> v.Job:
    """Return the job, asked to stop; one that is over stays as it is."""
    with repo.database.write() as session:
        row = find_row(session, KINDS["job"], job_id, lock=True)
        actor.require(Action.PLAN, row.mission_id)
        jobs.cancel(session, row, mark_subject, utc_now())
        session.flush()
        value = show_jobs(session, [row])[0]
    jobs.WAKE.set()
    return value


def retry_job(repo: Repository, actor: Actor, job_id: str) -> v.Job:
    """Return the job, queued again.

    Raises
    ------
    StateError
        If it did not end without a result.
    """
    with repo.database.write() as session:
        row = find_row(session, KINDS["job"], job_id, lock=True)
        actor.require(Action.PLAN, row.mission_id)
        if row.state not in {"failed", "cancelled"}:
            raise StateError(f"job {job_id} is {row.state}; only a failed or cancelled one is queued again")
        jobs.requeue(row)
        mark_subject(session, row)
        session.flush()
        value = show_jobs(session, [row])[0]
    jobs.WAKE.set()
    return value


def mark_subject(session: Session, job: m.JobRow) -> None:
    """Let the run that a job is about have the job's state."""
    run = session.get(m.RunRow, job.subject_id) if job.subject_kind == "run" else None
    if run is not None:
        update(session, SYSTEM_ACTOR, KINDS["run"], run, {"state": job.state}, action="run")
