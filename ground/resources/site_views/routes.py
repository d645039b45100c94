"""What the 3D view, the map and the panorama draw: rover, cameras, coverage, the place to stand."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import Path, Query
from starlette.responses import FileResponse, Response

from ground.api.context import Asked, Id, answer, api_router
from ground.api.problems import responses
from ground.gdr.geometry import Pose
from ground.resources.observation_requests.check_stand import check_stand
from ground.resources.observation_requests.value import StandCheck
from ground.resources.site_views.describe_rover import describe_rover, view_from
from ground.resources.site_views.look_around import look_around, point_in_panorama, read_tile
from ground.resources.site_views.read_coverage import read_coverage
from ground.resources.site_views.value import CameraView, Panorama, RoverShape
from ground.resources.terrains.value import TerrainPoint

router = api_router("views")
Coordinate = Annotated[float, Query(ge=-100_000.0, le=100_000.0, allow_inf_nan=False)]
Angle = Annotated[float, Query(ge=-6.2831853071795869, le=6.2831853071795869, allow_inf_nan=False)]


@router.get("/missions/{mission_id}/rover", response_model=RoverShape, responses=responses(404, 422))
async def get_rover(ask: Asked, mission_id: Id) -> Response:
    """Describe the mission's rover for a view: body, arm, mast, cameras, tracking cone, sun."""
    return answer(await ask.do(describe_rover, mission_id))


@router.get("/missions/{mission_id}/rover/view", response_model=CameraView, responses=responses(404, 422))
async def get_camera_view(
    ask: Asked,
    mission_id: Id,
    east_m: Coordinate,
    north_m: Coordinate,
    camera: Annotated[str, Query(min_length=1, max_length=80)],
    heading_rad: Angle = 0.0,
    pan_rad: Angle = 0.0,
    tilt_rad: Angle = 0.0,
    at_east_m: Coordinate | None = None,
    at_north_m: Coordinate | None = None,
) -> Response:
    """Give a camera model in the site frame for a rover standing at a pose, as it settles on the ground.

    With `at_east_m` and `at_north_m` the mast looks at the ground there, else it stands at `pan_rad` and
    `tilt_rad`.
    """
    at = None if at_east_m is None or at_north_m is None else (at_east_m, at_north_m)
    pose = Pose(east_m, north_m, heading_rad)
    return answer(
        await ask.do(view_from, mission_id, pose, camera, pan_rad=pan_rad, tilt_rad=tilt_rad, at=at)
    )


@router.get(
    "/missions/{mission_id}/terrain/coverage",
    response_class=Response,
    responses={
        200: {
            "content": {"application/octet-stream": {}},
            "description": (
                "one byte a post, row by row, first row in the north: 0 = nothing known, 1 = hidden from the "
                "start pose's mast, else 2 + standard deviation in centimetres of a point picked there. "
                "X-Outcrop-Shape, X-Outcrop-Bounds and X-Outcrop-Spacing as with the heights."
            ),
        },
        **responses(404, 422),
    },
)
async def get_coverage(
    ask: Asked,
    mission_id: Id,
    layer: Literal["inner", "outer"] = "inner",
    max_posts: Annotated[
        int, Query(ge=16, le=1_000_000, description="thinned out to at most so many posts")
    ] = 90_000,
) -> Response:
    """Send which ground is seen from the start pose, and how well it is known there."""
    tile = await ask.do(read_coverage, mission_id, layer, max_posts)
    headers = {**tile.headers, "Cache-Control": "private, max-age=300"}
    return Response(tile.content, media_type="application/octet-stream", headers=headers)


@router.get("/missions/{mission_id}/panorama", response_model=Panorama, responses=responses(404, 422))
async def get_panorama(ask: Asked, mission_id: Id) -> Response:
    """Describe the panorama of the start pose; its tiles are rendered when they are first read, then kept."""
    return answer(await ask.do(look_around, mission_id))


@router.get(
    "/missions/{mission_id}/panorama/tiles/{index}",
    response_class=Response,
    responses={200: {"content": {"image/jpeg": {}}}, **responses(404, 422)},
)
async def get_panorama_tile(
    ask: Asked,
    mission_id: Id,
    index: Annotated[int, Path(ge=0, le=99)],
    key: Annotated[str, Query(max_length=40, description="from the tile's url; makes it cacheable")] = "",
) -> Response:
    """Send a tile of the panorama, grey, rendered by the simulator."""
    path = await ask.do(read_tile, mission_id, index)
    cached = "private, max-age=86400" if key else "no-cache"
    return FileResponse(path, media_type="image/jpeg", headers={"Cache-Control": cached})


@router.get(
    "/missions/{mission_id}/panorama/point", response_model=TerrainPoint, responses=responses(404, 422)
)
async def get_panorama_point(
    ask: Asked,
    mission_id: Id,
    azimuth_rad: Annotated[float, Query(ge=-6.2831853071795869, le=12.566370614359172, allow_inf_nan=False)],
    elevation_rad: Annotated[
        float, Query(ge=-1.5707963267948966, le=1.5707963267948966, allow_inf_nan=False)
    ],
) -> Response:
    """Ask the full-resolution terrain for the ground in a direction (azimuth clockwise from north)."""
    return answer(await ask.do(point_in_panorama, mission_id, azimuth_rad, elevation_rad))


@router.get(
    "/observation-requests/{observation_request_id}/stand",
    response_model=StandCheck,
    responses=responses(404, 422),
)
async def get_stand_check(
    ask: Asked,
    observation_request_id: Id,
    east_m: Coordinate,
    north_m: Coordinate,
    heading_rad: Angle | None = None,
) -> Response:
    """Weigh a pose for a request by the rules of base placement; by default the rover faces the target."""
    return answer(await ask.do(check_stand, observation_request_id, east_m, north_m, heading_rad))
