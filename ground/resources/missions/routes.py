"""Endpoints: missions."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import Query
from starlette.responses import FileResponse, Response

from ground.api.context import Asked, Crs, Id, answer
from ground.api.problems import responses
from ground.api.resource_routes import resource_routes
from ground.records.located import PointIn
from ground.resources.missions.kind import MISSION
from ground.resources.missions.read_coordinates import read_coordinates
from ground.resources.missions.read_terrain import read_heights, read_ortho, read_point, read_terrain
from ground.resources.terrains.value import Terrain, TerrainPoint

router = resource_routes(
    MISSION,
    "missions",
    lists="List missions.",
    reads="Read a mission.",
    changes="Change name, notes or rover profile of a mission.",
    deletes="Delete a mission with all that is in it (administrators).",
)

Coordinate = Annotated[float, Query(ge=-100_000.0, le=100_000.0, allow_inf_nan=False)]


@router.get("/missions/{mission_id}/terrain", response_model=Terrain, responses=responses(404, 422))
async def get_terrain(ask: Asked, mission_id: Id) -> Response:
    """Describe the mission's terrain: layers, extent, start pose."""
    return answer(await ask.do(read_terrain, mission_id))


@router.get(
    "/missions/{mission_id}/terrain/ortho",
    response_class=Response,
    responses={200: {"content": {"image/png": {}, "image/jpeg": {}}}, **responses(404, 422)},
)
async def get_ortho(
    ask: Asked,
    mission_id: Id,
    layer: Literal["inner", "outer"] = "inner",
    max_px: Annotated[
        int, Query(ge=16, le=16384, description="longest side of the image that is sent")
    ] = 16384,
) -> Response:
    """Send the ortho image of a layer, north up, with exactly the extent of the layer."""
    path, media, etag = await ask.do(read_ortho, mission_id, layer, max_px)
    return FileResponse(
        path, media_type=media, headers={"Cache-Control": "private, max-age=86400", "ETag": etag}
    )


@router.get(
    "/missions/{mission_id}/terrain/heights",
    response_class=Response,
    responses={
        200: {
            "content": {"application/octet-stream": {}},
            "description": (
                "float32, little-endian, row by row, first row in the north, NaN = unknown. "
                "X-Outcrop-Shape: rows,columns; "
                "X-Outcrop-Bounds: east,north of the first and last posts as "
                "east_min,north_min,east_max,north_max; "
                "X-Outcrop-Spacing: metres between posts."
            ),
        },
        **responses(404, 422),
    },
)
async def get_heights(
    ask: Asked,
    mission_id: Id,
    layer: Literal["inner", "outer"] = "inner",
    max_posts: Annotated[
        int, Query(ge=16, le=4_000_000, description="thinned out to at most so many posts")
    ] = 250_000,
) -> Response:
    """Send the heights of a layer as binary."""
    tile = await ask.do(read_heights, mission_id, layer, max_posts)
    headers = {
        **tile.headers,
        "X-Outcrop-Order": "north-to-south",
        "Cache-Control": "private, max-age=86400",
    }
    return Response(tile.content, media_type="application/octet-stream", headers=headers)


@router.get(
    "/missions/{mission_id}/terrain/point", response_model=TerrainPoint, responses=responses(404, 422)
)
async def get_terrain_point(ask: Asked, mission_id: Id, east_m: Coordinate, north_m: Coordinate) -> Response:
    """Ask the full-resolution terrain for one point: height, normal, slope, covariance."""
    return answer(await ask.do(read_point, mission_id, east_m, north_m))


@router.get("/missions/{mission_id}/coordinates", response_model=PointIn, responses=responses(404, 422))
async def get_coordinates(
    ask: Asked, mission_id: Id, east_m: Coordinate, north_m: Coordinate, crs: Crs
) -> Response:
    """Say where a point of the site lies in another reference."""
    return answer(await ask.do(read_coordinates, mission_id, east_m, north_m, crs))
