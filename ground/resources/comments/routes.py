"""Comments on any resource of a mission."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Id, created
from ground.api.problems import responses
from ground.api.resource_routes import resource_routes
from ground.resources.comments.bodies import CommentCreate
from ground.resources.comments.create_comment import create_comment as remark
from ground.resources.comments.kind import COMMENT
from ground.resources.comments.value import Comment

router = resource_routes(
    COMMENT,
    "comments",
    lists="List comments, on one resource if wanted.",
    reads="Read a comment.",
    changes="Change a comment.",
    deletes="Delete a comment.",
)


@router.post(
    "/missions/{mission_id}/comments",
    response_model=Comment,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_comment(ask: Asked, mission_id: Id, body: CommentCreate) -> Response:
    """Remark on a resource."""
    value = await ask.do(remark, mission_id, ask.kinds[body.subject_kind], body)
    return created(value, f"/api/v1/comments/{value.id}")
