"""Ask the planner for a plan: a job."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import Any

import orjson
from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.day.rovers import profile_of
from ground.errors import InvalidInputError, NotFoundError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.jobs.kind import show_jobs
from ground.jobs.queue import WAKE, enqueue
from ground.jobs.row import JobRow
from ground.jobs.value import Job
from ground.records.actor import SYSTEM_ACTOR, Action, Actor
from ground.records.edit import insert, next_number, update
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import terrain_row
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.path_networks.kind import PATH_NETWORK
from ground.resources.path_networks.row import PathNetworkRow
from ground.resources.plans.answer_what_if import keep_outs_of
from ground.resources.plans.kind import PLAN
from ground.resources.plans.order import ORDERS, PlanWork, Search
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.resources.problems.inputs_digest import inputs_digest
from ground.resources.problems.kind import PROBLEM
from ground.resources.problems.mission_day import choose_sol, mission_day, worksite
from ground.resources.problems.row import ProblemRow
from mission import Day
from planner.changes import Changes

KIND = "generate_plan"


@dataclass(frozen=True, slots=True)
class PlanOrder:
    """What is asked of the planner.

    With `max_overrun_probability` the plan keeps the chance of ending over a budget within it. A what-if of a
    parent keeps to the parent's unless it has its own.
    """

    name: str | None = None
    notes: str = ""
    sol_id: str | None = None
    parent_id: str | None = None
    strategy: str = "optimal"
    max_branches: int = 8
    time_limit_s: float = 20.0
    iterations: int | None = None
    max_overrun_probability: float | None = None
    seed: int = 1
    request_ids: tuple[str, ...] = ()
    what_if: Changes | None = None


def generate_plan(repo: Repository, actor: Actor, mission_id: str, order: PlanOrder) -> Job:
    """Return the job whose subject is the new plan, a draft until it is computed."""
    actor.require(Action.PLAN, mission_id)
    with repo.database.write() as session:
        mission = session.get(MissionRow, mission_id)
        if mission is None:
            raise NotFoundError(f"there is no mission {mission_id}")
        if order.parent_id is not None:
            parent = session.get(PlanRow, order.parent_id)
            if parent is None or parent.mission_id != mission_id:
                raise InvalidInputError(
                    f"there is no plan {order.parent_id} in mission {mission_id}", pointer="/parent_id"
                )
            if order.what_if is not None and order.max_overrun_probability is None:
                order = replace(order, max_overrun_probability=_allowed(session, parent))
        language = profile_of(mission.rover_profile).language
        sol = choose_sol(session, mission_id, order.sol_id)
        day = mission_day(session, mission, sol, order.request_ids)
        limits = replace(day.limits, max_overrun_probability=order.max_overrun_probability)
        day = replace(day, limits=limits)
        inputs = inputs_digest(session, mission_id)
        if order.what_if is not None:
            day, inputs = _changed(day, inputs, order.what_if)
        plan_id, job_id = new_id("pln"), new_id("job")
        number = next_number(session, PlanRow, mission_id)
        row = PlanRow(
            id=plan_id,
            author=actor.name,
            mission_id=mission_id,
            sol_id=sol.id,
            parent_id=order.parent_id,
            number=number,
            name=order.name or (f"Plan {number}" if order.what_if is None else f"What-if {number}"),
            notes=order.notes or ("" if order.what_if is None else f"What if: {order.what_if.in_words()}."),
            state=PlanState.DRAFT.value,
            strategy=order.strategy,
            max_branches=order.max_branches,
            time_limit_s=order.time_limit_s,
            iterations=order.iterations,
            seed=order.seed,
            job_id=job_id,
            inputs_sha256=inputs,
            terrain_sha256=terrain_row(session, mission_id).sha256,
            dictionary=f"{language.name} {language.version}",
            rover_profile=mission.rover_profile,
            findings=[],
            request_ids=list(order.request_ids),
            planned_request_ids=[],
            left_out={},
        )
        insert(session, actor, PLAN, row)
        search = Search(order.strategy, order.max_branches, order.time_limit_s, order.iterations, order.seed)
        work = PlanWork(worksite(repo, session, mission), day, plan_id, search, order.what_if)
        job = enqueue(
            session,
            repo.settings,
            kind=KIND,
            mission_id=mission_id,
            subject_kind="plan",
            subject_id=plan_id,
            payload=ORDERS.document(work),
            author=actor.name,
            job_id=job_id,
        )
        value = show_jobs(session, [job])[0]
    WAKE.set()
    return value


def _allowed(session: Session, plan: PlanRow) -> float | None:
    """Return the chance of an overrun that a plan was asked to keep to."""
    problem = session.get(ProblemRow, plan.problem_id) if plan.problem_id is not None else None
    return None if problem is None else problem.document.get("max_overrun_probability")


def _changed(day: Day, inputs: str, changes: Changes) -> tuple[Day, str]:
    """Return the day with the keep-outs of a what-if, and a digest that no state of the mission ever has.

    So the plan counts as stale from the beginning: it answers another question and cannot be approved.
    """
    if changes.keep_outs is not None:
        day = replace(day, keep_outs=keep_outs_of(changes))
    return day, hashlib.sha256(orjson.dumps([inputs, changes.as_dict()])).hexdigest()


def settle(_repo: Repository, session: Session, job: JobRow, result: dict[str, Any]) -> str | None:
    """Write plan, problem and network; requests in the plan become planned."""
    plan = session.get(PlanRow, job.subject_id)
    if plan is None:
        return None
    problem = ProblemRow(
        id=new_id("prb"),
        author=plan.author,
        mission_id=plan.mission_id,
        sha256=result["problem_sha256"],
        document=result["problem"],
    )
    network = PathNetworkRow(
        id=new_id("net"),
        author=plan.author,
        mission_id=plan.mission_id,
        job_id=job.id,
        inputs_sha256=plan.inputs_sha256,
        geometry=result["geometry"],
    )
    insert(session, SYSTEM_ACTOR, PROBLEM, problem)
    insert(session, SYSTEM_ACTOR, PATH_NETWORK, network)
    columns = {
        name: result[name]
        for name in (
            "status",
            "tree",
            "crl_text",
            "crl_sha256",
            "problem_sha256",
            "findings",
            "planned_request_ids",
            "left_out",
            "expected_utility",
            "standard_error",
            "lower",
            "upper",
            "branches",
            "summary",
        )
    }
    if result.get("stopped"):
        columns["notes"] = " ".join(filter(None, (plan.notes, result["stopped"])))
    columns |= {"state": PlanState.COMPUTED.value, "problem_id": problem.id, "network_id": network.id}
    update(session, SYSTEM_ACTOR, PLAN, plan, columns, action="compute")
    planned = set(result["planned_request_ids"])
    requests = ObservationRequestRow
    for request in session.scalars(select(requests).where(requests.mission_id == plan.mission_id)):
        changes: dict[str, Any] = {}
        if request.id in planned and request.state in {"open", "carried"}:
            changes = {"state": "planned", "state_reason": f"in plan {plan.number}"}
        pose = result["observation_points"].get(request.target_id)
        if request.id in result["left_out"] and request.state == "planned":
            changes = {"state": "open", "state_reason": f"left out of plan {plan.number}"}
        if pose is not None and request.observation_point is None:
            changes["observation_point"] = {"pose": pose, "reachable": True, "manual": False, "reason": ""}
        update(session, SYSTEM_ACTOR, OBSERVATION_REQUEST, request, changes, action="plan")
    return f"/api/v1/plans/{plan.id}"


def abandon(session: Session, job: JobRow) -> None:
    """Say on the plan that there is none."""
    plan = session.get(PlanRow, job.subject_id)
    if plan is not None:
        kind = (job.problem or {}).get("type", "")
        word = kind.rsplit("plan-", 1)[-1] if "plan-" in kind else job.state
        update(session, SYSTEM_ACTOR, PLAN, plan, {"status": word}, action="compute")
