"""Endpoints: execute a package on the training rover, open the sol after."""

from __future__ import annotations

from starlette.responses import Response

from ground.api.context import Asked, Id, api_router, created
from ground.api.jobs_answer import JOB_ANSWERS, Prefer, accepted
from ground.api.problems import responses
from ground.jobs.value import Job
from ground.resources.executions.bodies import ExecutionCreate
from ground.resources.executions.execute_plan import execute_plan as execute_plan_use_case
from ground.resources.executions.open_next_sol import open_next_sol as open_next_sol_use_case
from ground.resources.sols.value import Sol

router = api_router("uplink")


@router.post("/plans/{plan_id}/execution", response_model=Job, status_code=202, responses=JOB_ANSWERS)
async def execute_plan(ask: Asked, plan_id: Id, body: ExecutionCreate, prefer: Prefer = None) -> Response:
    """Execute an uplinked plan on the mission's training rover: a job, whose result is the run."""
    job = await ask.do(execute_plan_use_case, plan_id, body)
    return await accepted(ask.repo, ask.who, job, prefer)


@router.post(
    "/runs/{run_id}/next-sol", response_model=Sol, status_code=201, responses=responses(404, 409, 422)
)
async def open_next_sol(ask: Asked, run_id: Id) -> Response:
    """Open the sol after an execution: where the rover stands now, with the requests that are left."""
    sol = await ask.do(open_next_sol_use_case, run_id)
    return created(sol, f"/api/v1/sols/{sol.id}")
