"""Endpoints: calibrations of a mission's path network."""

from __future__ import annotations

from ground.api.context import api_router
from ground.api.resource_routes import start_route
from ground.resources.calibrations.bodies import MissionCalibrate
from ground.resources.calibrations.calibrate_mission import calibrate_mission

router = api_router("missions")
start_route(
    router,
    "/missions/{mission_id}/calibrate",
    "calibrate_mission",
    MissionCalibrate,
    calibrate_mission,
    "Learn loss, duration and energy parameters from recorded runs: a job; plans made after it use them.",
)
