"""Take in what an execution brought down."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, api_router, created
from ground.api.jobs_answer import JOB_ANSWERS, Prefer, accepted
from ground.api.problems import responses
from ground.jobs.value import Job
from ground.resources.downlinks.import_recording import import_upload
from ground.resources.downlinks.ingest_run import ingest_upload
from ground.resources.runs.bodies import RunImport, RunIngest
from ground.resources.runs.value import Run

router = api_router("uplink")


@router.post(
    "/runs/import",
    response_model=Job,
    status_code=202,
    responses=JOB_ANSWERS,
)
async def import_run(ask: Asked, body: RunImport, prefer: Prefer = None) -> Response:
    """Take in what a robot recorded while a plan was driven: a job, whose result is a run made elsewhere."""
    job = await ask.do(import_upload, body)
    return await accepted(ask.repo, ask.who, job, prefer)


@router.post(
    "/runs/ingest",
    response_model=Run,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def ingest_run(ask: Asked, body: RunIngest) -> Response:
    """Take in the folder of an execution (an uploaded zip) and tie its products to what asked for them."""
    run = await ask.do(ingest_upload, body.upload_id)
    return created(run, f"/api/v1/runs/{run.id}")
