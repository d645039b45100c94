"""Execute the package of a plan on the training rover of its mission: a job."""

from __future__ import annotations

from dataclasses import replace

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import AlreadyExecutedError, InvalidInputError, StateError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.jobs.value import Job, JobState
from ground.records.actor import ALLOWED, Action, Actor, Role
from ground.records.get_resource import find_row
from ground.resources.ask_job import ask_job
from ground.resources.downlinks.ingest_run import record_execution, trained
from ground.resources.executions.bodies import ExecutionCreate
from ground.resources.executions.order import ORDERS, ExecutionWork, Signer
from ground.resources.executions.work import ExecutionResult
from ground.resources.missions.terrain import terrain_row
from ground.resources.packages.row import PackageRow
from ground.resources.people.accounts import actor_of
from ground.resources.people.row import PersonRow, SigningKeyRow
from ground.resources.plans.kind import PLAN
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.resources.problems.row import ProblemRow
from ground.resources.sols.row import SolRow
from ground.resources.sols.sol_sky import sol_sky
from mission import MissionError

KIND = "execution"
ACTION = Action.UPLINK
"""What asking for it, cancelling it and asking again take."""


def execute_plan(repo: Repository, actor: Actor, plan_id: str, given: ExecutionCreate) -> Job:
    """Return the job that executes the package of an uplinked plan; its result is the run.

    Raises
    ------
    InvalidInputError
        If the rover is none of the simulated ones that come with the program.
    StateError
        If the plan has no package yet, or is being executed.
    AlreadyExecutedError
        If a run of its package was taken in.
    """
    from rover_iface.errors import RoverError
    from rover_iface.registry import require_simulated

    try:
        require_simulated(given.rover)
    except RoverError as err:
        raise InvalidInputError(str(err), pointer="/rover") from err
    with repo.database.write() as session:
        plan: PlanRow = find_row(session, PLAN, plan_id, lock=True)
        actor.require(ACTION, plan.mission_id)
        if plan.state == PlanState.EXECUTED.value:
            raise AlreadyExecutedError(f"plan {plan.number} was executed before")
        if (run := trained(session, plan)) is not None:
            raise AlreadyExecutedError(f"the training rover executed plan {plan.number} before, as {run}")
        package = session.scalars(select(PackageRow).where(PackageRow.plan_id == plan.id)).first()
        if package is None or plan.problem_id is None:
            raise StateError(f"plan {plan.number} is {plan.state}; only an uplinked plan is executed")
        going = select(JobRow.id).where(
            JobRow.kind == KIND,
            JobRow.subject_id == plan.id,
            JobRow.state.in_([JobState.QUEUED.value, JobState.RUNNING.value]),
        )
        if (job := session.scalars(going).first()) is not None:
            raise StateError(f"plan {plan.number} is being executed already, by the job {job}")
        run_id = new_id("run")
        sol = session.get_one(SolRow, plan.sol_id)
        work = ExecutionWork(
            run_id,
            mission=plan.mission_id,
            counter=package.sequence,
            rover_dir=str(repo.training_dir(plan.mission_id)),
            package_path=repo.files.address_of(package.sha256),
            run_dir=repo.address("runs", run_id),
            files_dir=repo.files.address,
            terrain_dir=repo.address("terrains", terrain_row(session, plan.mission_id).id),
            problem=session.get_one(ProblemRow, plan.problem_id).document,
            rover=given.rover,
            seed=given.seed,
            rover_profile=plan.rover_profile,
            sky=sol_sky(repo, session, sol),
            signers=(),
        )
        order = ORDERS.document(work)
        return ask_job(session, repo, actor, KIND, plan.mission_id, (PLAN, plan.id), order)


def begin(session: Session, job: JobRow) -> None:
    """Write into the order whose keys count now: one that was revoked since it was asked for does not."""
    if job.mission_id is None:
        return
    try:
        order = ORDERS.from_document(job.payload)
    except MissionError:
        return  # the work says what is wrong with it
    job.payload = dict(ORDERS.document(replace(order, signers=_signers(session, job.mission_id))))


def _signers(session: Session, mission_id: str) -> tuple[Signer, ...]:
    """Return whose keys count on a training rover: roles in the trust file follow roles in the mission."""
    query = (
        select(SigningKeyRow.public, PersonRow)
        .join(PersonRow, PersonRow.id == SigningKeyRow.person_id)
        .where(SigningKeyRow.revoked_utc.is_(None), PersonRow.active)
        .order_by(SigningKeyRow.id)
    )
    found = []
    for public, person in session.execute(query):
        may = ALLOWED[actor_of(person).role_in(mission_id)]
        roles = ["author", "verifier"] * (Action.PLAN in may) + ["approver"] * (Action.APPROVE in may)
        if roles:
            found.append(Signer(person.name, public, tuple(roles)))
    return tuple(found)


def settle(_repo: Repository, session: Session, job: JobRow, result: ExecutionResult) -> str | None:
    """Take in the run as one of the training rover, also where a worker of an earlier version made it."""
    plan = session.get(PlanRow, job.subject_id, with_for_update=True, populate_existing=True)
    if plan is None:
        return None
    result = {**result, "document": {**result["document"], "training": True}}
    run = record_execution(session, Actor(job.author, Role.OPERATOR), plan, result, result["run"])
    return f"/api/v1/runs/{run.id}"
