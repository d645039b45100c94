"""Ask the planner for a plan: a job."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypedDict

import orjson
from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.day.rovers import profile_of
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.jobs.value import Job
from ground.records.actor import SYSTEM_ACTOR, Action, Actor
from ground.records.edit import insert, new_row, next_number, update
from ground.records.get_resource import find_row, row_in_mission
from ground.resources.ask_job import ask_job
from ground.resources.missions.kind import MISSION
from ground.resources.missions.terrain import terrain_row
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.path_networks.kind import PATH_NETWORK
from ground.resources.path_networks.row import PathNetworkRow
from ground.resources.plans.answer_what_if import keep_outs_of
from ground.resources.plans.bodies import PlanCreate
from ground.resources.plans.draft import draft_of
from ground.resources.plans.kind import PLAN
from ground.resources.plans.order import ORDERS, Ahead, PlanWork, Search
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.resources.problems.inputs_digest import inputs_digest
from ground.resources.problems.kind import PROBLEM
from ground.resources.problems.mission_day import choose_sol, mission_day, worksite
from ground.resources.problems.row import ProblemRow
from mission import Day
from planner.changes import Changes
from planner.problem_document import ProblemDocument

KIND = "generate_plan"


def generate_plan(
    repo: Repository, actor: Actor, mission_id: str, given: PlanCreate, *, ahead: Ahead | None = None
) -> Job:
    """Return the job whose subject is the new plan, a draft until it is computed.

    With `ahead` it is that of the first of several sols.
    """
    actor.require(Action.PLAN, mission_id)
    changes = None if given.what_if is None else given.what_if.value()
    allowed = given.max_overrun_probability
    with repo.database.write() as session:
        mission = find_row(session, MISSION, mission_id)
        if given.parent_id is not None:
            parent = row_in_mission(session, PLAN, given.parent_id, mission_id, "/parent_id")
            if changes is not None and allowed is None:
                allowed = _allowed(session, parent)
        language = profile_of(mission.rover_profile).language
        sol = choose_sol(session, mission_id, given.sol_id)
        day = mission_day(repo, session, mission, sol, given.request_ids)
        day = replace(day, limits=replace(day.limits, max_overrun_probability=allowed))
        inputs = inputs_digest(session, mission_id)
        if changes is not None:
            day, inputs = _changed(day, inputs, changes)
        job_id, number = new_id("job"), next_number(session, PlanRow, mission_id)
        row = new_row(
            PLAN,
            actor,
            mission_id,
            given,
            sol_id=sol.id,
            number=number,
            name=given.name or (f"Plan {number}" if changes is None else f"What-if {number}"),
            notes=given.notes or ("" if changes is None else f"What if: {changes.in_words()}."),
            state=PlanState.DRAFT.value,
            job_id=job_id,
            inputs_sha256=inputs,
            terrain_sha256=terrain_row(session, mission_id).sha256,
            dictionary=f"{language.name} {language.version}",
            rover_profile=mission.rover_profile,
            findings=[],
            planned_request_ids=[],
            left_out={},
        )
        insert(session, actor, PLAN, row)
        search = Search(given.strategy, given.max_branches, given.time_limit_s, given.iterations, given.seed)
        draft = str(draft_of(repo, row.id))
        work = PlanWork(worksite(repo, session, mission), day, row.id, search, changes, draft, ahead)
        return ask_job(session, repo, actor, KIND, mission_id, (PLAN, row.id), ORDERS.document(work), job_id)


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


class MadePlan(TypedDict):
    """What is read of what `plans.work.work` returns; all else goes into the plan's row as it is."""

    stopped: str
    problem: ProblemDocument
    problem_sha256: str
    planned_request_ids: list[str]
    left_out: Mapping[str, str]
    geometry: Mapping[str, object]
    observation_points: Mapping[str, Mapping[str, float]]


def settle(repo: Repository, session: Session, job: JobRow, result: MadePlan) -> str | None:
    """Write plan, problem and network; requests in the plan become planned."""
    draft_of(repo, job.subject_id).unlink(missing_ok=True)
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
    made: Mapping[str, object] = result
    columns = {
        name: made[name]
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
    draft = ORDERS.from_document(job.payload).draft
    if draft:
        Path(draft).unlink(missing_ok=True)
    plan = session.get(PlanRow, job.subject_id)
    if plan is not None:
        kind = (job.problem or {}).get("type", "")
        word = kind.rsplit("plan-", 1)[-1] if "plan-" in kind else job.state
        update(session, SYSTEM_ACTOR, PLAN, plan, {"status": word}, action="compute")
