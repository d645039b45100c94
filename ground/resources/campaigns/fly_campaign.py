"""Fly a plan many times: a job."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, StateError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.jobs.value import Job, JobState
from ground.records.actor import SYSTEM_ACTOR, Action, Actor
from ground.records.edit import insert, new_row, update
from ground.records.get_resource import require_mission
from ground.resources.ask_job import ask_job
from ground.resources.campaigns.bodies import CampaignCreate
from ground.resources.campaigns.kind import CAMPAIGN
from ground.resources.campaigns.order import ORDERS, CampaignWork
from ground.resources.campaigns.row import CampaignRow
from ground.resources.missions.terrain import terrain_row
from ground.resources.plans.row import PlanRow
from ground.resources.problems.row import ProblemRow
from ground.resources.sols.row import SolRow
from ground.resources.sols.sol_sky import sol_sky

KIND = "fly_campaign"


def fly_campaign(repo: Repository, actor: Actor, mission_id: str, given: CampaignCreate) -> Job:
    """Return the job whose subject is the new campaign.

    Raises
    ------
    InvalidInputError
        If the rover is not installed, or the plan is not of this mission.
    StateError
        If the plan is not computed yet.
    """
    from rover_iface.registry import rover_names

    actor.require(Action.PLAN, mission_id)
    if given.rover not in rover_names():
        raise InvalidInputError(
            f"there is no rover {given.rover!r}; installed are {', '.join(rover_names())}", pointer="/rover"
        )
    with repo.database.write() as session:
        require_mission(session, mission_id)
        plan = session.get(PlanRow, given.plan_id)
        if plan is None or plan.mission_id != mission_id:
            raise InvalidInputError(
                f"there is no plan {given.plan_id} in mission {mission_id}", pointer="/plan_id"
            )
        if plan.crl_text is None or plan.crl_sha256 is None or plan.problem_id is None:
            raise StateError(f"plan {plan.number} is not computed ({plan.status or 'its job is not done'})")
        problem, sol = session.get_one(ProblemRow, plan.problem_id), session.get_one(SolRow, plan.sol_id)
        job_id = new_id("job")
        row = new_row(
            CAMPAIGN,
            actor,
            mission_id,
            given,
            job_id=job_id,
            state=JobState.QUEUED.value,
            crl_sha256=plan.crl_sha256,
            result=None,
        )
        insert(session, actor, CAMPAIGN, row)
        work = CampaignWork(
            folder=repo.address("campaigns", row.id),
            terrain_dir=repo.address("terrains", terrain_row(session, mission_id).id),
            crl_text=plan.crl_text,
            problem=problem.document,
            rover=given.rover,
            rover_profile=plan.rover_profile,
            seed=given.seed,
            runs=given.runs,
            help_runs=given.help_runs,
            until_se=given.until_se,
            expected_utility=plan.expected_utility,
            sky=sol_sky(repo, session, sol),
        )
        payload = ORDERS.document(work)
        return ask_job(session, repo, actor, KIND, mission_id, (CAMPAIGN, row.id), payload, job_id)


def begin(session: Session, job: JobRow) -> None:
    """Mark the campaign as going on."""
    _set(session, job, state=JobState.RUNNING.value)


def settle(_repo: Repository, session: Session, job: JobRow, result: Mapping[str, object]) -> str | None:
    """Write what the runs say."""
    _set(session, job, state=JobState.SUCCEEDED.value, result=result["result"])
    return f"/api/v1/campaigns/{job.subject_id}"


def abandon(session: Session, job: JobRow) -> None:
    """Mark the campaign as the job has ended; the runs that were flown stay."""
    _set(session, job, state=job.state)


def _set(session: Session, job: JobRow, **columns: Any) -> None:
    row = session.get(CampaignRow, job.subject_id)
    if row is not None:
        update(session, SYSTEM_ACTOR, CAMPAIGN, row, columns, action="fly")
