"""Endpoints: path networks."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Cursor, Id, Limit, api_router
from ground.api.jobs_answer import Prefer, accepted
from ground.api.problems import responses
from ground.jobs.value import Job
from ground.records.forms import Page
from ground.resources.path_networks.bodies import PathNetworkCreate
from ground.resources.path_networks.build_path_network import build_path_network
from ground.resources.path_networks.value import PathNetwork

router = api_router("planning")


@router.get(
    "/missions/{mission_id}/path-networks", response_model=Page[PathNetwork], responses=responses(404, 422)
)
async def list_path_networks(
    ask: Asked, mission_id: Id, limit: Limit = 20, cursor: Cursor = None
) -> Response:
    """List path networks with their geometry, oldest first."""
    return await ask.page("path_network", mission_id, limit, cursor)


@router.post(
    "/missions/{mission_id}/path-networks",
    response_model=Job,
    status_code=202,
    responses={
        200: {"model": Job, "description": "Done in the time given by Prefer"},
        **responses(400, 404, 409, 422),
    },
)
async def create_path_network(
    ask: Asked, mission_id: Id, body: PathNetworkCreate, prefer: Prefer = None
) -> Response:
    """Compute the path network: a job, whose subject is the network."""
    job = await ask.do(build_path_network, mission_id, sol_id=body.sol_id)
    return await accepted(ask.repo, ask.who, job, prefer)


@router.get("/path-networks/{path_network_id}", response_model=PathNetwork, responses=responses(404, 422))
async def get_path_network(ask: Asked, path_network_id: Id) -> Response:
    """Read a path network: nodes, segments, and the chance to lose each target on each."""
    return await ask.one("path_network", path_network_id)
