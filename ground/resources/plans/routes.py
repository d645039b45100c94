"""Endpoints: plans."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import PREFIX, Asked, Id, answer, created
from ground.api.problems import responses
from ground.api.resource_routes import resource_routes, start_route
from ground.resources.plans.answer_what_if import answer_what_if as answer_what_if_use_case
from ground.resources.plans.bodies import (
    CrlCheck,
    DraftDocument,
    PlanEdit,
    PlanMergeCreate,
    SummaryDocument,
    TreeDocument,
    WhatIf,
)
from ground.resources.plans.edit_plan import check_crl as check_crl_use_case
from ground.resources.plans.edit_plan import edit_plan as edit_plan_use_case
from ground.resources.plans.explain_plan import compare_plans as compare_plans_use_case
from ground.resources.plans.explain_plan import differ_plans as differ_plans_use_case
from ground.resources.plans.explain_plan import explain_request as explain_request_use_case
from ground.resources.plans.generate_plan import generate_plan
from ground.resources.plans.kind import PLAN
from ground.resources.plans.merge_plans import merge_plans as merge_plans_use_case
from ground.resources.plans.read_plan import read_crl, read_draft, read_findings, read_summary, read_tree
from ground.resources.plans.sol_path import ask_sol_path, read_sol_path
from ground.resources.plans.sol_path_bodies import SolPathCreate, SolPathDocument
from ground.resources.plans.study_value import PlanComparison, WhatIfAnswer, WhyNot
from ground.resources.plans.value import CrlFinding, Finding, Plan, PlanMerge
from ground.versions.difference import PlanDifference

router = resource_routes(
    PLAN,
    "planning",
    lists="List plans, oldest first.",
    starts=(
        generate_plan,
        "Ask for a plan: a job, whose subject is the plan (state draft until it is computed).",
    ),
    reads="Read a plan: state, value, odds, digests.",
    changes="Change name or notes of a plan; what was computed is never changed.",
    deletes="Delete a plan that was neither approved nor run.",
)


start_route(
    router,
    "/missions/{mission_id}/sol-paths",
    "create_sol_path",
    SolPathCreate,
    ask_sol_path,
    "Ask for a plan of the first of several sols: a job, whose subject is that plan.\n\n"
    "What the later sols are worth stands in its sol path.",
)


@router.get("/plans/{plan_id}/sol-path", response_model=SolPathDocument, responses=responses(404, 409, 422))
async def get_sol_path(ask: Asked, plan_id: Id) -> Response:
    """Read the sol path (`sol-path/1`) that a plan begins: each sol, its worth, and a bound on all."""
    return answer(await ask.do(read_sol_path, plan_id))


@router.get("/plans/{plan_id}/tree", response_model=TreeDocument, responses=responses(404, 409, 422))
async def get_plan_tree(ask: Asked, plan_id: Id) -> Response:
    """Read the plan tree (`plan-tree/2`): steps, options, odds, quantiles."""
    return answer(await ask.do(read_tree, plan_id))


@router.get("/plans/{plan_id}/draft", response_model=DraftDocument | None, responses=responses(404, 422))
async def get_plan_draft(ask: Asked, plan_id: Id) -> Response:
    """Read the best plan so far while the search goes on (`plan-draft/1`); null when there is none."""
    return answer(await ask.do(read_draft, plan_id))


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


@router.get(
    "/plans/{plan_id}/difference/{other_id}",
    response_model=PlanDifference,
    responses=responses(404, 409, 422),
)
async def differ_plans(ask: Asked, plan_id: Id, other_id: Id) -> Response:
    """Say what differs between two plans by meaning: steps, branches, conditions, windows."""
    return answer(await ask.do(differ_plans_use_case, plan_id, other_id))


@router.post(
    "/missions/{mission_id}/plan-merges",
    response_model=PlanMerge,
    responses=responses(400, 404, 409, 422),
)
async def merge_plans(ask: Asked, mission_id: Id, body: PlanMergeCreate) -> Response:
    """Join two edits of a plan into a new one, or name the conflicts; a side can be taken in each."""
    return answer(await ask.do(merge_plans_use_case, mission_id, body))


@router.post(
    "/plans/{plan_id}/crl-check", response_model=list[CrlFinding], responses=responses(400, 404, 409, 422)
)
async def check_crl(ask: Asked, plan_id: Id, body: CrlCheck) -> Response:
    """Check a text as if it were an edit of the plan: findings with place and hint. Nothing is kept."""
    return answer(await ask.do(check_crl_use_case, plan_id, body.crl))


@router.post(
    "/plans/{plan_id}/edits",
    response_model=Plan,
    status_code=201,
    responses=responses(400, 404, 409, 422),
)
async def edit_plan(ask: Asked, plan_id: Id, body: PlanEdit) -> Response:
    """Keep the edited text of a plan as a new plan; refused while the validator finds an error in it."""
    made = await ask.do(edit_plan_use_case, plan_id, body)
    return created(made, f"{PREFIX}/plans/{made.id}")


@router.post("/plans/{plan_id}/what-if", response_model=WhatIfAnswer, responses=responses(400, 404, 409, 422))
async def answer_what_if(ask: Asked, plan_id: Id, body: WhatIf) -> Response:
    """Say at once what changes of the day are worth: to the plan as it is, and to one made for them."""
    return answer(await ask.do(answer_what_if_use_case, plan_id, body.value()))
