"""Runs and the data products they brought."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from fastapi import Header, Query
from starlette.responses import FileResponse, Response, StreamingResponse

from ground.api.context import Asked, Cursor, FilterId, Id, IfMatch, Limit, answer, api_router
from ground.api.jobs_answer import Prefer, accepted
from ground.api.problems import responses
from ground.api.schemas import Page, RunChange, RunControlBody, RunCreate
from ground.gdr import values as v

router = api_router("runs")
LastEventId = Annotated[
    str | None, Header(max_length=40, pattern=r"^[0-9]{1,18}$", description="go on behind it")
]
EVENT_STREAM: dict[int | str, dict[str, Any]] = {
    200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}}
}


@router.get("/missions/{mission_id}/runs", response_model=Page[v.Run], responses=responses(404, 422))
async def list_runs(
    ask: Asked, mission_id: Id, limit: Limit = 100, cursor: Cursor = None, plan_id: FilterId = None
) -> Response:
    """List runs, of one plan if wanted."""
    where = {"plan_id": plan_id}
    return await ask.page("run", mission_id, limit, cursor, where)


@router.post(
    "/missions/{mission_id}/runs",
    response_model=v.Job,
    status_code=202,
    responses={
        200: {"model": v.Job, "description": "Done in the time given by Prefer"},
        **responses(400, 404, 409, 422),
    },
)
async def create_run(ask: Asked, mission_id: Id, body: RunCreate, prefer: Prefer = None) -> Response:
    """Run a plan on a simulated rover: a job, whose subject is the run."""
    from executive.ports import Operation
    from ground.rehearsal import Sent
    from ground.services.dry_run import RunOrder, dry_run

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


@router.get("/runs/{run_id}", response_model=v.Run, responses=responses(404, 422))
async def get_run(ask: Asked, run_id: Id) -> Response:
    """Read a run: outcome, utility, options taken."""
    return await ask.one("run", run_id)


@router.patch("/runs/{run_id}", response_model=v.Run, responses=responses(400, 404, 409, 412, 422, 428))
async def change_run(ask: Asked, run_id: Id, body: RunChange, if_match: IfMatch = None) -> Response:
    """Change the notes of a run."""
    return await ask.change("run", run_id, body, if_match)


@router.post("/runs/{run_id}/control", response_model=v.RunControl, responses=responses(400, 404, 409, 422))
async def control_run(ask: Asked, run_id: Id, body: RunControlBody) -> Response:
    """Pause, resume, step, speed up or abort a run that goes on."""
    from ground.services.control_run import control_run

    return answer(
        await ask.do(
            control_run,
            run_id,
            paused=body.paused,
            pace=body.pace,
            step=body.step,
            abort=body.abort,
        )
    )


@router.get("/runs/{run_id}/trace", response_model=v.Trace, responses=responses(404, 409, 422))
async def get_run_trace(ask: Asked, run_id: Id) -> Response:
    """Read the executive's trace."""
    from ground.services.read_run import read_trace

    return answer(await ask.do(read_trace, run_id))


@router.get("/runs/{run_id}/telemetry", response_model=v.Telemetry, responses=responses(404, 422))
async def get_run_telemetry(ask: Asked, run_id: Id) -> Response:
    """Read telemetry as columns; while the run goes on, what there is so far (`complete` is false)."""
    from ground.services.read_run import read_telemetry

    return answer(await ask.do(read_telemetry, run_id))


@router.get("/runs/{run_id}/snapshot", response_model=v.RunSnapshot, responses=responses(404, 409, 422))
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
    from ground.services.read_snapshot import read_snapshot

    return answer(await ask.do(read_snapshot, run_id, seq=seq, t_s=t_s))


@router.get(
    "/runs/{run_id}/events",
    response_class=StreamingResponse,
    responses={**EVENT_STREAM, **responses(404, 422)},
)
async def stream_run(ask: Asked, run_id: Id, last_event_id: LastEventId = None) -> Response:
    """Stream a run: events `telemetry` (one sample), `trace` (one record), `product` (a data product as the
    rover made it), `control` (what an operator asked), and at last `end` (the run)."""
    from ground.api.streams import run_stream

    return await run_stream(ask.repo, ask.who, run_id, last_event_id)


@router.get("/missions/{mission_id}/products", response_model=Page[v.Product], responses=responses(404, 422))
async def list_products(
    ask: Asked,
    mission_id: Id,
    limit: Limit = 100,
    cursor: Cursor = None,
    run_id: FilterId = None,
    target_id: FilterId = None,
    request_id: FilterId = None,
    orphan: bool | None = None,
) -> Response:
    """List data products by run, target or request; `orphan=true` lists those that match no request."""
    where = {"run_id": run_id, "target_id": target_id, "request_id": request_id, "orphan": orphan}
    return await ask.page("product", mission_id, limit, cursor, where)


@router.get("/products/{product_id}", response_model=v.Product, responses=responses(404, 422))
async def get_product(ask: Asked, product_id: Id) -> Response:
    """Read what is known of a data product."""
    return await ask.one("product", product_id)


@router.get("/products/{product_id}/lineage", response_model=v.Lineage, responses=responses(404, 422))
async def get_product_lineage(ask: Asked, product_id: Id) -> Response:
    """Follow a data product back to run, CRL task, observation request and target."""
    from ground.services.trace_lineage import trace_lineage

    return answer(await ask.do(trace_lineage, "product", product_id))


FILE: dict[int | str, dict[str, Any]] = {
    200: {"content": {"application/octet-stream": {}}},
    206: {"description": "A part, as asked for with Range"},
    416: {"description": "There is no such part"},
}


@router.get(
    "/products/{product_id}/file",
    response_class=FileResponse,
    responses={**FILE, **responses(404, 422)},
)
async def get_product_file(ask: Asked, product_id: Id) -> Response:
    """Send the file of a data product; its ETag is the SHA-256 of the content."""
    from ground.services.read_product import read_product

    return _file(*await ask.do(read_product, product_id))


@router.get(
    "/runs/{run_id}/products/{product_id}/file",
    response_class=FileResponse,
    responses={**FILE, **responses(404, 422)},
)
async def get_run_product_file(ask: Asked, run_id: Id, product_id: Id) -> Response:
    """Send the file of a data product that a run has announced, while it goes on."""
    from ground.services.read_run import read_live_product

    return _file(*await ask.do(read_live_product, run_id, product_id))


def _file(product: v.Product, path: Path) -> FileResponse:
    headers = {"ETag": f'"{product.sha256}"', "Cache-Control": "private, max-age=31536000, immutable"}
    headers["Content-Security-Policy"] = "default-src 'none'; sandbox"
    return FileResponse(
        path,
        media_type=product.media,
        filename=product.file_name.rsplit("/", 1)[-1],
        content_disposition_type="inline",
        headers=headers,
    )
