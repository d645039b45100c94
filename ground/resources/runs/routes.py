"""Endpoints: runs."""

from __future__ import annotations

from typing import Annotated

from fastapi import Query
from starlette.requests import Request
from starlette.responses import FileResponse, Response, StreamingResponse

from ground.api.context import PRODUCT_FILE, Asked, Id, answer, product_file
from ground.api.problems import responses
from ground.api.resource_routes import resource_routes
from ground.api.streams import EVENT_STREAM, LastEventId
from ground.resources.runs.bodies import FaultBody, RunControlBody
from ground.resources.runs.control_run import control_run as control_run_use_case
from ground.resources.runs.control_run import inject_fault as inject_fault_use_case
from ground.resources.runs.dry_run import dry_run
from ground.resources.runs.kind import RUN
from ground.resources.runs.read_run import read_live_product, read_telemetry, read_trace
from ground.resources.runs.read_snapshot import read_snapshot
from ground.resources.runs.stream import run_stream
from ground.resources.runs.trace_value import RunSnapshot, Telemetry, Trace
from ground.resources.runs.value import Run, RunControl

router = resource_routes(
    RUN,
    "runs",
    lists="List runs, of one plan if wanted.",
    starts=(dry_run, "Run a plan on a simulated rover: a job, whose subject is the run."),
    reads="Read a run: outcome, utility, options taken.",
    changes="Change the notes of a run.",
)


@router.post("/runs/{run_id}/control", response_model=RunControl, responses=responses(400, 404, 409, 422))
async def control_run(ask: Asked, run_id: Id, body: RunControlBody) -> Response:
    """Pause, resume, step, speed up, abort or (live) stop a run that goes on."""
    return answer(
        await ask.do(
            control_run_use_case,
            run_id,
            paused=body.paused,
            pace=body.pace,
            step=body.step,
            abort=body.abort,
            stop=body.stop,
        )
    )


@router.post("/runs/{run_id}/faults", response_model=Run, responses=responses(400, 404, 409, 422))
async def inject_fault(ask: Asked, run_id: Id, body: FaultBody) -> Response:
    """Let the simulated rover of a live run suffer a fault: now, at a time, or at the command of a task."""
    return answer(await ask.do(inject_fault_use_case, run_id, body))


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
    rover made it), `control` (how it goes: at the start, and when an operator asks), and at last `end`; of a
    live run also `link` (the line, age of the last word, open commands) and `note` (of the executive).
    """
    return await run_stream(ask.repo, ask.hub, ask.who, run_id, last_event_id)


@router.get(
    "/runs/{run_id}/products/{product_id}/file",
    response_class=FileResponse,
    responses={**PRODUCT_FILE, **responses(404, 422)},
)
async def get_run_product_file(ask: Asked, run_id: Id, product_id: Id, request: Request) -> Response:
    """Send the file of a data product that a run has announced, while it goes on."""
    asked = request.headers
    return product_file(asked, *await ask.do(read_live_product, run_id, product_id))
