"""Endpoints: calibrations of a mission's path network."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Id, api_router
from ground.api.jobs_answer import Prefer, accepted
from ground.api.problems import responses
from ground.jobs.value import Job
from ground.resources.calibrations.bodies import MissionCalibrate
from ground.resources.calibrations.calibrate_mission import calibrate_mission as calibrate_mission_use_case

router = api_router("missions")


@router.post(
    "/missions/{mission_id}/calibrate",
    response_model=Job,
    status_code=202,
    responses={
        200: {"model": Job, "description": "Done in the time given by Prefer"},
        **responses(400, 404, 409, 422),
    },
)
async def calibrate_mission(
    ask: Asked, mission_id: Id, body: MissionCalibrate, prefer: Prefer = None
) -> Response:
    """Learn loss, duration and energy parameters from recorded runs: a job; plans made after it use them."""
    job = await ask.do(calibrate_mission_use_case, mission_id, run_ids=body.run_ids, name=body.name)
    return await accepted(ask.repo, ask.who, job, prefer)
