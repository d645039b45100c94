"""Approval, flight rules, uplink packages."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Cursor, Id, Limit, answer, api_router, created
from ground.api.problems import responses
from ground.api.schemas import ApprovalCreate, Page, RunIngest, WaiverCreate
from ground.gdr import values as v

router = api_router("uplink")


@router.get(
    "/missions/{mission_id}/approvals", response_model=Page[v.Approval], responses=responses(404, 422)
)
async def list_approvals(ask: Asked, mission_id: Id, limit: Limit = 100, cursor: Cursor = None) -> Response:
    """List approvals, with those that are void."""
    return await ask.page("approval", mission_id, limit, cursor)


@router.get(
    "/plans/{plan_id}/flight-rules",
    response_model=list[v.FlightRuleResult],
    responses=responses(404, 409, 422),
)
async def get_flight_rules(ask: Asked, plan_id: Id) -> Response:
    """Hold every flight rule against the plan."""
    from ground.services.check_flight_rules import check_flight_rules

    return answer(await ask.do(check_flight_rules, plan_id))


@router.post(
    "/plans/{plan_id}/waivers",
    response_model=list[v.FlightRuleResult],
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def create_waiver(ask: Asked, plan_id: Id, body: WaiverCreate) -> Response:
    """Accept that one flight rule does not hold for this plan, with the reason."""
    from ground.services.check_flight_rules import waive_rule

    return answer(await ask.do(waive_rule, plan_id, body.rule, body.reason), 201)


@router.post(
    "/plans/{plan_id}/approval",
    response_model=v.Approval,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def approve_plan(ask: Asked, plan_id: Id, body: ApprovalCreate) -> Response:
    """Approve a verified plan; not one's own, and only with the digest that was read."""
    from ground.services.approve_plan import approve_plan

    approval = await ask.do(approve_plan, plan_id, body.crl_sha256, body.note)
    return created(approval, f"/api/v1/missions/{approval.mission_id}/approvals")


@router.post(
    "/plans/{plan_id}/package",
    response_class=Response,
    responses={
        200: {"content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}}},
        **responses(404, 409, 422, 503),
    },
)
async def package_plan(ask: Asked, plan_id: Id) -> Response:
    """Make the signed uplink package of an approved plan; the plan is uplinked with it."""
    from ground.services.package_plan import package_plan

    package = await ask.do(package_plan, plan_id)
    headers = {
        "Content-Disposition": f'attachment; filename="{package.file_name}"',
        "ETag": f'"{package.sha256}"',
    }
    return Response(package.content, media_type="application/zip", headers=headers)


@router.post(
    "/runs/ingest",
    response_model=v.Run,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def ingest_run(ask: Asked, body: RunIngest) -> Response:
    """Take in the folder of an execution (an uploaded zip) and tie its products to what asked for them."""
    from ground.services.ingest_run import ingest_upload

    run = await ask.do(ingest_upload, body.upload_id)
    return created(run, f"/api/v1/runs/{run.id}")
