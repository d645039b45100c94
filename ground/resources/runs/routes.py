"""Endpoints: runs."""

from __future__ import annotations

from typing import Annotated

from fastapi import Query
from starlette.responses import FileResponse, Response, StreamingResponse

from ground.api.context import (
    PRODUCT_FILE,
    Asked,
    Cursor,
    FilterId,
    Id,
    IfMatch,
    Limit,
    answer,
    api_router,
    product_file,
)
from ground.api.jobs_answer import Prefer, accepted
from ground.api.problems import responses
from ground.api.streams import EVENT_STREAM, LastEventId
from ground.jobs.value import Job
from ground.records.forms import Page
from ground.resources.runs.bodies import RunChange, RunControlBody, RunCreate
from ground.resources.runs.control_run import control_run as control_run_use_case
from ground.resources.runs.dry_run import RunOrder, dry_run
from ground.resources.runs.read_run import read_live_product, read_telemetry, read_trace
from ground.resources.runs.read_snapshot import read_snapshot
from ground.resources.runs.stream import run_stream
from ground.resources.runs.trace_value import RunSnapshot, Telemetry, Trace
from ground.resources.runs.value import Run, RunControl
from ground.uplink.rehearsal import Sent

router = api_router("runs")


@router.get("/missions/{mission_id}/runs", response_model=Page[Run], responses=responses(404, 422))
async def list_runs(
    ask: Asked, mission_id: Id, limit: Limit = 100, cursor: Cursor = None, plan_id: FilterId = None
) -> Response:
    """List runs, of one plan if wanted."""
    where = {"plan_id": plan_id}
    return await ask.page("run", mission_id, limit, cursor, where)


@router.post(
    "/missions/{mission_id}/runs",
    response_model=Job,
    status_code=202,
    responses={
        200: {"model": Job, "description": "Done in the time given by Prefer"},
        **responses(400, 404, 409, 422),
    },
)
async def create_run(ask: Asked, mission_id: Id, body: RunCreate, prefer: Prefer = None) -> Response:
    """Run a plan on a simulated rover: a job, whose subject is the run."""
    from executive.ports import Operation

    order = RunOrder(
        plan_id=body.plan_id,
        rover=body.rover,
        seed=body.seed,
        faults=tuple(f.value() for f in body.faults),
        pace=body.pace,
        notes=body.notes,
        light_time_s=body.light_time_s,
        commands=tuple(Sent(Operation(c.operation), c.sent_s) for c in body.commands),
    )
    job = await ask.do(dry_run, mission_id, order)
    return await accepted(ask.repo, ask.who, job, prefer)


@router.get("/runs/{run_id}", response_model=Run, responses=responses(404, 422))
async def get_run(ask: Asked, run_id: Id) -> Response:
    """Read a run: outcome, utility, options taken."""
    return await ask.one("run", run_id)


@router.patch("/runs/{run_id}", response_model=Run, responses=responses(400, 404, 409, 412, 422, 428))
async def change_run(ask: Asked, run_id: Id, body: RunChange, if_match: IfMatch = None) -> Response:
    """Change the notes of a run."""
    return await ask.change("run", run_id, body, if_match)


@router.post("/runs/{run_id}/control", response_model=RunControl, responses=responses(400, 404, 409, 422))
async def control_run(ask: Asked, run_id: Id, body: RunControlBody) -> Response:
    """Pause, resume, step, speed up or abort a run that goes on."""
    return answer(
        await ask.do(
            control_run_use_case,
            run_id,
            paused=body.paused,
            pace=body.pace,
            step=body.step,
            abort=body.abort,
        )
    )


@router.get("/runs/{run_id}/trace", response_model=Trace, responses=responses(404, 409, 422))
async def get_run_trace(ask: Asked, run_id: Id) -> Response:
    """Read the executive's trace."""
    return answer(await ask.do(read_trace, run_id))


@router.get("/runs/{run_id}/telemetry", response_model=Telemetry, responses=responses(404, 422))
async def get_run_telemetry(ask: Asked, run_id: Id) -> Response:
    """Read telemetry as columns; while the run goes on, what there is so far (`complete` is false)."""
    return answer(await ask.do(read_telemetry, run_id))


@router.get("/runs/{run_id}/snapshot", response_model=RunSnapshot, responses=responses(404, 409, 422))
async def get_run_snapshot(
    ask: Asked,
    run_id: Id,
    seq: Annotated[
        int | None, Query(ge=0, le=2**53, description="record of the journal; default the last one")
    ] = None,
    t_s: Annotated[
        float | None,
        Query(ge=0.0, le=1e9, allow_inf_nan=False, description="instead: the last record up to this time"),
    ] = None,
) -> Response:
    """Look into the executive at a record of the journal: nodes, windows, conditions, resources."""
    return answer(await ask.do(read_snapshot, run_id, seq=seq, t_s=t_s))


@router.get(
    "/runs/{run_id}/events",
    response_class=StreamingResponse,
    responses={**EVENT_STREAM, **responses(404, 422)},
)
async def stream_run(ask: Asked, run_id: Id, last_event_id: LastEventId = None) -> Response:
    """Stream a run: events `telemetry` (one sample), `trace` (one record), `product` (a data product as the
    rover made it), `control` (how it goes: at the start, and when an operator asks), and at last `end`.
    """
    return await run_stream(ask.repo, ask.who, run_id, last_event_id)


@router.get(
    "/runs/{run_id}/products/{product_id}/file",
    response_class=FileResponse,
    responses={**PRODUCT_FILE, **responses(404, 422)},
)
async def get_run_product_file(ask: Asked, run_id: Id, product_id: Id) -> Response:
    """Send the file of a data product that a run has announced, while it goes on."""
    return product_file(*await ask.do(read_live_product, run_id, product_id))
