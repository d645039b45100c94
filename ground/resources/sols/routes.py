"""Sols: one day of work each."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Cursor, Id, IfMatch, Limit, api_router, created
from ground.api.problems import responses
from ground.records.forms import Page
from ground.resources.sols.bodies import SolChange, SolCreate
from ground.resources.sols.create_sol import create_sol as open_sol
from ground.resources.sols.value import Sol

router = api_router("sols")


@router.get("/missions/{mission_id}/sols", response_model=Page[Sol], responses=responses(404, 422))
async def list_sols(ask: Asked, mission_id: Id, limit: Limit = 100, cursor: Cursor = None) -> Response:
    """List the sols of a mission."""
    return await ask.page("sol", mission_id, limit, cursor)


@router.post(
    "/missions/{mission_id}/sols",
    response_model=Sol,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_sol(ask: Asked, mission_id: Id, body: SolCreate) -> Response:
    """Open a sol; what is left out has a default."""
    value = await ask.do(open_sol, mission_id, body)
    return created(value, f"/api/v1/sols/{value.id}")


@router.get("/sols/{sol_id}", response_model=Sol, responses=responses(404, 422))
async def get_sol(ask: Asked, sol_id: Id) -> Response:
    """Read a sol."""
    return await ask.one("sol", sol_id)


@router.patch("/sols/{sol_id}", response_model=Sol, responses=responses(400, 404, 409, 412, 422, 428))
async def change_sol(ask: Asked, sol_id: Id, body: SolChange, if_match: IfMatch = None) -> Response:
    """Change a sol; plans made before become stale."""
    return await ask.change("sol", sol_id, body, if_match)


@router.delete("/sols/{sol_id}", status_code=204, responses=responses(404, 409, 412, 422, 428))
async def delete_sol(ask: Asked, sol_id: Id, if_match: IfMatch = None) -> Response:
    """Delete a sol that has no plans."""
    return await ask.delete("sol", sol_id, if_match)
