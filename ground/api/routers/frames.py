"""The site chain: frames, their solutions, the missions' frame files, maps made at a site."""

from __future__ import annotations

from typing import Annotated

from fastapi import Query
from starlette.responses import FileResponse, Response

from ground.api.context import (
    Asked,
    Cursor,
    FilterId,
    Id,
    IfMatch,
    Limit,
    answer,
    api_router,
    created,
    revision_wanted,
)
from ground.api.frame_schemas import (
    FrameChange,
    FrameCreate,
    FrameFileImport,
    SiteMapChange,
    SiteMapCreate,
    SolutionChange,
    SolutionChoice,
    SolutionCreate,
)
from ground.api.problems import responses
from ground.api.schemas import Page
from ground.gdr import frame_values as f

router = api_router("frames")
SiteNumber = Annotated[int | None, Query(ge=0, le=2**31 - 1, description="frames of this site alone")]


@router.get("/missions/{mission_id}/frames", response_model=Page[f.Frame], responses=responses(404, 422))
async def list_frames(
    ask: Asked,
    mission_id: Id,
    limit: Limit = 100,
    cursor: Cursor = None,
    level: f.Level | None = None,
    site: SiteNumber = None,
) -> Response:
    """List sites, ends of drives and poses, each with its place by the solutions in use."""
    where = {"level": None if level is None else level.value, "site": site}
    return await ask.page("frame", mission_id, limit, cursor, where)


@router.post(
    "/missions/{mission_id}/frames",
    response_model=f.Frame,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_frame(ask: Asked, mission_id: Id, body: FrameCreate) -> Response:
    """Name a frame by its motion counter; the first site of a mission becomes its anchor."""
    from ground.services.create_frame import create_frame

    value = await ask.do(create_frame, mission_id, name=body.name, counter=body.counter, notes=body.notes)
    return created(value, f"/api/v1/frames/{value.id}")


@router.get("/frames/{frame_id}", response_model=f.Frame, responses=responses(404, 422))
async def get_frame(ask: Asked, frame_id: Id) -> Response:
    """Read a frame."""
    return await ask.one("frame", frame_id)


@router.patch("/frames/{frame_id}", response_model=f.Frame, responses=responses(400, 404, 409, 412, 422, 428))
async def change_frame(ask: Asked, frame_id: Id, body: FrameChange, if_match: IfMatch = None) -> Response:
    """Change the notes of a frame."""
    return await ask.change("frame", frame_id, body, if_match)


@router.put(
    "/frames/{frame_id}/solution",
    response_model=f.Carried,
    responses=responses(400, 404, 409, 412, 422, 428),
)
async def choose_solution(
    ask: Asked, frame_id: Id, body: SolutionChoice, if_match: IfMatch = None
) -> Response:
    """Put a solution of a frame in use, and carry along the targets, keep-outs and maps that it moves.

    With `preview` nothing is changed and the answer says what would be; no If-Match is needed then."""
    from ground.services.solutions import choose_solution

    revision = None if body.preview else revision_wanted(if_match)
    return answer(
        await ask.do(
            choose_solution,
            frame_id,
            body.solution_id,
            revision,
            preview=body.preview,
            reason=body.reason,
        )
    )


@router.get(
    "/missions/{mission_id}/solutions", response_model=Page[f.Solution], responses=responses(404, 422)
)
async def list_solutions(
    ask: Asked, mission_id: Id, limit: Limit = 100, cursor: Cursor = None, frame_id: FilterId = None
) -> Response:
    """List every solution there ever was, of one frame if wanted; the oldest first."""
    return await ask.page("solution", mission_id, limit, cursor, {"frame_id": frame_id})


@router.post(
    "/frames/{frame_id}/solutions",
    response_model=f.Solution,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_solution(ask: Asked, frame_id: Id, body: SolutionCreate) -> Response:
    """Add a solution to a frame; it is kept for good, and in use once it is chosen."""
    from ground.services.solutions import GivenSolution, add_solution

    value = await ask.do(add_solution, frame_id, GivenSolution(**body.model_dump()))
    return created(value, f"/api/v1/solutions/{value.id}")


@router.get("/solutions/{solution_id}", response_model=f.Solution, responses=responses(404, 422))
async def get_solution(ask: Asked, solution_id: Id) -> Response:
    """Read a solution."""
    return await ask.one("solution", solution_id)


@router.patch(
    "/solutions/{solution_id}",
    response_model=f.Solution,
    responses=responses(400, 404, 409, 412, 422, 428),
)
async def change_solution(
    ask: Asked, solution_id: Id, body: SolutionChange, if_match: IfMatch = None
) -> Response:
    """Change the notes of a solution; what it says of its frame never changes."""
    return await ask.change("solution", solution_id, body, if_match)


@router.get(
    "/missions/{mission_id}/frame-files", response_model=Page[f.FrameFile], responses=responses(404, 422)
)
async def list_frame_files(ask: Asked, mission_id: Id, limit: Limit = 100, cursor: Cursor = None) -> Response:
    """List the missions' frame files that were taken in."""
    return await ask.page("frame_file", mission_id, limit, cursor)


@router.post(
    "/missions/{mission_id}/frame-files",
    response_model=f.FrameFile,
    status_code=201,
    responses=responses(400, 404, 409, 413, 422),
)
async def import_frames(ask: Asked, mission_id: Id, body: FrameFileImport) -> Response:
    """Take in an uploaded frame file (.svf, .rvf): all its frames and solutions, or none.

    What is here already is not taken in twice, and no frame that has a solution in use gets another."""
    from ground.services.frame_files import import_frames

    return answer(await ask.do(import_frames, mission_id, body.upload_id), 201)


@router.get(
    "/missions/{mission_id}/frame-files/export",
    response_class=Response,
    responses={
        200: {"content": {"application/xml": {"schema": {"type": "string"}}}},
        **responses(404, 422),
    },
)
async def export_frames(ask: Asked, mission_id: Id, site: SiteNumber = None) -> Response:
    """Send all sites as a frame file (.svf), or with `site` the rover poses within it (.rvf)."""
    from ground.services.frame_files import export_frames

    name, content = await ask.do(export_frames, mission_id, site=site)
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(content, media_type="application/xml", headers=headers)


@router.get("/missions/{mission_id}/site-maps", response_model=Page[f.SiteMap], responses=responses(404, 422))
async def list_site_maps(
    ask: Asked, mission_id: Id, limit: Limit = 100, cursor: Cursor = None, frame_id: FilterId = None
) -> Response:
    """List the maps made at sites, of one site if wanted."""
    return await ask.page("site_map", mission_id, limit, cursor, {"frame_id": frame_id})


@router.post(
    "/missions/{mission_id}/site-maps",
    response_model=f.SiteMap,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_site_map(ask: Asked, mission_id: Id, body: SiteMapCreate) -> Response:
    """File an uploaded GeoTIFF in metres east and north of a site; it moves with the site."""
    from ground.services.site_maps import create_site_map

    value = await ask.do(create_site_map, mission_id, **body.model_dump())
    return created(value, f"/api/v1/site-maps/{value.id}")


@router.get("/site-maps/{site_map_id}", response_model=f.SiteMap, responses=responses(404, 422))
async def get_site_map(ask: Asked, site_map_id: Id) -> Response:
    """Read where a map lies."""
    return await ask.one("site_map", site_map_id)


@router.patch(
    "/site-maps/{site_map_id}", response_model=f.SiteMap, responses=responses(400, 404, 409, 412, 422, 428)
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
    from ground.services.site_maps import MEDIA, read_site_map

    path, name, digest = await ask.do(read_site_map, site_map_id)
    return FileResponse(path, media_type=MEDIA, filename=name, headers={"ETag": f'"{digest}"'})
