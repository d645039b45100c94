"""Jobs: long work, its progress, and the stream of a mission's changes."""

from __future__ import annotations

from starlette.responses import Response, StreamingResponse

from ground.api.context import Asked, Id, answer
from ground.api.problems import responses
from ground.api.resource_routes import resource_routes
from ground.api.streams import EVENT_STREAM, LastEventId, job_stream, mission_stream
from ground.jobs.kind import JOB
from ground.jobs.value import Job
from ground.resources.jobs.cancel_job import cancel_job as cancel_job_use_case
from ground.resources.jobs.cancel_job import retry_job as retry_job_use_case

router = resource_routes(
    JOB,
    "jobs",
    lists="List the jobs of a mission.",
    reads="Read a job: state, progress, log, what came of it.",
)


@router.post("/jobs/{job_id}/cancel", response_model=Job, responses=responses(404, 422))
async def cancel_job(ask: Asked, job_id: Id) -> Response:
    """Ask a job to stop; one that waits is cancelled at once, one that is over stays as it is."""
    return answer(await ask.do(cancel_job_use_case, job_id))


@router.post("/jobs/{job_id}/retry", response_model=Job, responses=responses(404, 409, 422))
async def retry_job(ask: Asked, job_id: Id) -> Response:
    """Queue a failed or cancelled job once more."""
    return answer(await ask.do(retry_job_use_case, job_id))


@router.get(
    "/jobs/{job_id}/events",
    response_class=StreamingResponse,
    responses={**EVENT_STREAM, **responses(404, 422)},
)
async def stream_job(ask: Asked, job_id: Id, last_event_id: LastEventId = None) -> Response:
    """Stream a job: events `job` with the whole job at each change, the last one when it is over."""
    return await job_stream(ask.repo, ask.hub, ask.who, job_id, last_event_id)


@router.get(
    "/missions/{mission_id}/events",
    response_class=StreamingResponse,
    responses={**EVENT_STREAM, **responses(404, 422)},
)
async def stream_mission(ask: Asked, mission_id: Id, last_event_id: LastEventId = None) -> Response:
    """Stream the changes of a mission: events `change`; without Last-Event-ID from now on.

    Beside them, without an id, `presence`: everybody who looks at the mission, whenever that changes.
    """
    return await mission_stream(ask.repo, ask.hub, ask.who, mission_id, last_event_id)
