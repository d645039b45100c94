"""Missions, their terrain, history and archive."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Annotated, Literal

from fastapi import Query
from starlette.background import BackgroundTask
from starlette.responses import FileResponse, Response

from ground.api.context import Asked, Cursor, Id, IfMatch, Limit, answer, api_router, call, created
from ground.api.jobs_answer import Prefer, accepted
from ground.api.problems import responses
from ground.api.schemas import (
    ArchiveImport,
    MissionCalibrate,
    MissionChange,
    MissionCopy,
    MissionCreate,
    Page,
    UndoBody,
)
from ground.gdr import values as v

router = api_router("missions")
Coordinate = Annotated[float, Query(ge=-100_000.0, le=100_000.0, allow_inf_nan=False)]


@router.get("/missions", response_model=Page[v.Mission], responses=responses(422))
async def list_missions(ask: Asked, limit: Limit = 100, cursor: Cursor = None) -> Response:
    """List missions."""
    return await ask.page("mission", None, limit, cursor)


@router.post("/missions", response_model=v.Mission, status_code=201, responses=responses(400, 404, 409, 422))
async def create_mission(ask: Asked, body: MissionCreate) -> Response:
    """Open a mission on a generated, uploaded or the demo terrain."""
    from ground.api.mission_sources import open_mission

    mission = await ask.do(open_mission, body)
    return created(mission, f"/api/v1/missions/{mission.id}")


@router.get("/missions/{mission_id}", response_model=v.Mission, responses=responses(404, 422))
async def get_mission(ask: Asked, mission_id: Id) -> Response:
    """Read a mission."""
    return await ask.one("mission", mission_id)


@router.patch(
    "/missions/{mission_id}", response_model=v.Mission, responses=responses(400, 404, 409, 412, 422, 428)
)
async def change_mission(
    ask: Asked, mission_id: Id, body: MissionChange, if_match: IfMatch = None
) -> Response:
    """Change name, notes or rover profile of a mission."""
    return await ask.change("mission", mission_id, body, if_match)


@router.delete("/missions/{mission_id}", status_code=204, responses=responses(404, 409, 412, 422, 428))
async def delete_mission(ask: Asked, mission_id: Id, if_match: IfMatch = None) -> Response:
    """Delete a mission with all that is in it (administrators)."""
    return await ask.delete("mission", mission_id, if_match)


@router.post(
    "/missions/{mission_id}/copy",
    response_model=v.Mission,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def copy_mission(ask: Asked, mission_id: Id, body: MissionCopy) -> Response:
    """Copy a mission with its sols, targets, requests and keep-outs: a what-if of its own."""
    from ground.services.copy_mission import copy_mission

    mission = await ask.do(copy_mission, mission_id, name=body.name, notes=body.notes)
    return created(mission, f"/api/v1/missions/{mission.id}")


@router.post(
    "/missions/{mission_id}/calibrate",
    response_model=v.Job,
    status_code=202,
    responses={
        200: {"model": v.Job, "description": "Done in the time given by Prefer"},
        **responses(400, 404, 409, 422),
    },
)
async def calibrate_mission(
    ask: Asked, mission_id: Id, body: MissionCalibrate, prefer: Prefer = None
) -> Response:
    """Learn loss, duration and energy parameters from recorded runs: a job; plans made after it use them."""
    from ground.services.calibrate_mission import calibrate_mission

    job = await ask.do(calibrate_mission, mission_id, run_ids=body.run_ids, name=body.name)
    return await accepted(ask.repo, ask.who, job, prefer)


@router.get("/missions/{mission_id}/terrain", response_model=v.Terrain, responses=responses(404, 422))
async def get_terrain(ask: Asked, mission_id: Id) -> Response:
    """Describe the mission's terrain: layers, extent, start pose."""
    from ground.services.read_terrain import read_terrain

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
    from ground.services.read_terrain import read_ortho

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
    from ground.services.read_terrain import read_heights

    tile = await ask.do(read_heights, mission_id, layer, max_posts)
    headers = {
        "X-Outcrop-Shape": f"{tile.rows},{tile.columns}",
        "X-Outcrop-Bounds": ",".join(f"{b:.6f}" for b in tile.bounds),
        "X-Outcrop-Spacing": f"{tile.spacing_m:.6f}",
        "X-Outcrop-Order": "north-to-south",
        "Cache-Control": "private, max-age=86400",
    }
    return Response(tile.content, media_type="application/octet-stream", headers=headers)


@router.get(
    "/missions/{mission_id}/terrain/point", response_model=v.TerrainPoint, responses=responses(404, 422)
)
async def get_terrain_point(ask: Asked, mission_id: Id, east_m: Coordinate, north_m: Coordinate) -> Response:
    """Ask the full-resolution terrain for one point: height, normal, slope, covariance."""
    from ground.services.read_terrain import read_point

    return answer(await ask.do(read_point, mission_id, east_m, north_m))


@router.get("/missions/{mission_id}/history", response_model=Page[v.Event], responses=responses(404, 422))
async def list_history(
    ask: Asked,
    mission_id: Id,
    limit: Limit = 100,
    after: Annotated[int, Query(ge=0, le=2**53, description="events behind this number")] = 0,
    newest_first: bool = False,
) -> Response:
    """List the changes of a mission; `next_cursor` is the number to give as `after`."""
    from ground.services.list_history import list_history

    return answer(await ask.do(list_history, mission_id, after=after, limit=limit, newest_first=newest_first))


@router.post(
    "/missions/{mission_id}/undo", response_model=list[v.Event], responses=responses(400, 404, 409, 422)
)
async def undo(ask: Asked, mission_id: Id, body: UndoBody) -> Response:
    """Take back the last act; the answer holds the events that did it."""
    from ground.services.undo import undo

    return answer(await ask.do(undo, mission_id, anyone=body.anyone))


@router.post(
    "/missions/{mission_id}/redo", response_model=list[v.Event], responses=responses(400, 404, 409, 422)
)
async def redo(ask: Asked, mission_id: Id, body: UndoBody) -> Response:
    """Do again what was last taken back."""
    from ground.services.undo import redo

    return answer(await ask.do(redo, mission_id, anyone=body.anyone))


@router.get(
    "/missions/{mission_id}/archive",
    response_class=Response,
    responses={
        200: {"content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}}},
        **responses(404, 422),
    },
)
async def export_mission(ask: Asked, mission_id: Id) -> Response:
    """Send the whole mission as one archive: rows, history, terrain, products, each with its hash."""
    from ground.services.mission_archive import export_mission

    folder = Path(tempfile.mkdtemp(prefix="outcrop-archive-"))
    target = folder / f"outcrop-{mission_id}.zip"
    try:
        await ask.do(export_mission, mission_id, target)
    except BaseException:
        shutil.rmtree(folder)
        raise
    tidy = BackgroundTask(shutil.rmtree, folder)
    return FileResponse(target, media_type="application/zip", filename=target.name, background=tidy)


@router.post(
    "/missions/import", response_model=v.Mission, status_code=201, responses=responses(400, 404, 409, 422)
)
async def import_mission(ask: Asked, body: ArchiveImport) -> Response:
    """Take in a mission's archive that was uploaded; it keeps its ids and history."""
    from ground.services.mission_archive import import_mission
    from ground.services.store_upload import uploaded_file

    source = await call(uploaded_file, ask.repo, body.upload_id)
    mission = await ask.do(import_mission, source, name=body.name)
    return created(mission, f"/api/v1/missions/{mission.id}")
