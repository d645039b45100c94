"""Targets: points on rocks, and the way from one to all that came of it."""

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
from ground.api.schemas import Page, TargetChange, TargetCreate, set_members
from ground.gdr import values as v
from ground.services.change_resource import change_resource
from ground.services.create_target import create_target as pick_target
from ground.services.delete_resource import delete_resource
from ground.services.get_resource import get_resource
from ground.services.list_resources import list_resources

router = APIRouter(tags=["targets"], responses=responses(401, 403))


@router.get("/missions/{mission_id}/targets", response_model=Page[v.Target], responses=responses(404, 422))
async def list_targets(
    repo: Repo, who: Who, mission_id: Id, limit: Limit = 100, cursor: Cursor = None
) -> Response:
    """List the targets of a mission."""
    return answer(await call(list_resources, repo, who, "target", mission_id, limit=limit, cursor=cursor))


@router.post(
    "/missions/{mission_id}/targets",
    response_model=v.Target,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_target(repo: Repo, who: Who, mission_id: Id, body: TargetCreate) -> Response:
    """Pick a target; height, normal and covariance come from the full-resolution terrain."""
    value = await call(
        pick_target,
        repo,
        who,
        mission_id,
        east_m=body.east_m,
        north_m=body.north_m,
        name=body.name,
        notes=body.notes,
        source_image=body.source_image,
    )
    return created(value, f"/api/v1/targets/{value.id}")


@router.get("/targets/{target_id}", response_model=v.Target, responses=responses(404, 422))
async def get_target(repo: Repo, who: Who, target_id: Id) -> Response:
    """Read a target."""
    return answer(await call(get_resource, repo, who, "target", target_id))


@router.patch(
    "/targets/{target_id}", response_model=v.Target, responses=responses(400, 404, 409, 412, 422, 428)
)
async def change_target(
    repo: Repo, who: Who, target_id: Id, body: TargetChange, if_match: IfMatch = None
) -> Response:
    """Change or move a target; its observation points are found anew."""
    changes = set_members(body)
    return answer(
        await call(change_resource, repo, who, "target", target_id, changes, revision_wanted(if_match))
    )


@router.delete("/targets/{target_id}", status_code=204, responses=responses(404, 409, 412, 422, 428))
async def delete_target(repo: Repo, who: Who, target_id: Id, if_match: IfMatch = None) -> Response:
    """Delete a target with its observation requests."""
    await call(delete_resource, repo, who, "target", target_id, revision_wanted(if_match))
    return no_content()


@router.get("/targets/{target_id}/lineage", response_model=v.Lineage, responses=responses(404, 422))
async def get_target_lineage(repo: Repo, who: Who, target_id: Id) -> Response:
    """Follow a target to its requests, plans, runs and data products."""
    from ground.services.trace_lineage import trace_lineage

    return answer(await call(trace_lineage, repo, who, "target", target_id))
