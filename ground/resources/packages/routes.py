"""Endpoints: uplink packages."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Id, api_router
from ground.api.problems import responses

router = api_router("uplink")


@router.post(
    "/plans/{plan_id}/package",
    response_class=Response,
    responses={
        200: {"content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}}},
        **responses(404, 409, 422, 503),
    },
)
async def package_plan(ask: Asked, plan_id: Id) -> Response:
    """Make the signed uplink package of an approved plan; the plan is uplinked with it."""
    from ground.resources.packages.package_plan import package_plan

    package = await ask.do(package_plan, plan_id)
    headers = {
        "Content-Disposition": f'attachment; filename="{package.file_name}"',
        "ETag": f'"{package.sha256}"',
    }
    return Response(package.content, media_type="application/zip", headers=headers)
