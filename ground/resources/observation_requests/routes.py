"""Observation requests: what a scientist asks of a target."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Cursor, FilterId, Id, IfMatch, Limit, api_router, created
from ground.api.problems import responses
from ground.records.forms import Page
from ground.resources.observation_requests.bodies import ObservationRequestChange, ObservationRequestCreate
from ground.resources.observation_requests.create_request import create_request
from ground.resources.observation_requests.value import ObservationRequest, RequestState

router = api_router("observation requests")


@router.get(
    "/missions/{mission_id}/observation-requests",
    response_model=Page[ObservationRequest],
    responses=responses(404, 422),
)
async def list_observation_requests(
    ask: Asked,
    mission_id: Id,
    limit: Limit = 100,
    cursor: Cursor = None,
    target_id: FilterId = None,
    state: RequestState | None = None,
) -> Response:
    """List observation requests, of one target or in one state if wanted."""
    return await ask.page(
        "observation_request", mission_id, limit, cursor, where={"target_id": target_id, "state": state}
    )


@router.post(
    "/missions/{mission_id}/observation-requests",
    response_model=ObservationRequest,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_observation_request(ask: Asked, mission_id: Id, body: ObservationRequestCreate) -> Response:
    """File an observation request; the observation point is found by base placement."""
    value = await ask.do(create_request, mission_id, body)
    return created(value, f"/api/v1/observation-requests/{value.id}")


@router.get(
    "/observation-requests/{observation_request_id}",
    response_model=ObservationRequest,
    responses=responses(404, 422),
)
async def get_observation_request(ask: Asked, observation_request_id: Id) -> Response:
    """Read an observation request."""
    return await ask.one("observation_request", observation_request_id)


@router.patch(
    "/observation-requests/{observation_request_id}",
    response_model=ObservationRequest,
    responses=responses(400, 404, 409, 412, 422, 428),
)
async def change_observation_request(
    ask: Asked, observation_request_id: Id, body: ObservationRequestChange, if_match: IfMatch = None
) -> Response:
    """Change an observation request."""
    return await ask.change("observation_request", observation_request_id, body, if_match)


@router.delete(
    "/observation-requests/{observation_request_id}",
    status_code=204,
    responses=responses(404, 409, 412, 422, 428),
)
async def delete_observation_request(
    ask: Asked, observation_request_id: Id, if_match: IfMatch = None
) -> Response:
    """Delete an observation request."""
    return await ask.delete("observation_request", observation_request_id, if_match)
