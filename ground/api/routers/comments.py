"""Comments on any resource of a mission."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.responses import Response

from ground.api.context import (
    Cursor,
    FilterId,
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
from ground.api.schemas import CommentChange, CommentCreate, Page, set_members
from ground.gdr import values as v
from ground.services.change_resource import change_resource
from ground.services.create_comment import create_comment as remark
from ground.services.delete_resource import delete_resource
from ground.services.get_resource import get_resource
from ground.services.list_resources import list_resources

router = APIRouter(tags=["comments"], responses=responses(401, 403))


@router.get("/missions/{mission_id}/comments", response_model=Page[v.Comment], responses=responses(404, 422))
async def list_comments(
    repo: Repo,
    who: Who,
    mission_id: Id,
    limit: Limit = 100,
    cursor: Cursor = None,
    subject_id: FilterId = None,
) -> Response:
    """List comments, on one resource if wanted."""
    return answer(
        await call(
            list_resources,
            repo,
            who,
            "comment",
            mission_id,
            limit=limit,
            cursor=cursor,
            where={"subject_id": subject_id},
        )
    )


@router.post(
    "/missions/{mission_id}/comments",
    response_model=v.Comment,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_comment(repo: Repo, who: Who, mission_id: Id, body: CommentCreate) -> Response:
    """Remark on a resource."""
    value = await call(
        remark,
        repo,
        who,
        mission_id,
        subject_kind=body.subject_kind,
        subject_id=body.subject_id,
        text=body.text,
    )
    return created(value, f"/api/v1/comments/{value.id}")


@router.get("/comments/{comment_id}", response_model=v.Comment, responses=responses(404, 422))
async def get_comment(repo: Repo, who: Who, comment_id: Id) -> Response:
    """Read a comment."""
    return answer(await call(get_resource, repo, who, "comment", comment_id))


@router.patch(
    "/comments/{comment_id}", response_model=v.Comment, responses=responses(400, 404, 409, 412, 422, 428)
)
async def change_comment(
    repo: Repo, who: Who, comment_id: Id, body: CommentChange, if_match: IfMatch = None
) -> Response:
    """Change a comment."""
    changes = set_members(body)
    return answer(
        await call(change_resource, repo, who, "comment", comment_id, changes, revision_wanted(if_match))
    )


@router.delete("/comments/{comment_id}", status_code=204, responses=responses(404, 409, 412, 422, 428))
async def delete_comment(repo: Repo, who: Who, comment_id: Id, if_match: IfMatch = None) -> Response:
    """Delete a comment."""
    await call(delete_resource, repo, who, "comment", comment_id, revision_wanted(if_match))
    return no_content()
