"""Endpoints: missions as archives and as copies."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import ZIP, Asked, Id, answer, api_router, archive, created
from ground.api.problems import responses
from ground.resources.mission_archives.bodies import ArchiveImport, MissionCopy
from ground.resources.mission_archives.copy_mission import copy_mission as copy_mission_use_case
from ground.resources.mission_archives.import_mission import import_mission as import_mission_use_case
from ground.resources.mission_archives.mission_archive import export_mission as export_mission_use_case
from ground.resources.mission_archives.read_elsewhere import read_elsewhere
from ground.resources.missions.value import Elsewhere, Mission
from ground.resources.uploads.store_upload import uploaded_file

router = api_router("missions")


@router.post(
    "/missions/{mission_id}/copy",
    response_model=Mission,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def copy_mission(ask: Asked, mission_id: Id, body: MissionCopy) -> Response:
    """Copy a mission with its sols, targets, requests and keep-outs: a what-if of its own."""
    mission = await ask.do(copy_mission_use_case, mission_id, name=body.name, notes=body.notes)
    return created(mission, f"/api/v1/missions/{mission.id}")


@router.get(
    "/missions/{mission_id}/archive", response_class=Response, responses={**ZIP, **responses(404, 422)}
)
async def export_mission(ask: Asked, mission_id: Id) -> Response:
    """Send the whole mission as one archive: rows, history, terrain, products, each with its hash."""
    return await archive(
        f"outcrop-{mission_id}.zip", lambda target: ask.do(export_mission_use_case, mission_id, target)
    )


@router.post(
    "/missions/import", response_model=Mission, status_code=201, responses=responses(400, 404, 409, 422)
)
async def import_mission(ask: Asked, body: ArchiveImport) -> Response:
    """Take in a mission's archive that was uploaded; it keeps its ids and history."""
    source = await ask.do(uploaded_file, body.upload_id)
    mission = await ask.do(import_mission_use_case, source, name=body.name)
    return created(mission, f"/api/v1/missions/{mission.id}")


@router.get("/missions/{mission_id}/elsewhere", response_model=list[Elsewhere], responses=responses(404, 422))
async def get_elsewhere(ask: Asked, mission_id: Id) -> Response:
    """Read what the archives of a mission say was approved, packaged and done elsewhere; no right follows."""
    return answer(await ask.do(read_elsewhere, mission_id))
