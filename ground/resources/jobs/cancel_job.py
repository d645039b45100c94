"""Cancel a job, or queue one again that ended without a result."""

from __future__ import annotations

from sqlalchemy.orm import Session

from ground.errors import StateError
from ground.gdr.base import utc_now
from ground.gdr.repository import Repository
from ground.jobs.kind import JOB
from ground.jobs.queue import cancel, requeue, wake_after
from ground.jobs.row import JobRow
from ground.jobs.value import Job
from ground.records.actor import SYSTEM_ACTOR, Action, Actor
from ground.records.edit import update
from ground.records.get_resource import find_row
from ground.resources.calibrations import calibrate_mission
from ground.resources.downlinks import import_recording
from ground.resources.executions import execute_plan
from ground.resources.runs import dry_run
from ground.resources.runs.kind import RUN
from ground.resources.runs.row import RunRow

ACTIONS = {module.KIND: module.ACTION for module in (calibrate_mission, execute_plan, import_recording)}
"""What a kind of job asks for where it is not planning: the same to ask, to cancel and to ask again."""
CANCELS = ACTIONS | {dry_run.LIVE_KIND: Action.STOP}
"""To cancel a live run that waits is to stop it."""


def cancel_job(repo: Repository, actor: Actor, job_id: str) -> Job:
    """Return the job, asked to stop; one that is over stays as it is."""
    with repo.database.write() as session:
        row = find_row(session, JOB, job_id, lock=True)
        actor.require(CANCELS.get(row.kind, Action.PLAN), row.mission_id)
        cancel(session, row, mark_subject, utc_now())
        session.flush()
        wake_after(session)
        return JOB.show_one(session, row)


def retry_job(repo: Repository, actor: Actor, job_id: str) -> Job:
    """Return the job, queued again.

    Raises
    ------
    StateError
        If it did not end without a result.
    """
    with repo.database.write() as session:
        row = find_row(session, JOB, job_id, lock=True)
        actor.require(ACTIONS.get(row.kind, Action.PLAN), row.mission_id)
        if row.state not in {"failed", "cancelled"}:
            raise StateError(f"job {job_id} is {row.state}; only a failed or cancelled one is queued again")
        requeue(row)
        mark_subject(session, row)
        session.flush()
        wake_after(session)
        return JOB.show_one(session, row)


def mark_subject(session: Session, job: JobRow) -> None:
    """Let the run that a job is about have the job's state."""
    run = session.get(RunRow, job.subject_id) if job.subject_kind == "run" else None
    if run is not None:
        update(session, SYSTEM_ACTOR, RUN, run, {"state": job.state}, action="run")
