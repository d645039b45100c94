"""Endpoints: lineage."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Id, answer, api_router
from ground.api.problems import responses
from ground.resources.lineage.trace_lineage import trace_lineage
from ground.resources.lineage.value import Lineage

router = api_router("lineage")


@router.get("/products/{product_id}/lineage", response_model=Lineage, responses=responses(404, 422))
async def get_product_lineage(ask: Asked, product_id: Id) -> Response:
    """Follow a data product back to run, CRL task, observation request and target."""
    return answer(await ask.do(trace_lineage, "product", product_id))


@router.get("/targets/{target_id}/lineage", response_model=Lineage, responses=responses(404, 422))
async def get_target_lineage(ask: Asked, target_id: Id) -> Response:
    """Follow a target to its requests, plans, runs and data products."""
    return answer(await ask.do(trace_lineage, "target", target_id))


@router.get(
    "/observation-requests/{observation_request_id}/lineage",
    response_model=Lineage,
    responses=responses(404, 422),
)
async def get_observation_request_lineage(ask: Asked, observation_request_id: Id) -> Response:
    """Follow a request to its target, plans, runs and data products."""
    return answer(await ask.do(trace_lineage, "observation_request", observation_request_id))
