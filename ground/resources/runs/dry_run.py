"""Run a plan on a simulated rover: a job."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from datetime import datetime
from typing import Any

from sqlalchemy import bindparam, select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, StateError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.jobs.value import Job, JobState
from ground.records.actor import SYSTEM_ACTOR, Action, Actor
from ground.records.edit import insert, new_row, update
from ground.records.get_resource import require_mission, row_in_mission
from ground.resources.ask_job import ask_job
from ground.resources.missions.row import MissionRow
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.plans.kind import PLAN
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.resources.problems.row import ProblemRow
from ground.resources.products.row import ProductRow
from ground.resources.runs.bodies import RunCreate
from ground.resources.runs.kind import RUN
from ground.resources.runs.order import ORDERS, RunWork, SentCommand
from ground.resources.runs.row import RunRow
from ground.resources.runs.value import Fault as FaultValue
from ground.resources.runs.value import RunKind
from ground.resources.runs.work import RunResult, StoredProduct
from ground.resources.sols.row import SolRow
from ground.resources.sols.sol_sky import sol_sky
from ground.resources.targets.row import TargetRow
from ground.uplink.link import Link, Pass

KIND = "dry_run"
LIVE_KIND = "live"
LIVE_TIME_LIMIT_S = 86_400.0
"""A live run takes as long as its plan."""

_TOGETHER = (
    select(PlanRow, ProblemRow, SolRow, MissionRow.terrain_id)
    .outerjoin(ProblemRow, ProblemRow.id == PlanRow.problem_id)
    .join(SolRow, SolRow.id == PlanRow.sol_id)
    .join(MissionRow, MissionRow.id == PlanRow.mission_id)
    .where(PlanRow.id == bindparam("wanted"))
)
"""A plan and what it hangs on, in one question: each question more takes a hundredth of a dry run."""


def dry_run(repo: Repository, actor: Actor, mission_id: str, given: RunCreate) -> Job:
    """Return the job whose subject is the new run.

    Raises
    ------
    InvalidInputError
        If the rover is not installed or a fault is malformed.
    StateError
        If the plan is not computed yet.
    """
    from rover_iface.registry import rover_names

    actor.require(Action.PLAN, mission_id)
    if given.rover not in rover_names():
        raise InvalidInputError(
            f"there is no rover {given.rover!r}; installed are {', '.join(rover_names())}", pointer="/rover"
        )
    if given.live and (given.light_time_s is not None or given.commands):
        raise InvalidInputError(
            "a live run has no light time and no commands beforehand: it is asked while it goes on",
            pointer="/live",
        )
    faults = [fault.value() for fault in given.faults]
    documents = _fault_documents(faults)
    with repo.database.write() as session:
        require_mission(session, mission_id)
        together = session.execute(_TOGETHER, {"wanted": given.plan_id}).first()
        plan: PlanRow = row_in_mission(session, PLAN, given.plan_id, mission_id, "/plan_id")
        if together is None or plan.crl_text is None or plan.crl_sha256 is None or plan.problem_id is None:
            raise StateError(f"plan {plan.number} is not computed ({plan.status or 'its job is not done'})")
        problem = session.get_one(ProblemRow, plan.problem_id)
        sol = session.get_one(SolRow, plan.sol_id)
        link = _link(given.light_time_s, sol)
        job_id = new_id("job")
        row = new_row(
            RUN,
            actor,
            mission_id,
            given,
            kind=(RunKind.LIVE if given.live else RunKind.DRY_RUN).value,
            faults=[asdict(fault) for fault in faults],
            job_id=job_id,
            state=JobState.QUEUED.value,
            options_taken=[],
            achieved_request_ids=[],
            crl_sha256=plan.crl_sha256,
        )
        insert(session, actor, RUN, row)
        work = RunWork(
            row.id,
            run_dir=repo.address("runs", row.id),
            files_dir=repo.files.address,
            terrain_dir=repo.address("terrains", together.terrain_id),
            crl_text=plan.crl_text,
            problem=problem.document,
            rover=given.rover,
            rover_profile=plan.rover_profile,
            seed=given.seed,
            faults=tuple(documents),
            pace=given.pace,
            link=link,
            commands=tuple(SentCommand(c.operation, c.sent_s) for c in given.commands),
            sky=sol_sky(repo, session, sol),
        )
        kind, limit_s = (LIVE_KIND, LIVE_TIME_LIMIT_S) if given.live else (KIND, None)
        order = ORDERS.document(work)
        return ask_job(session, repo, actor, kind, mission_id, (RUN, row.id), order, job_id, limit_s)


def _link(light_time_s: float | None, sol: SolRow) -> Link | None:
    """Return the link of a rehearsal: passes of a sol in order; None without a light time."""
    if light_time_s is None:
        return None
    passes = sorted(sol.passes, key=lambda p: float(p["start_s"]))
    return Link(light_time_s, tuple(Pass(**p) for p in passes))


def _fault_documents(faults: Sequence[FaultValue]) -> list[dict[str, Any]]:
    """Return faults in the form `fault/1`.

    Raises
    ------
    InvalidInputError
        If one has not exactly one of time and task, or lacks its target or amount.
    """
    from rover_iface.errors import RoverError
    from rover_iface.simulator.faults import load_faults

    documents = []
    for index, fault in enumerate(faults):
        members = {
            "kind": fault.kind,
            "at_s": fault.at_s,
            "task": fault.task,
            "target": fault.target_id,
            "amount": fault.amount,
        }
        document = {name: value for name, value in members.items() if value is not None}
        try:
            load_faults([document])
        except RoverError as err:
            raise InvalidInputError(str(err), pointer=f"/faults/{index}") from err
        documents.append(document)
    return documents


def settle(_repo: Repository, session: Session, job: JobRow, result: RunResult) -> str | None:
    """Write outcome and products; a plan whose run went through is verified."""
    run = session.get(RunRow, job.subject_id)
    if run is None:
        return None
    record_run(session, run, result)
    flown = (
        PlanRow.id == run.plan_id,
        PlanRow.state == PlanState.COMPUTED.value,
        PlanRow.crl_sha256 == run.crl_sha256,
    )
    plan = session.scalar(select(PlanRow).where(*flown)) if result["outcome"] == "SUCCEEDED" else None
    if plan is not None:
        update(session, SYSTEM_ACTOR, PLAN, plan, {"state": PlanState.VERIFIED.value}, action="verify")
    return f"/api/v1/runs/{run.id}"


def record_run(session: Session, run: RunRow, result: RunResult) -> list[ProductRow]:
    """Write what came of a run and tie its products to task, request and target; return the products.

    A product whose request is unknown in this mission is kept and listed as an orphan.
    """
    products = product_rows(session, run, result["products"])
    session.add_all(products)
    achieved = sorted({p.request_id for p in products if p.request_id is not None})
    columns = {
        "state": JobState.SUCCEEDED.value,
        "achieved_request_ids": achieved,
        "outcome": result["outcome"],
        "utility": result["utility"],
        "duration_s": result["duration_s"],
        "energy_used_j": result["energy_used_j"],
        "options_taken": result["options_taken"],
        "trace_sha256": result["trace_sha256"],
        "telemetry_sha256": result["telemetry_sha256"],
    }
    update(session, SYSTEM_ACTOR, RUN, run, columns, action="run")
    return products


def product_rows(session: Session, run: RunRow, items: Iterable[StoredProduct]) -> list[ProductRow]:
    """Return rows for products of a run, tied to the requests and targets of its mission by their labels."""
    requests = dict(
        session.execute(
            select(ObservationRequestRow.id, ObservationRequestRow.target_id).where(
                ObservationRequestRow.mission_id == run.mission_id
            )
        ).all()
    )
    items = list(items)
    targets = set(requests.values())
    if not {item["label"].get("target") for item in items} <= {None, *targets}:
        targets |= set(session.scalars(select(TargetRow.id).where(TargetRow.mission_id == run.mission_id)))
    rows = []
    for item in items:
        label = item["label"]
        request_id = label.get("request") if label.get("request") in requests else None
        named = label.get("target") if label.get("target") in targets else None
        row = ProductRow(
            id=item.get("id") or new_id("prd"),
            author=run.author,
            mission_id=run.mission_id,
            run_id=run.id,
            plan_id=run.plan_id,
            task_id=str(label.get("task", ""))[:200],
            request_id=request_id,
            target_id=named or (requests[request_id] if request_id else None),
            kind=str(label.get("kind", ""))[:80],
            instrument=str(label.get("instrument", ""))[:80],
            media=item["media"],
            file_name=item["file_name"][:300],
            size_bytes=item["size_bytes"],
            sha256=item["sha256"],
            t_s=float(label.get("t_s", 0.0)),
            label=label,
        )
        if "created_utc" in item:
            row.created_utc = datetime.fromisoformat(item["created_utc"])
        rows.append(row)
    return rows


def begin(session: Session, job: JobRow) -> None:
    """Say on the run that it goes on."""
    run = session.get(RunRow, job.subject_id)
    if run is not None:
        update(session, SYSTEM_ACTOR, RUN, run, {"state": JobState.RUNNING.value}, action="run")


def abandon(session: Session, job: JobRow) -> None:
    """Say on the run that nothing came of it."""
    run = session.get(RunRow, job.subject_id)
    if run is not None:
        outcome = {"state": job.state, "outcome": (job.problem or {}).get("detail", job.state)[:40]}
        update(session, SYSTEM_ACTOR, RUN, run, outcome, action="run")
