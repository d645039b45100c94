"""Endpoints: approvals, waivers and flight rules."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Id, answer
from ground.api.problems import responses
from ground.api.resource_routes import resource_routes
from ground.resources.approvals.bodies import WaiverCreate
from ground.resources.approvals.check_flight_rules import check_flight_rules, waive_rule
from ground.resources.approvals.kind import APPROVAL
from ground.resources.approvals.value import FlightRuleResult

router = resource_routes(APPROVAL, "uplink", lists="List approvals, with those that are void.")


@router.get(
    "/plans/{plan_id}/flight-rules",
    response_model=list[FlightRuleResult],
    responses=responses(404, 409, 422),
)
async def get_flight_rules(ask: Asked, plan_id: Id) -> Response:
    """Check every flight rule against the plan."""
    return answer(await ask.do(check_flight_rules, plan_id))


@router.post(
    "/plans/{plan_id}/waivers",
    response_model=list[FlightRuleResult],
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_waiver(ask: Asked, plan_id: Id, body: WaiverCreate) -> Response:
    """Accept that one flight rule does not hold for this plan, with the reason."""
    return answer(await ask.do(waive_rule, plan_id, body.rule, body.reason), 201)
