"""A process to be killed: writes, uploads and does jobs as fast as it can, and says what was acknowledged."""

from __future__ import annotations

from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session

from ground.gdr.models import CommentRow, JobRow
from ground.gdr.repository import Repository, open_repository
from ground.jobs import JobKind, Worker, enqueue
from ground.services.create_comment import create_comment
from ground.services.store_upload import UploadDraft
from ground.settings import load_settings
from tests.ground import work_for_tests
from tests.ground.conftest import PLANNER


def _settle(_repo: Repository, session: Session, job: JobRow, _result: dict[str, Any]) -> None:
    """Leave one row for each settlement: two of one job would show."""
    done = CommentRow(
        id=f"done-{job.id}-{job.token}",
        author="",
        mission_id=job.mission_id,
        subject_kind="job",
        subject_id=job.id,
        text="done",
    )
    session.add(done)


KINDS = {"count": JobKind("count", work_for_tests.count, _settle, lambda _session, _job: None)}


def queue_job(repo: Repository, mission_id: str) -> str:
    with repo.database.write() as session:
        return enqueue(
            session,
            repo.settings,
            kind="count",
            mission_id=mission_id,
            subject_kind="none",
            subject_id="none",
            payload={"what": "succeed", "log": str(repo.data_dir / "starts.log")},
            author="Planner",
        ).id


def main(folder: str, address: str, mission_id: str, tell: Connection) -> None:
    """Work until killed; each acknowledged id goes down `tell` before the next step."""
    settings = load_settings(
        data_dir=Path(folder), database_url=address, executor="inline", job_lease_s=0.5, job_attempts=20
    )
    repo = open_repository(settings)
    worker = Worker(repo, KINDS, slots=1)
    worker.folder.mkdir(parents=True, exist_ok=True)
    number = 0
    while True:
        number += 1
        comment = create_comment(
            repo, PLANNER, mission_id, subject_kind="mission", subject_id=mission_id, text=f"{number}"
        )
        tell.send(("comment", comment.id))
        tell.send(("job", queue_job(repo, mission_id)))
        draft = UploadDraft(repo, PLANNER, "x.bin")
        draft.write(comment.id.encode() * 1000)
        upload = draft.finish()
        draft.close()
        tell.send(("upload", upload.id))
        worker.step()
