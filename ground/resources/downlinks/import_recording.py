"""Take in what a robot recorded while a plan was driven: a job, or at once from the command line."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy.orm import Session

from ground.durable import removed_on_failure
from ground.errors import ArchiveError, NotFoundError, StateError
from ground.gdr.ids import new_id
from ground.gdr.places import keep_folder, place_of
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.jobs.value import Job, JobState
from ground.records.actor import Action, Actor, Role
from ground.records.edit import insert
from ground.records.get_resource import find_row
from ground.resources.ask_job import ask_job
from ground.resources.downlinks.order import ORDERS, RecordingWork
from ground.resources.downlinks.recording_folder import ROVER
from ground.resources.downlinks.work import keep_recording
from ground.resources.plans.kind import PLAN
from ground.resources.plans.row import PlanRow
from ground.resources.runs.bodies import RunImport
from ground.resources.runs.dry_run import record_run
from ground.resources.runs.kind import RUN
from ground.resources.runs.row import RunRow
from ground.resources.runs.value import Run, RunKind
from ground.resources.runs.work import RunResult
from ground.resources.uploads.store_upload import find_upload
from mission import MissionError
from mission.codec import Document

if TYPE_CHECKING:
    from neighbours.robots.recording import Mapping, Recording

KIND = "import_recording"
ACTION = Action.UPLINK
"""What asking for it, cancelling it and asking again take."""
MAX_NOTES = 4000


def import_upload(repo: Repository, actor: Actor, given: RunImport) -> Job:
    """Return the job that takes in an uploaded recording; its subject is the plan, its result the run.

    Raises
    ------
    NotFoundError, ForbiddenError
        If there is no such upload or plan for the actor, or they may not take in runs of its mission.
    ArchiveError
        If the upload is not a recording.
    StateError
        If the plan is not computed.
    """
    from neighbours.robots.bag_files import kind_of

    actor.require_somewhere(ACTION)
    with repo.database.write() as session:
        upload = find_upload(session, actor, given.upload_id)
        plan = _driven_plan(session, actor, given.plan_id)
        source = repo.files.path(upload.sha256)
        if not kind_of(source):
            raise ArchiveError(f"{upload.file_name} is neither MCAP nor sqlite3", pointer="/upload_id")
        run_id = new_id("run")
        work = RecordingWork(
            run_id,
            path=repo.files.address_of(upload.sha256),
            name=upload.file_name,
            mapping=given.mapping.model_dump(),
            run_dir=repo.address("runs", run_id),
            files_dir=repo.files.address,
        )
        return ask_job(session, repo, actor, KIND, plan.mission_id, (PLAN, plan.id), ORDERS.document(work))


def import_recording(
    repo: Repository, actor: Actor, plan_id: str, source: Path, mapping: Mapping, *, name: str = ""
) -> tuple[Run, Recording]:
    """Return the run made of a recording at once, and what was read.

    Poses and battery become its telemetry, pictures its products, each with the pose at its time. The run is
    marked as made elsewhere: it verifies nothing, calibrates nothing and settles no request.

    Raises
    ------
    NotFoundError, ForbiddenError
        If there is no such plan for the actor, or they may not take in runs of its mission.
    StateError
        If the plan is not computed.
    RobotFormatError
        If the recording cannot be read, or the mapping does not fit it.
    """
    with repo.database.read() as session:
        _driven_plan(session, actor, plan_id)
    run_id = new_id("run")
    kept = repo.folders("runs").at(run_id)
    named = name or source.name
    result, recording = keep_recording(kept.root, repo.files, source, named, mapping, lambda _share: None)
    with removed_on_failure(kept.root):
        keep_folder(kept)
    with repo.database.write() as session, removed_on_failure(kept.root):
        row = _record(session, actor, plan_id, run_id, result)
        return RUN.show_one(session, row), recording


def settle(_repo: Repository, session: Session, job: JobRow, result: RunResult) -> str | None:
    """Write the run of a recording; where its plan is gone the job fails."""
    order = ORDERS.from_document(job.payload)
    row = _record(session, Actor(job.author, Role.OPERATOR), job.subject_id, order.run_id, result)
    return f"/api/v1/runs/{row.id}"


def abandon(_session: Session, job: JobRow) -> None:
    """Remove what an attempt may have put in place: no record names it."""
    try:
        order = ORDERS.from_document(job.payload)
    except MissionError:
        return
    shutil.rmtree(place_of(order.run_dir), ignore_errors=True)


def _driven_plan(session: Session, actor: Actor, plan_id: str) -> PlanRow:
    plan: PlanRow = find_row(session, PLAN, plan_id)
    if not actor.sees(plan.mission_id):
        raise NotFoundError(f"there is no {PLAN.title} {plan_id}")  # as if there were none
    actor.require(ACTION, plan.mission_id)
    if plan.crl_sha256 is None:
        raise StateError(f"plan {plan.number} is not computed; a recording is of a plan that was driven")
    return plan


def _record(session: Session, actor: Actor, plan_id: str, run_id: str, result: RunResult) -> RunRow:
    plan: PlanRow = find_row(session, PLAN, plan_id)
    row = RunRow(
        id=run_id,
        author=actor.name,
        mission_id=plan.mission_id,
        plan_id=plan.id,
        kind=RunKind.EXECUTION.value,
        rover=ROVER,
        seed=0,
        faults=[],
        job_id=None,
        state=JobState.RUNNING.value,
        options_taken=[],
        achieved_request_ids=[],
        crl_sha256=plan.crl_sha256 or "",
        notes=_notes(result["document"]),
        elsewhere=True,
    )
    insert(session, actor, RUN, row)
    record_run(session, row, result)
    session.flush()
    return row


def _notes(document: Document) -> str:
    whole = "" if document["whole"] else " The file is not whole."
    name = document["name"]
    first = f"Recording {name}, made elsewhere: no executive of this installation vouches for it.{whole}"
    return "\n".join([first, *document["findings"]])[:MAX_NOTES]
