"""Endpoints: rovers."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Path
from pydantic import BaseModel
from starlette.responses import Response

from ground.api.context import Asked, answer, api_router
from ground.api.problems import responses
from ground.resources.rovers import read_rover as rovers
from ground.resources.rovers.value import Rover, RoverSummary

router = api_router("rovers")
RoverName = Annotated[str, Path(min_length=1, max_length=80, examples=["k9"])]


class Rovers(BaseModel):
    """The rovers that missions may have."""

    items: list[RoverSummary]


@router.get("/rovers", response_model=Rovers)
async def list_rovers(ask: Asked) -> Response:
    """List the rovers that missions may have: those of the program and of installed packages."""
    return answer({"items": await ask.do(rovers.list_rovers)})


EXAMPLE = {
    "name": "my-rover",
    "version": "1",
    "doc": "a rover with one instrument",
    "profile_sha256": "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
    "dictionary": "my-rover",
    "dictionary_version": "1",
    "dictionary_sha256": "60303ae22b998861bce3b28f33eec1be758a213c86c93c076dbe9f558c11c752",
    "instruments": [
        {
            "name": "spectrometer",
            "profile_name": "spectrometer",
            "doc": "infrared spectrometer on the mast",
            "use": "remote",
            "action": "image",
            "tracked": False,
            "time_s": {"mean": 300.0, "sd": 20.0},
            "energy_j": {"mean": 4000.0, "sd": 300.0},
            "data_mbit": 4.0,
            "p_success": 1.0,
            "standoff_m": 1.5,
            "field_of_view_rad": 0.02,
            "camera": "pancam_left",
        }
    ],
    "actions": [
        {
            "name": "wait",
            "doc": "Do nothing for a while.",
            "parameters": [
                {
                    "name": "duration_s",
                    "type": "number",
                    "unit": "s",
                    "required": True,
                    "minimum": 0,
                    "maximum": None,
                    "choices": [],
                    "doc": "how long",
                }
            ],
            "results": [],
            "one_of": [],
            "needs": [],
            "activity": "",
            "instrument": "",
            "duration": "duration_s",
        }
    ],
    "telemetry": [],
    "constraints": [
        {"kind": "tracked", "doc": "The target's track is alive when the observation starts.", "form": {}}
    ],
    "trackers": ["ncc"],
    "handoffs": ["cascade"],
}
SHOWN: dict[int | str, dict[str, Any]] = {200: {"content": {"application/json": {"example": EXAMPLE}}}}


@router.get("/rovers/{name}", response_model=Rover, responses={**SHOWN, **responses(404, 422)})
async def read_rover(ask: Asked, name: RoverName) -> Response:
    """Read a rover: instruments and their costs, actions, telemetry keys, kinds of constraint."""
    return answer(await ask.do(rovers.show_rover, name))
