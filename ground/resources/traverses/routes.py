"""Traverses: stops of recorded runs adjusted together, with the pictures their tie points are drawn on."""

from __future__ import annotations

from typing import Annotated

from fastapi import Path
from starlette.responses import FileResponse, Response

from ground.api.context import Asked, Cursor, Id, IfMatch, Limit, api_router
from ground.api.jobs_answer import Prefer, accepted
from ground.api.problems import responses
from ground.jobs.value import Job
from ground.records.forms import Page
from ground.resources.traverses.adjust_traverse import Stop, TraverseOrder, adjust_traverse, read_picture
from ground.resources.traverses.bodies import TraverseChange, TraverseCreate
from ground.resources.traverses.value import Traverse

router = api_router("traverses")


@router.get("/missions/{mission_id}/traverses", response_model=Page[Traverse], responses=responses(404, 422))
async def list_traverses(ask: Asked, mission_id: Id, limit: Limit = 100, cursor: Cursor = None) -> Response:
    """List traverses."""
    return await ask.page("traverse", mission_id, limit, cursor)


@router.post(
    "/missions/{mission_id}/traverses",
    response_model=Job,
    status_code=202,
    responses={
        200: {"model": Job, "description": "Done in the time given by Prefer"},
        **responses(400, 404, 409, 422),
    },
)
async def create_traverse(
    ask: Asked, mission_id: Id, body: TraverseCreate, prefer: Prefer = None
) -> Response:
    """Match rocks between stops and adjust them: a job, whose subject is the traverse.

    Each stop but the first gets a new solution, `adjusted`, in the frame of the first; none is in use before
    somebody chooses it.
    """
    given = body.model_dump()
    order = TraverseOrder(**{**given, "stops": [Stop(**stop) for stop in given["stops"]]})
    job = await ask.do(adjust_traverse, mission_id, order)
    return await accepted(ask.repo, ask.who, job, prefer)


@router.get("/traverses/{traverse_id}", response_model=Traverse, responses=responses(404, 422))
async def get_traverse(ask: Asked, traverse_id: Id) -> Response:
    """Read a traverse: stops before and after, legs with their verdicts and rock pairs."""
    return await ask.one("traverse", traverse_id)


@router.patch(
    "/traverses/{traverse_id}", response_model=Traverse, responses=responses(400, 404, 409, 412, 422, 428)
)
async def change_traverse(
    ask: Asked, traverse_id: Id, body: TraverseChange, if_match: IfMatch = None
) -> Response:
    """Change name or notes of a traverse."""
    return await ask.change("traverse", traverse_id, body, if_match)


@router.delete("/traverses/{traverse_id}", status_code=204, responses=responses(404, 409, 412, 422, 428))
async def delete_traverse(ask: Asked, traverse_id: Id, if_match: IfMatch = None) -> Response:
    """Delete a traverse; the solutions that came of it stay."""
    return await ask.delete("traverse", traverse_id, if_match)


@router.get(
    "/traverses/{traverse_id}/pictures/{index}",
    response_class=Response,
    responses={200: {"content": {"image/png": {}}}, **responses(404, 422)},
)
async def get_traverse_picture(
    ask: Asked, traverse_id: Id, index: Annotated[int, Path(ge=0, le=99)]
) -> Response:
    """Send what a stop saw, as a cylinder of azimuths and elevations (`document.stops[].picture`)."""
    path = await ask.do(read_picture, traverse_id, index)
    return FileResponse(path, media_type="image/png", headers={"Cache-Control": "private, max-age=86400"})
