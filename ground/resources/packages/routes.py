"""Endpoints: what people sign of a plan, and uplink packages."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Id, answer, api_router, created
from ground.api.problems import responses
from ground.resources.packages.bodies import SignatureCreate
from ground.resources.packages.package_plan import package_plan as package_plan_use_case
from ground.resources.packages.sign_plan import Given
from ground.resources.packages.sign_plan import sign_plan as sign_plan_use_case
from ground.resources.packages.statement import make_statement as make_statement_use_case
from ground.resources.packages.statement import read_statement
from ground.resources.packages.value import Statement

router = api_router("uplink")


@router.get("/plans/{plan_id}/statement", response_model=Statement | None, responses=responses(404, 422))
async def get_statement(ask: Asked, plan_id: Id) -> Response:
    """Read what is signed of a plan, and by whom it was; null if nothing was made to be signed yet."""
    return answer(await ask.do(read_statement, plan_id))


@router.post(
    "/plans/{plan_id}/statement",
    response_model=Statement,
    status_code=201,
    responses=responses(404, 409, 422),
)
async def make_statement(ask: Asked, plan_id: Id) -> Response:
    """Make what is to be signed of a verified plan; the last one again as long as it holds."""
    return created(await ask.do(make_statement_use_case, plan_id), f"/api/v1/plans/{plan_id}/statement")


@router.post(
    "/plans/{plan_id}/signatures",
    response_model=Statement,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def sign_plan(ask: Asked, plan_id: Id, body: SignatureCreate) -> Response:
    """Hand in one's own signature as author, verifier or approver; the last makes the plan approved."""
    given = Given(body.role, body.sha256, body.key, body.signature, body.note)
    return created(await ask.do(sign_plan_use_case, plan_id, given), f"/api/v1/plans/{plan_id}/statement")


@router.post(
    "/plans/{plan_id}/package",
    response_class=Response,
    responses={
        200: {"content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}}},
        **responses(404, 409, 422),
    },
)
async def package_plan(ask: Asked, plan_id: Id) -> Response:
    """Make the uplink package of an approved plan from what people signed; the plan is uplinked with it."""
    package = await ask.do(package_plan_use_case, plan_id)
    headers = {
        "Content-Disposition": f'attachment; filename="{package.file_name}"',
        "ETag": f'"{package.sha256}"',
    }
    return Response(package.content, media_type="application/zip", headers=headers)
