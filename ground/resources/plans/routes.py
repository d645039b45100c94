"""Endpoints: plans."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Cursor, FilterId, Id, IfMatch, Limit, answer, api_router
from ground.api.jobs_answer import Prefer, accepted
from ground.api.problems import responses
from ground.jobs.value import Job
from ground.records.forms import Page
from ground.resources.plans.answer_what_if import answer_what_if as answer_what_if_use_case
from ground.resources.plans.bodies import PlanChange, PlanCreate, SummaryDocument, TreeDocument, WhatIf
from ground.resources.plans.explain_plan import compare_plans as compare_plans_use_case
from ground.resources.plans.explain_plan import explain_request as explain_request_use_case
from ground.resources.plans.generate_plan import PlanOrder, generate_plan
from ground.resources.plans.read_plan import read_crl, read_findings, read_summary, read_tree
from ground.resources.plans.study_value import PlanComparison, WhatIfAnswer, WhyNot
from ground.resources.plans.value import Finding, Plan, PlanState

router = api_router("planning")


@router.get("/missions/{mission_id}/plans", response_model=Page[Plan], responses=responses(404, 422))
async def list_plans(
    ask: Asked,
    mission_id: Id,
    limit: Limit = 100,
    cursor: Cursor = None,
    state: PlanState | None = None,
    sol_id: FilterId = None,
) -> Response:
    """List plans, oldest first."""
    where = {"state": state, "sol_id": sol_id}
    return await ask.page("plan", mission_id, limit, cursor, where)


@router.post(
    "/missions/{mission_id}/plans",
    response_model=Job,
    status_code=202,
    responses={
        200: {"model": Job, "description": "Done in the time given by Prefer"},
        **responses(400, 404, 409, 422),
    },
)
async def create_plan(ask: Asked, mission_id: Id, body: PlanCreate, prefer: Prefer = None) -> Response:
    """Ask for a plan: a job, whose subject is the plan (state draft until it is computed)."""
    order = PlanOrder(
        name=body.name,
        notes=body.notes,
        sol_id=body.sol_id,
        parent_id=body.parent_id,
        strategy=body.strategy,
        max_branches=body.max_branches,
        time_limit_s=body.time_limit_s,
        iterations=body.iterations,
        max_overrun_probability=body.max_overrun_probability,
        seed=body.seed,
        request_ids=tuple(body.request_ids),
        what_if=None if body.what_if is None else body.what_if.value(),
    )
    job = await ask.do(generate_plan, mission_id, order)
    return await accepted(ask.repo, ask.who, job, prefer)


@router.get("/plans/{plan_id}", response_model=Plan, responses=responses(404, 422))
async def get_plan(ask: Asked, plan_id: Id) -> Response:
    """Read a plan: state, value, odds, digests."""
    return await ask.one("plan", plan_id)


@router.patch("/plans/{plan_id}", response_model=Plan, responses=responses(400, 404, 409, 412, 422, 428))
async def change_plan(ask: Asked, plan_id: Id, body: PlanChange, if_match: IfMatch = None) -> Response:
    """Change name or notes of a plan; what was computed is never changed."""
    return await ask.change("plan", plan_id, body, if_match)


@router.delete("/plans/{plan_id}", status_code=204, responses=responses(404, 409, 412, 422, 428))
async def delete_plan(ask: Asked, plan_id: Id, if_match: IfMatch = None) -> Response:
    """Delete a plan that was neither approved nor run."""
    return await ask.delete("plan", plan_id, if_match)


@router.get("/plans/{plan_id}/tree", response_model=TreeDocument, responses=responses(404, 409, 422))
async def get_plan_tree(ask: Asked, plan_id: Id) -> Response:
    """Read the plan tree (`plan-tree/2`): steps, options, odds, quantiles."""
    return answer(await ask.do(read_tree, plan_id))


@router.get(
    "/plans/{plan_id}/crl",
    response_class=Response,
    responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}, **responses(404, 409, 422)},
)
async def get_plan_crl(ask: Asked, plan_id: Id, canonical: bool = False) -> Response:
    """Read the plan as CRL; with `canonical`, the text over which the digest is taken."""
    text = await ask.do(read_crl, plan_id, canonical=canonical)
    return Response(text, media_type="text/plain; charset=utf-8")


@router.get("/plans/{plan_id}/summary", response_model=SummaryDocument, responses=responses(404, 409, 422))
async def get_plan_summary(ask: Asked, plan_id: Id) -> Response:
    """Read the planner's summary."""
    return answer(await ask.do(read_summary, plan_id))


@router.get("/plans/{plan_id}/findings", response_model=list[Finding], responses=responses(404, 409, 422))
async def get_plan_findings(ask: Asked, plan_id: Id) -> Response:
    """List what the CRL validator found."""
    return answer(await ask.do(read_findings, plan_id))


@router.get(
    "/plans/{plan_id}/why-not/{request_id}", response_model=WhyNot, responses=responses(404, 409, 422)
)
async def explain_request(ask: Asked, plan_id: Id, request_id: Id) -> Response:
    """Say why a request is not in the plan: the limit, what it would displace, what would let it in."""
    return answer(await ask.do(explain_request_use_case, plan_id, request_id))


@router.get(
    "/plans/{plan_id}/comparison/{other_id}",
    response_model=PlanComparison,
    responses=responses(404, 409, 422),
)
async def compare_plans(ask: Asked, plan_id: Id, other_id: Id) -> Response:
    """Compare two plans on the same futures: difference with its error, odds, the worst 5 %."""
    return answer(await ask.do(compare_plans_use_case, plan_id, other_id))


@router.post("/plans/{plan_id}/what-if", response_model=WhatIfAnswer, responses=responses(400, 404, 409, 422))
async def answer_what_if(ask: Asked, plan_id: Id, body: WhatIf) -> Response:
    """Say at once what changes of the day are worth: to the plan as it is, and to one made for them."""
    return answer(await ask.do(answer_what_if_use_case, plan_id, body.value()))
