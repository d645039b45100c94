"""Comments on any resource of a mission."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Cursor, FilterId, Id, IfMatch, Limit, api_router, created
from ground.api.problems import responses
from ground.records.forms import Page
from ground.resources.comments.bodies import CommentChange, CommentCreate
from ground.resources.comments.create_comment import create_comment as remark
from ground.resources.comments.value import Comment

router = api_router("comments")


@router.get("/missions/{mission_id}/comments", response_model=Page[Comment], responses=responses(404, 422))
async def list_comments(
    ask: Asked,
    mission_id: Id,
    limit: Limit = 100,
    cursor: Cursor = None,
    subject_id: FilterId = None,
) -> Response:
    """List comments, on one resource if wanted."""
    return await ask.page("comment", mission_id, limit, cursor, {"subject_id": subject_id})


@router.post(
    "/missions/{mission_id}/comments",
    response_model=Comment,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_comment(ask: Asked, mission_id: Id, body: CommentCreate) -> Response:
    """Remark on a resource."""
    value = await ask.do(
        remark,
        mission_id,
        ask.kinds[body.subject_kind],
        subject_id=body.subject_id,
        text=body.text,
    )
    return created(value, f"/api/v1/comments/{value.id}")


@router.get("/comments/{comment_id}", response_model=Comment, responses=responses(404, 422))
async def get_comment(ask: Asked, comment_id: Id) -> Response:
    """Read a comment."""
    return await ask.one("comment", comment_id)


@router.patch(
    "/comments/{comment_id}", response_model=Comment, responses=responses(400, 404, 409, 412, 422, 428)
)
async def change_comment(
    ask: Asked, comment_id: Id, body: CommentChange, if_match: IfMatch = None
) -> Response:
    """Change a comment."""
    return await ask.change("comment", comment_id, body, if_match)


@router.delete("/comments/{comment_id}", status_code=204, responses=responses(404, 409, 412, 422, 428))
async def delete_comment(ask: Asked, comment_id: Id, if_match: IfMatch = None) -> Response:
    """Delete a comment."""
    return await ask.delete("comment", comment_id, if_match)
