"""Endpoints: new missions."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, api_router, created
from ground.api.problems import responses
from ground.resources.mission_setup.bodies import MissionCreate
from ground.resources.mission_setup.open_mission import open_mission
from ground.resources.missions.value import Mission

router = api_router("missions")


@router.post("/missions", response_model=Mission, status_code=201, responses=responses(400, 404, 409, 422))
async def create_mission(ask: Asked, body: MissionCreate) -> Response:
    """Open a mission on a generated, uploaded or the demo terrain."""
    mission = await ask.do(open_mission, body)
    return created(mission, f"/api/v1/missions/{mission.id}")
