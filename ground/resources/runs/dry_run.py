"""Run a plan on a simulated rover: a job."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, NotFoundError, StateError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.jobs.kind import show_jobs
from ground.jobs.queue import WAKE, enqueue
from ground.jobs.row import JobRow
from ground.jobs.value import Job, JobState
from ground.records.actor import SYSTEM_ACTOR, Action, Actor
from ground.records.edit import insert, update
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import terrain_row
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.plans.kind import PLAN
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.resources.problems.row import ProblemRow
from ground.resources.products.row import ProductRow
from ground.resources.runs.kind import RUN
from ground.resources.runs.order import ORDERS, RunWork, SentCommand
from ground.resources.runs.row import RunRow
from ground.resources.runs.value import Fault as FaultValue
from ground.resources.runs.value import RunKind
from ground.resources.sols.row import SolRow
from ground.resources.targets.row import TargetRow
from ground.uplink.link import Link
from ground.uplink.rehearsal import Sent
from mission import Sky

KIND = "dry_run"


@dataclass(frozen=True, slots=True)
class RunOrder:
    """What is to be run, on which rover, with which faults; `pace` plan seconds pass in a second, 0 =
    all at once.
    """

    plan_id: str
    rover: str = "abstract"
    seed: int = 1
    faults: tuple[FaultValue, ...] = ()
    pace: float = 0.0
    notes: str = ""
    light_time_s: float | None = None
    """Makes it a rehearsal with the passes of the plan's sol: `commands` come late, and the run's folder says
    when the ground knows what."""
    commands: tuple[Sent, ...] = ()


def dry_run(repo: Repository, actor: Actor, mission_id: str, order: RunOrder) -> Job:
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
    if order.rover not in rover_names():
        raise InvalidInputError(
            f"there is no rover {order.rover!r}; installed are {', '.join(rover_names())}", pointer="/rover"
        )
    faults = _fault_documents(order.faults)
    with repo.database.write() as session:
        mission = session.get(MissionRow, mission_id)
        if mission is None:
            raise NotFoundError(f"there is no mission {mission_id}")
        plan = session.get(PlanRow, order.plan_id)
        if plan is None or plan.mission_id != mission_id:
            raise InvalidInputError(
                f"there is no plan {order.plan_id} in mission {mission_id}", pointer="/plan_id"
            )
        if plan.crl_text is None or plan.crl_sha256 is None or plan.problem_id is None:
            raise StateError(f"plan {plan.number} is not computed ({plan.status or 'its job is not done'})")
        problem = session.get_one(ProblemRow, plan.problem_id)
        sol = session.get_one(SolRow, plan.sol_id)
        link = _link(order.light_time_s, sol)
        run_id, job_id = new_id("run"), new_id("job")
        row = RunRow(
            id=run_id,
            author=actor.name,
            mission_id=mission_id,
            plan_id=plan.id,
            kind=RunKind.DRY_RUN.value,
            rover=order.rover,
            seed=order.seed,
            faults=[asdict(f) for f in order.faults],
            job_id=job_id,
            state=JobState.QUEUED.value,
            options_taken=[],
            achieved_request_ids=[],
            crl_sha256=plan.crl_sha256,
            notes=order.notes,
        )
        insert(session, actor, RUN, row)
        work = RunWork(
            run_id,
            run_dir=str(repo.run_dir(run_id)),
            files_dir=str(repo.files.folder),
            terrain_dir=str(repo.terrain_dir(terrain_row(session, mission_id).id)),
            crl_text=plan.crl_text,
            problem=problem.document,
            rover=order.rover,
            rover_profile=plan.rover_profile,
            seed=order.seed,
            faults=tuple(faults),
            pace=order.pace,
            link=None if link is None else link.as_dict(),
            commands=tuple(SentCommand(c.operation.value, c.sent_s) for c in order.commands),
            sky=Sky(start_lmst_h=sol.start_lmst_h),
        )
        job = enqueue(
            session,
            repo.settings,
            kind=KIND,
            mission_id=mission_id,
            subject_kind="run",
            subject_id=run_id,
            payload=ORDERS.document(work),
            author=actor.name,
            job_id=job_id,
        )
        value = show_jobs(session, [job])[0]
    WAKE.set()
    return value


def _link(light_time_s: float | None, sol: SolRow) -> Link | None:
    """Return the link of a rehearsal: passes of a sol in order; None without a light time."""
    if light_time_s is None:
        return None
    passes = sorted(sol.passes, key=lambda p: float(p["start_s"]))
    return Link.from_dict({"light_time_s": light_time_s, "passes": passes})


def _fault_documents(faults: tuple[FaultValue, ...]) -> list[dict[str, Any]]:
    """Return faults in the form `fault/1`.

    Raises
    ------
    InvalidInputError
        If one has not exactly one of time and task, or lacks its target or amount.
    """
    from rover_iface.errors import RoverError
    from rover_iface.simulator.faults import Fault

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
            Fault.from_dict(document)
        except RoverError as err:
            raise InvalidInputError(str(err), pointer=f"/faults/{index}") from err
        documents.append(document)
    return documents


def settle(_repo: Repository, session: Session, job: JobRow, result: dict[str, Any]) -> str | None:
    """Write outcome and products; a plan whose run went through is verified."""
    run = session.get(RunRow, job.subject_id)
    if run is None:
        return None
    record_run(session, run, result)
    plan = session.get(PlanRow, run.plan_id)
    if (
        plan is not None
        and plan.state == PlanState.COMPUTED.value
        and result["outcome"] == "SUCCEEDED"
        and plan.crl_sha256 == run.crl_sha256
    ):
        update(session, SYSTEM_ACTOR, PLAN, plan, {"state": PlanState.VERIFIED.value}, action="verify")
    return f"/api/v1/runs/{run.id}"


def record_run(session: Session, run: RunRow, result: dict[str, Any]) -> list[ProductRow]:
    """Write what came of a run and tie its products to task, request and target; return the products.

    A product whose request is unknown in this mission is kept and listed as an orphan.
    """
    products = product_rows(session, run, result["products"])
    session.add_all(products)
    achieved = sorted({p.request_id for p in products if p.request_id is not None})
    columns = {
        "state": JobState.SUCCEEDED.value,
        "achieved_request_ids": achieved,
        **{
            name: result[name]
            for name in (
                "outcome",
                "utility",
                "duration_s",
                "energy_used_j",
                "options_taken",
                "trace_sha256",
                "telemetry_sha256",
            )
        },
    }
    update(session, SYSTEM_ACTOR, RUN, run, columns, action="run")
    return products


def product_rows(session: Session, run: RunRow, items: Iterable[Mapping[str, Any]]) -> list[ProductRow]:
    """Return rows for products of a run, tied to the requests and targets of its mission by their labels."""
    requests = dict(
        session.execute(
            select(ObservationRequestRow.id, ObservationRequestRow.target_id).where(
                ObservationRequestRow.mission_id == run.mission_id
            )
        ).all()
    )
    targets = set(session.scalars(select(TargetRow.id).where(TargetRow.mission_id == run.mission_id)))
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
