"""Traverses: stops of recorded runs adjusted together, with the pictures their tie points are drawn on."""

from __future__ import annotations

from typing import Annotated

from fastapi import Path
from starlette.responses import FileResponse, Response

from ground.api.context import Asked, Id
from ground.api.problems import responses
from ground.api.resource_routes import resource_routes
from ground.resources.traverses.adjust_traverse import adjust_traverse, read_picture
from ground.resources.traverses.kind import TRAVERSE

router = resource_routes(
    TRAVERSE,
    "traverses",
    lists="List traverses.",
    starts=(
        adjust_traverse,
        "Match rocks between stops and adjust them: a job, whose subject is the traverse.\n\n"
        "Each stop but the first gets a new solution, `adjusted`, in the frame of the first; none is "
        "in use before\nsomebody chooses it.",
    ),
    reads="Read a traverse: stops before and after, legs with their verdicts and rock pairs.",
    changes="Change name or notes of a traverse.",
    deletes="Delete a traverse; the solutions that came of it stay.",
)


@router.get(
    "/traverses/{traverse_id}/pictures/{index}",
    response_class=Response,
    responses={200: {"content": {"image/png": {}}}, **responses(404, 422)},
)
async def get_traverse_picture(
    ask: Asked, traverse_id: Id, index: Annotated[int, Path(ge=0, le=99)]
) -> Response:
    """Send what a stop saw, as a cylinder of azimuths and elevations (`document.stops[].picture`)."""
    path = await ask.do(read_picture, traverse_id, index)
    return FileResponse(path, media_type="image/png", headers={"Cache-Control": "private, max-age=86400"})
