"""Targets: points on rocks, and the way from one to all that came of it."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Cursor, Id, IfMatch, Limit, api_router, created
from ground.api.problems import responses
from ground.records.forms import Page
from ground.resources.targets.bodies import TargetChange, TargetCreate
from ground.resources.targets.create_target import create_target as pick_target
from ground.resources.targets.value import Target

router = api_router("targets")


@router.get("/missions/{mission_id}/targets", response_model=Page[Target], responses=responses(404, 422))
async def list_targets(ask: Asked, mission_id: Id, limit: Limit = 100, cursor: Cursor = None) -> Response:
    """List the targets of a mission."""
    return await ask.page("target", mission_id, limit, cursor)


@router.post(
    "/missions/{mission_id}/targets",
    response_model=Target,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_target(ask: Asked, mission_id: Id, body: TargetCreate) -> Response:
    """Pick a target; height, normal and covariance come from the full-resolution terrain."""
    value = await ask.do(pick_target, mission_id, body)
    return created(value, f"/api/v1/targets/{value.id}")


@router.get("/targets/{target_id}", response_model=Target, responses=responses(404, 422))
async def get_target(ask: Asked, target_id: Id) -> Response:
    """Read a target."""
    return await ask.one("target", target_id)


@router.patch(
    "/targets/{target_id}", response_model=Target, responses=responses(400, 404, 409, 412, 422, 428)
)
async def change_target(ask: Asked, target_id: Id, body: TargetChange, if_match: IfMatch = None) -> Response:
    """Change or move a target; its observation points are found anew."""
    return await ask.change("target", target_id, body, if_match)


@router.delete("/targets/{target_id}", status_code=204, responses=responses(404, 409, 412, 422, 428))
async def delete_target(ask: Asked, target_id: Id, if_match: IfMatch = None) -> Response:
    """Delete a target with its observation requests."""
    return await ask.delete("target", target_id, if_match)
