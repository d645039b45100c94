"""Endpoints: approvals, waivers and flight rules."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Cursor, Id, Limit, answer, api_router
from ground.api.problems import responses
from ground.records.forms import Page
from ground.resources.approvals.bodies import WaiverCreate
from ground.resources.approvals.check_flight_rules import check_flight_rules, waive_rule
from ground.resources.approvals.value import Approval, FlightRuleResult

router = api_router("uplink")


@router.get("/missions/{mission_id}/approvals", response_model=Page[Approval], responses=responses(404, 422))
async def list_approvals(ask: Asked, mission_id: Id, limit: Limit = 100, cursor: Cursor = None) -> Response:
    """List approvals, with those that are void."""
    return await ask.page("approval", mission_id, limit, cursor)


@router.get(
    "/plans/{plan_id}/flight-rules",
    response_model=list[FlightRuleResult],
    responses=responses(404, 409, 422),
)
async def get_flight_rules(ask: Asked, plan_id: Id) -> Response:
    """Hold every flight rule against the plan."""
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
