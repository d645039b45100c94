"""Path networks, planning problems and plans."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.responses import Response

from ground.api.context import (
    Cursor,
    FilterId,
    Id,
    IfMatch,
    Limit,
    Repo,
    Who,
    answer,
    call,
    no_content,
    revision_wanted,
)
from ground.api.jobs_answer import Prefer, accepted
from ground.api.problems import responses
from ground.api.schemas import (
    Page,
    PathNetworkCreate,
    PlanChange,
    PlanCreate,
    SummaryDocument,
    TreeDocument,
    WhatIf,
    set_members,
)
from ground.gdr import values as v
from ground.services.change_resource import change_resource
from ground.services.delete_resource import delete_resource
from ground.services.get_resource import get_resource
from ground.services.list_resources import list_resources

router = APIRouter(tags=["planning"], responses=responses(401, 403))


@router.get(
    "/missions/{mission_id}/path-networks", response_model=Page[v.PathNetwork], responses=responses(404, 422)
)
async def list_path_networks(
    repo: Repo, who: Who, mission_id: Id, limit: Limit = 20, cursor: Cursor = None
) -> Response:
    """List path networks with their geometry, oldest first."""
    return answer(
        await call(list_resources, repo, who, "path_network", mission_id, limit=limit, cursor=cursor)
    )


@router.post(
    "/missions/{mission_id}/path-networks",
    response_model=v.Job,
    status_code=202,
    responses={
        200: {"model": v.Job, "description": "Done in the time given by Prefer"},
        **responses(400, 404, 409, 422),
    },
)
async def create_path_network(
    repo: Repo, who: Who, mission_id: Id, body: PathNetworkCreate, prefer: Prefer = None
) -> Response:
    """Compute the path network: a job, whose subject is the network."""
    from ground.services.build_path_network import build_path_network

    job = await call(build_path_network, repo, who, mission_id, sol_id=body.sol_id)
    return await accepted(repo, who, job, prefer)


@router.get("/path-networks/{path_network_id}", response_model=v.PathNetwork, responses=responses(404, 422))
async def get_path_network(repo: Repo, who: Who, path_network_id: Id) -> Response:
    """Read a path network: nodes, segments, and the chance to lose each target on each."""
    return answer(await call(get_resource, repo, who, "path_network", path_network_id))


@router.get("/missions/{mission_id}/problems", response_model=Page[v.Problem], responses=responses(404, 422))
async def list_problems(
    repo: Repo, who: Who, mission_id: Id, limit: Limit = 20, cursor: Cursor = None
) -> Response:
    """List planning problems."""
    return answer(await call(list_resources, repo, who, "problem", mission_id, limit=limit, cursor=cursor))


@router.get("/problems/{problem_id}", response_model=v.Problem, responses=responses(404, 422))
async def get_problem(repo: Repo, who: Who, problem_id: Id) -> Response:
    """Read a planning problem; `document` has the form `problem/1`."""
    return answer(await call(get_resource, repo, who, "problem", problem_id))


@router.get("/missions/{mission_id}/plans", response_model=Page[v.Plan], responses=responses(404, 422))
async def list_plans(
    repo: Repo,
    who: Who,
    mission_id: Id,
    limit: Limit = 100,
    cursor: Cursor = None,
    state: v.PlanState | None = None,
    sol_id: FilterId = None,
) -> Response:
    """List plans, oldest first."""
    where = {"state": state, "sol_id": sol_id}
    return answer(
        await call(list_resources, repo, who, "plan", mission_id, limit=limit, cursor=cursor, where=where)
    )


@router.post(
    "/missions/{mission_id}/plans",
    response_model=v.Job,
    status_code=202,
    responses={
        200: {"model": v.Job, "description": "Done in the time given by Prefer"},
        **responses(400, 404, 409, 422),
    },
)
async def create_plan(
    repo: Repo, who: Who, mission_id: Id, body: PlanCreate, prefer: Prefer = None
) -> Response:
    """Ask for a plan: a job, whose subject is the plan (state draft until it is computed)."""
    from ground.services.generate_plan import PlanOrder, generate_plan

    order = PlanOrder(
        name=body.name,
        notes=body.notes,
        sol_id=body.sol_id,
        parent_id=body.parent_id,
        strategy=body.strategy,
        max_branches=body.max_branches,
        time_limit_s=body.time_limit_s,
        iterations=body.iterations,
        seed=body.seed,
        request_ids=tuple(body.request_ids),
        what_if=None if body.what_if is None else body.what_if.value(),
    )
    job = await call(generate_plan, repo, who, mission_id, order)
    return await accepted(repo, who, job, prefer)


@router.get("/plans/{plan_id}", response_model=v.Plan, responses=responses(404, 422))
async def get_plan(repo: Repo, who: Who, plan_id: Id) -> Response:
    """Read a plan: state, value, odds, digests."""
    return answer(await call(get_resource, repo, who, "plan", plan_id))


@router.patch("/plans/{plan_id}", response_model=v.Plan, responses=responses(400, 404, 409, 412, 422, 428))
async def change_plan(
    repo: Repo, who: Who, plan_id: Id, body: PlanChange, if_match: IfMatch = None
) -> Response:
    """Change name or notes of a plan; what was computed is never changed."""
    changes = set_members(body)
    return answer(await call(change_resource, repo, who, "plan", plan_id, changes, revision_wanted(if_match)))


@router.delete("/plans/{plan_id}", status_code=204, responses=responses(404, 409, 412, 422, 428))
async def delete_plan(repo: Repo, who: Who, plan_id: Id, if_match: IfMatch = None) -> Response:
    """Delete a plan that was neither approved nor run."""
    await call(delete_resource, repo, who, "plan", plan_id, revision_wanted(if_match))
    return no_content()


@router.get("/plans/{plan_id}/tree", response_model=TreeDocument, responses=responses(404, 409, 422))
async def get_plan_tree(repo: Repo, who: Who, plan_id: Id) -> Response:
    """Read the plan tree (`plan-tree/2`): steps, options, odds, quantiles."""
    from ground.services.read_plan import read_tree

    return answer(await call(read_tree, repo, who, plan_id))


@router.get(
    "/plans/{plan_id}/crl",
    response_class=Response,
    responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}, **responses(404, 409, 422)},
)
async def get_plan_crl(repo: Repo, who: Who, plan_id: Id, canonical: bool = False) -> Response:
    """Read the plan as CRL; with `canonical`, the text over which the digest is taken."""
    from ground.services.read_plan import read_crl

    text = await call(read_crl, repo, who, plan_id, canonical=canonical)
    return Response(text, media_type="text/plain; charset=utf-8")


@router.get("/plans/{plan_id}/summary", response_model=SummaryDocument, responses=responses(404, 409, 422))
async def get_plan_summary(repo: Repo, who: Who, plan_id: Id) -> Response:
    """Read the planner's summary."""
    from ground.services.read_plan import read_summary

    return answer(await call(read_summary, repo, who, plan_id))


@router.get("/plans/{plan_id}/findings", response_model=list[v.Finding], responses=responses(404, 409, 422))
async def get_plan_findings(repo: Repo, who: Who, plan_id: Id) -> Response:
    """List what the CRL validator found."""
    from ground.services.read_plan import read_findings

    return answer(await call(read_findings, repo, who, plan_id))


@router.get(
    "/plans/{plan_id}/why-not/{request_id}", response_model=v.WhyNot, responses=responses(404, 409, 422)
)
async def explain_request(repo: Repo, who: Who, plan_id: Id, request_id: Id) -> Response:
    """Say why a request is not in the plan: the limit, what it would displace, what would let it in."""
    from ground.services.explain_plan import explain_request

    return answer(await call(explain_request, repo, who, plan_id, request_id))


@router.get(
    "/plans/{plan_id}/comparison/{other_id}",
    response_model=v.PlanComparison,
    responses=responses(404, 409, 422),
)
async def compare_plans(repo: Repo, who: Who, plan_id: Id, other_id: Id) -> Response:
    """Compare two plans on the same futures: difference with its error, odds, the worst 5 %."""
    from ground.services.explain_plan import compare_plans

    return answer(await call(compare_plans, repo, who, plan_id, other_id))


@router.post(
    "/plans/{plan_id}/what-if", response_model=v.WhatIfAnswer, responses=responses(400, 404, 409, 422)
)
async def answer_what_if(repo: Repo, who: Who, plan_id: Id, body: WhatIf) -> Response:
    """Say at once what changes of the day are worth: to the plan as it is, and to one made for them."""
    from ground.services.answer_what_if import answer_what_if

    return answer(await call(answer_what_if, repo, who, plan_id, body.value()))
