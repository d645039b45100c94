"""Endpoints: rovers."""

from __future__ import annotations

from typing import Annotated

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


@router.get("/rovers/{name}", response_model=Rover, responses=responses(404, 422))
async def read_rover(ask: Asked, name: RoverName) -> Response:
    """Read a rover: instruments and their costs, actions, telemetry keys, kinds of constraint."""
    return answer(await ask.do(rovers.show_rover, name))
