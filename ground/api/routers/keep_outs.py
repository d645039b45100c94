"""Keep-outs: polygons the rover must not enter."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.responses import Response

from ground.api.context import (
    Cursor,
    Id,
    IfMatch,
    Limit,
    Repo,
    Who,
    answer,
    call,
    created,
    no_content,
    revision_wanted,
)
from ground.api.problems import responses
from ground.api.schemas import KeepOutChange, KeepOutCreate, Page, set_members
from ground.gdr import values as v
from ground.services.change_resource import change_resource
from ground.services.create_keep_out import create_keep_out as draw_keep_out
from ground.services.delete_resource import delete_resource
from ground.services.get_resource import get_resource
from ground.services.list_resources import list_resources

router = APIRouter(tags=["keep-outs"], responses=responses(401, 403))


@router.get("/missions/{mission_id}/keep-outs", response_model=Page[v.KeepOut], responses=responses(404, 422))
async def list_keep_outs(
    repo: Repo, who: Who, mission_id: Id, limit: Limit = 100, cursor: Cursor = None
) -> Response:
    """List the keep-outs of a mission."""
    return answer(await call(list_resources, repo, who, "keep_out", mission_id, limit=limit, cursor=cursor))


@router.post(
    "/missions/{mission_id}/keep-outs",
    response_model=v.KeepOut,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_keep_out(repo: Repo, who: Who, mission_id: Id, body: KeepOutCreate) -> Response:
    """Draw a keep-out."""
    value = await call(
        draw_keep_out,
        repo,
        who,
        mission_id,
        polygon_m=body.polygon_m,
        name=body.name,
        notes=body.notes,
    )
    return created(value, f"/api/v1/keep-outs/{value.id}")


@router.get("/keep-outs/{keep_out_id}", response_model=v.KeepOut, responses=responses(404, 422))
async def get_keep_out(repo: Repo, who: Who, keep_out_id: Id) -> Response:
    """Read a keep-out."""
    return answer(await call(get_resource, repo, who, "keep_out", keep_out_id))


@router.patch(
    "/keep-outs/{keep_out_id}", response_model=v.KeepOut, responses=responses(400, 404, 409, 412, 422, 428)
)
async def change_keep_out(
    repo: Repo, who: Who, keep_out_id: Id, body: KeepOutChange, if_match: IfMatch = None
) -> Response:
    """Change a keep-out."""
    changes = set_members(body)
    return answer(
        await call(change_resource, repo, who, "keep_out", keep_out_id, changes, revision_wanted(if_match))
    )


@router.delete("/keep-outs/{keep_out_id}", status_code=204, responses=responses(404, 409, 412, 422, 428))
async def delete_keep_out(repo: Repo, who: Who, keep_out_id: Id, if_match: IfMatch = None) -> Response:
    """Delete a keep-out."""
    await call(delete_resource, repo, who, "keep_out", keep_out_id, revision_wanted(if_match))
    return no_content()
