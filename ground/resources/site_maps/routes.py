"""Endpoints: site maps."""

from __future__ import annotations

from starlette.responses import FileResponse, Response

from ground.api.context import (
    Asked,
    Cursor,
    FilterId,
    Id,
    IfMatch,
    Limit,
    api_router,
    created,
)
from ground.api.problems import responses
from ground.records.forms import Page
from ground.resources.site_maps.bodies import SiteMapChange, SiteMapCreate
from ground.resources.site_maps.create_site_map import MEDIA, read_site_map
from ground.resources.site_maps.create_site_map import create_site_map as create_site_map_use_case
from ground.resources.site_maps.value import SiteMap

router = api_router("frames")


@router.get("/missions/{mission_id}/site-maps", response_model=Page[SiteMap], responses=responses(404, 422))
async def list_site_maps(
    ask: Asked, mission_id: Id, limit: Limit = 100, cursor: Cursor = None, frame_id: FilterId = None
) -> Response:
    """List the maps made at sites, of one site if wanted."""
    return await ask.page("site_map", mission_id, limit, cursor, {"frame_id": frame_id})


@router.post(
    "/missions/{mission_id}/site-maps",
    response_model=SiteMap,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_site_map(ask: Asked, mission_id: Id, body: SiteMapCreate) -> Response:
    """File an uploaded GeoTIFF in metres east and north of a site; it moves with the site."""
    value = await ask.do(create_site_map_use_case, mission_id, **body.model_dump())
    return created(value, f"/api/v1/site-maps/{value.id}")


@router.get("/site-maps/{site_map_id}", response_model=SiteMap, responses=responses(404, 422))
async def get_site_map(ask: Asked, site_map_id: Id) -> Response:
    """Read where a map lies."""
    return await ask.one("site_map", site_map_id)


@router.patch(
    "/site-maps/{site_map_id}", response_model=SiteMap, responses=responses(400, 404, 409, 412, 422, 428)
)
async def change_site_map(
    ask: Asked, site_map_id: Id, body: SiteMapChange, if_match: IfMatch = None
) -> Response:
    """Change name or notes of a map."""
    return await ask.change("site_map", site_map_id, body, if_match)


@router.delete("/site-maps/{site_map_id}", status_code=204, responses=responses(404, 409, 412, 422, 428))
async def delete_site_map(ask: Asked, site_map_id: Id, if_match: IfMatch = None) -> Response:
    """Delete a map."""
    return await ask.delete("site_map", site_map_id, if_match)


@router.get(
    "/site-maps/{site_map_id}/file",
    response_class=Response,
    responses={
        200: {"content": {"image/tiff": {"schema": {"type": "string", "format": "binary"}}}},
        **responses(404, 422),
    },
)
async def get_site_map_file(ask: Asked, site_map_id: Id) -> Response:
    """Send the GeoTIFF of a map as it was filed."""
    path, name, digest = await ask.do(read_site_map, site_map_id)
    return FileResponse(path, media_type=MEDIA, filename=name, headers={"ETag": f'"{digest}"'})
