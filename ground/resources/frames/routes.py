"""Endpoints: frames of the site chain."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import (
    Asked,
    Cursor,
    Id,
    IfMatch,
    Limit,
    SiteNumber,
    api_router,
    created,
)
from ground.api.problems import responses
from ground.records.forms import Page
from ground.resources.frames.bodies import FrameChange, FrameCreate
from ground.resources.frames.create_frame import create_frame as create_frame_use_case
from ground.resources.frames.value import Frame, Level

router = api_router("frames")


@router.get("/missions/{mission_id}/frames", response_model=Page[Frame], responses=responses(404, 422))
async def list_frames(
    ask: Asked,
    mission_id: Id,
    limit: Limit = 100,
    cursor: Cursor = None,
    level: Level | None = None,
    site: SiteNumber = None,
) -> Response:
    """List sites, ends of drives and poses, each with its place by the solutions in use."""
    where = {"level": None if level is None else level.value, "site": site}
    return await ask.page("frame", mission_id, limit, cursor, where)


@router.post(
    "/missions/{mission_id}/frames",
    response_model=Frame,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_frame(ask: Asked, mission_id: Id, body: FrameCreate) -> Response:
    """Name a frame by its motion counter; the first site of a mission becomes its anchor."""
    value = await ask.do(
        create_frame_use_case, mission_id, name=body.name, counter=body.counter, notes=body.notes
    )
    return created(value, f"/api/v1/frames/{value.id}")


@router.get("/frames/{frame_id}", response_model=Frame, responses=responses(404, 422))
async def get_frame(ask: Asked, frame_id: Id) -> Response:
    """Read a frame."""
    return await ask.one("frame", frame_id)


@router.patch("/frames/{frame_id}", response_model=Frame, responses=responses(400, 404, 409, 412, 422, 428))
async def change_frame(ask: Asked, frame_id: Id, body: FrameChange, if_match: IfMatch = None) -> Response:
    """Change the notes of a frame."""
    return await ask.change("frame", frame_id, body, if_match)
