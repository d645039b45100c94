"""Endpoints: a mission's STAC catalogue."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Literal

from fastapi import Request
from starlette.background import BackgroundTask
from starlette.responses import FileResponse, Response

from ground.api.context import PREFIX, ZIP, Asked, Id, answer, api_router, archive, media_answers
from ground.api.problems import Answers, responses
from ground.resources.stac.export_catalogue import export_catalogue, read_document, write_terrain_asset
from ground.resources.stac.export_pds4 import export_pds4 as export_pds4_use_case
from neighbours.geodata.stac import COG

router = api_router("exchange")
GroupName = Literal["terrain", "products"]
TIFF: Answers = {200: {"content": {"image/tiff": {"schema": {"type": "string", "format": "binary"}}}}}


def _base(request: Request) -> str:
    return f"{str(request.base_url).rstrip('/')}{PREFIX}"


@router.get(
    "/missions/{mission_id}/stac",
    response_class=Response,
    responses={**media_answers("application/json"), **responses(404, 422, 503)},
)
async def get_stac_catalog(ask: Asked, request: Request, mission_id: Id) -> Response:
    """Send the mission's STAC 1.1 catalogue, with links to terrain and products."""
    return answer(await ask.do(read_document, mission_id, _base(request)))


@router.get(
    "/missions/{mission_id}/stac-archive",
    response_class=Response,
    responses={**ZIP, **responses(404, 422, 503)},
)
async def export_stac(ask: Asked, mission_id: Id) -> Response:
    """Send the STAC catalogue as files with relative links, terrain as COG and all products."""
    return await archive(
        f"{mission_id}-stac.zip", lambda target: ask.do(export_catalogue, mission_id, target)
    )


@router.get(
    "/missions/{mission_id}/pds4-archive",
    response_class=Response,
    responses={**ZIP, **responses(404, 422, 503)},
)
async def export_pds4(ask: Asked, mission_id: Id) -> Response:
    """Send pictures, terrain heights and the table of products as files with PDS4 labels."""
    return await archive(
        f"{mission_id}-pds4.zip", lambda target: ask.do(export_pds4_use_case, mission_id, target)
    )


@router.get(
    "/missions/{mission_id}/stac/{group}",
    response_class=Response,
    responses={**media_answers("application/json"), **responses(404, 422, 503)},
)
async def get_stac_group(ask: Asked, request: Request, mission_id: Id, group: GroupName) -> Response:
    """Send a collection of the catalogue; a catalogue where the mission has no place."""
    return answer(await ask.do(read_document, mission_id, _base(request), group))


@router.get(
    "/missions/{mission_id}/stac/{group}/{item_id}",
    response_class=Response,
    responses={**media_answers("application/geo+json"), **responses(404, 422, 503)},
)
async def get_stac_item(
    ask: Asked, request: Request, mission_id: Id, group: GroupName, item_id: Id
) -> Response:
    """Send an item: a terrain layer or a product, with its assets."""
    found = answer(await ask.do(read_document, mission_id, _base(request), group, item_id))
    found.headers["Content-Type"] = "application/geo+json"
    return found


@router.get(
    "/missions/{mission_id}/stac/terrain/{item_id}/{file}",
    response_class=Response,
    responses={**TIFF, **responses(404, 422, 503)},
)
async def get_stac_terrain(
    ask: Asked, mission_id: Id, item_id: Id, file: Literal["dem.tif", "ortho.tif"]
) -> Response:
    """Send heights or ortho image of a terrain layer as Cloud Optimized GeoTIFF."""
    folder = Path(tempfile.mkdtemp(prefix="outcrop-cog-"))
    try:
        await ask.do(write_terrain_asset, mission_id, item_id, file, folder / file)
    except BaseException:
        shutil.rmtree(folder)
        raise
    return FileResponse(folder / file, media_type=COG, background=BackgroundTask(shutil.rmtree, folder))
