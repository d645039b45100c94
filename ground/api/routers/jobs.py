"""Jobs: long work, its progress, and the stream of a mission's changes."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.responses import Response, StreamingResponse

from ground.api.context import Cursor, FilterId, Id, Limit, Repo, Who, answer, call
from ground.api.problems import responses
from ground.api.routers.runs import EVENT_STREAM, LastEventId
from ground.api.schemas import Page
from ground.gdr import values as v
from ground.services.get_resource import get_resource
from ground.services.list_resources import list_resources

router = APIRouter(tags=["jobs"], responses=responses(401, 403))


@router.get("/missions/{mission_id}/jobs", response_model=Page[v.Job], responses=responses(404, 422))
async def list_jobs(
    repo: Repo,
    who: Who,
    mission_id: Id,
    limit: Limit = 100,
    cursor: Cursor = None,
    state: v.JobState | None = None,
    subject_id: FilterId = None,
) -> Response:
    """List the jobs of a mission."""
    where = {"state": state, "subject_id": subject_id}
    return answer(
        await call(list_resources, repo, who, "job", mission_id, limit=limit, cursor=cursor, where=where)
    )


@router.get("/jobs/{job_id}", response_model=v.Job, responses=responses(404, 422))
async def get_job(repo: Repo, who: Who, job_id: Id) -> Response:
    """Read a job: state, progress, log, what came of it."""
    return answer(await call(get_resource, repo, who, "job", job_id))


@router.post("/jobs/{job_id}/cancel", response_model=v.Job, responses=responses(404, 422))
async def cancel_job(repo: Repo, who: Who, job_id: Id) -> Response:
    """Ask a job to stop; one that waits is cancelled at once, one that is over stays as it is."""
    from ground.services.cancel_job import cancel_job

    return answer(await call(cancel_job, repo, who, job_id))


@router.post("/jobs/{job_id}/retry", response_model=v.Job, responses=responses(404, 409, 422))
async def retry_job(repo: Repo, who: Who, job_id: Id) -> Response:
    """Queue a failed or cancelled job once more."""
    from ground.services.cancel_job import retry_job

    return answer(await call(retry_job, repo, who, job_id))


@router.get(
    "/jobs/{job_id}/events",
    response_class=StreamingResponse,
    responses={**EVENT_STREAM, **responses(404, 422)},
)
async def stream_job(repo: Repo, who: Who, job_id: Id, last_event_id: LastEventId = None) -> Response:
    """Stream a job: events `job` with the whole job at each change, the last one when it is over."""
    from ground.api.streams import job_stream

    return await job_stream(repo, who, job_id, last_event_id)


@router.get(
    "/missions/{mission_id}/events",
    response_class=StreamingResponse,
    responses={**EVENT_STREAM, **responses(404, 422)},
)
async def stream_mission(repo: Repo, who: Who, mission_id: Id, last_event_id: LastEventId = None) -> Response:
    """Stream the changes of a mission: events `change`; without Last-Event-ID from now on."""
    from ground.api.streams import mission_stream

    return await mission_stream(repo, who, mission_id, last_event_id)
