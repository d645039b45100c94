"""Uploads: files that a later request uses."""

from __future__ import annotations

from typing import Annotated

from fastapi import Query, Request
from starlette.responses import Response

from ground.api.context import Asked, api_router, call, created
from ground.api.problems import responses
from ground.resources.uploads.store_upload import UploadDraft
from ground.resources.uploads.value import Upload

router = api_router("uploads")
FileName = Annotated[str, Query(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f/\\\\]+$")]


@router.post(
    "/uploads",
    response_model=Upload,
    status_code=201,
    responses=responses(422),
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
        }
    },
)
async def create_upload(ask: Asked, request: Request, file_name: FileName) -> Response:
    """Upload a file as the body: a terrain (zip, GeoTIFF, mesh), an ortho image, a mission's archive."""
    draft = UploadDraft(ask.repo, ask.who, file_name)
    try:
        async for chunk in request.stream():
            draft.write(chunk)
        value = await call(draft.finish)
    finally:
        draft.close()
    return created(value, f"/api/v1/uploads/{value.id}")
