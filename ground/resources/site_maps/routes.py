"""Endpoints: site maps."""

from __future__ import annotations

from starlette.responses import FileResponse, Response

from ground.api.context import Asked, Id
from ground.api.problems import responses
from ground.api.resource_routes import resource_routes
from ground.resources.site_maps.create_site_map import MEDIA, create_site_map, read_site_map
from ground.resources.site_maps.kind import SITE_MAP

router = resource_routes(
    SITE_MAP,
    "frames",
    lists="List the maps made at sites, of one site if wanted.",
    makes=(
        create_site_map,
        "File an uploaded GeoTIFF in metres east and north of a site; it moves with the site.",
    ),
    reads="Read where a map lies.",
    changes="Change name or notes of a map.",
    deletes="Delete a map.",
)


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
