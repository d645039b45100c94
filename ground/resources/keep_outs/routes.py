"""Keep-outs: polygons the rover must not enter."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Cursor, Id, IfMatch, Limit, api_router, created
from ground.api.problems import responses
from ground.records.forms import Page
from ground.resources.keep_outs.bodies import KeepOutChange, KeepOutCreate
from ground.resources.keep_outs.create_keep_out import create_keep_out as draw_keep_out
from ground.resources.keep_outs.value import KeepOut

router = api_router("keep-outs")


@router.get("/missions/{mission_id}/keep-outs", response_model=Page[KeepOut], responses=responses(404, 422))
async def list_keep_outs(ask: Asked, mission_id: Id, limit: Limit = 100, cursor: Cursor = None) -> Response:
    """List the keep-outs of a mission."""
    return await ask.page("keep_out", mission_id, limit, cursor)


@router.post(
    "/missions/{mission_id}/keep-outs",
    response_model=KeepOut,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_keep_out(ask: Asked, mission_id: Id, body: KeepOutCreate) -> Response:
    """Draw a keep-out."""
    value = await ask.do(draw_keep_out, mission_id, body)
    return created(value, f"/api/v1/keep-outs/{value.id}")


@router.get("/keep-outs/{keep_out_id}", response_model=KeepOut, responses=responses(404, 422))
async def get_keep_out(ask: Asked, keep_out_id: Id) -> Response:
    """Read a keep-out."""
    return await ask.one("keep_out", keep_out_id)


@router.patch(
    "/keep-outs/{keep_out_id}", response_model=KeepOut, responses=responses(400, 404, 409, 412, 422, 428)
)
async def change_keep_out(
    ask: Asked, keep_out_id: Id, body: KeepOutChange, if_match: IfMatch = None
) -> Response:
    """Change a keep-out."""
    return await ask.change("keep_out", keep_out_id, body, if_match)


@router.delete("/keep-outs/{keep_out_id}", status_code=204, responses=responses(404, 409, 412, 422, 428))
async def delete_keep_out(ask: Asked, keep_out_id: Id, if_match: IfMatch = None) -> Response:
    """Delete a keep-out."""
    return await ask.delete("keep_out", keep_out_id, if_match)
