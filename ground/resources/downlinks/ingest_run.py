"""Take in what an execution brought down."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.durable import copy_folder, removed_on_failure
from ground.errors import AlreadyExecutedError, ArchiveError
from ground.gdr.archives import extract_zip, is_zip
from ground.gdr.ids import new_id
from ground.gdr.places import keep_folder
from ground.gdr.repository import Repository
from ground.jobs.value import JobState
from ground.records.actor import SYSTEM_ACTOR, Action, Actor
from ground.records.edit import insert, update
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.packages.row import PackageRow
from ground.resources.plans.kind import PLAN
from ground.resources.plans.read_plan import parsed_plan
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.resources.runs.dry_run import record_run
from ground.resources.runs.kind import RUN
from ground.resources.runs.row import RunRow
from ground.resources.runs.run_form import RunDocument
from ground.resources.runs.value import Run, RunKind
from ground.resources.runs.work import RunResult, read_run_folder
from ground.resources.uploads.store_upload import find_upload

if TYPE_CHECKING:
    from executive.crl.nodes import Plan


def ingest_upload(repo: Repository, actor: Actor, upload_id: str) -> Run:
    """Take in an uploaded zip of a run's folder; see `ingest_run`."""
    actor.require_somewhere(Action.UPLINK)
    with repo.database.read() as session:
        upload = find_upload(session, actor, upload_id)
    stored = repo.files.path(upload.sha256)
    if not is_zip(stored):
        raise ArchiveError(f"{upload.file_name} is not a zip", pointer="/upload_id")
    with tempfile.TemporaryDirectory(prefix="outcrop-ingest-") as work:
        folder = Path(work) / "run"
        extract_zip(stored, folder, max_bytes=int(repo.settings.max_body_mib * 8 * 2**20))
        inner = list(folder.iterdir())
        if len(inner) == 1 and inner[0].is_dir():
            folder = inner[0]
        return ingest_run(repo, actor, folder)


def ingest_run(repo: Repository, actor: Actor, folder: Path) -> Run:
    """Return the run of a folder `run/1`, its products tied to task, request and target.

    Files go into the store, and the folder with the journal beside the other runs, before the rows that name
    them, and all rows are written together: a crash leaves neither a product without its record nor a record
    without its file or journal, and the folder can be taken in again.

    Raises
    ------
    ArchiveError
        If the folder is incomplete, damaged, or of a plan this repository does not know.
    AlreadyExecutedError
        If the run of that package was taken in before.
    """
    result = read_run_folder(folder, repo.files)
    document = result["document"]
    package = document.get("package_sha256")
    if not isinstance(package, str) or not isinstance(document.get("plan"), str):
        raise ArchiveError(
            f"{folder.name}: run.json names no package; only executions of a package are taken in"
        )
    run_id = new_id("run")
    kept = repo.folders("runs").at(run_id)
    copy_folder(folder, kept.root)
    with removed_on_failure(kept.root):
        keep_folder(kept)
    with repo.database.write() as session, removed_on_failure(kept.root):
        plan = _executed_plan(session, actor, document, folder.name)
        actor.require(Action.UPLINK, plan.mission_id)
        return record_execution(session, actor, plan, result, run_id)


def _executed_plan(session: Session, actor: Actor, document: RunDocument, name: str) -> PlanRow:
    """Return the plan that a run executed, locked; raise unless it is the package of one of ours.

    A plan that the actor may not see is not here for them.
    """
    plan = session.get(PlanRow, document["plan"], with_for_update=True, populate_existing=True)
    hidden = plan is not None and not actor.sees(plan.mission_id)
    if plan is None or hidden or plan.mission_id != document.get("mission"):
        raise ArchiveError(f"{name}: the plan {document['plan']} is not in this repository")
    if plan.crl_sha256 != document.get("plan_digest"):
        raise ArchiveError(f"{name}: the run executed another text than plan {plan.number}")
    package = document["package_sha256"]
    if session.scalars(select(PackageRow.id).where(PackageRow.sha256 == package)).first() is None:
        raise not_ours(name)
    return plan


def not_ours(name: str) -> ArchiveError:
    """Return the refusal of a run whose package is not known here."""
    return ArchiveError(f"{name}: its package was not made by this repository")


def record_execution(session: Session, actor: Actor, plan: PlanRow, result: RunResult, run_id: str) -> Run:
    """Write a run that executed the package of a plan, its products and what became of each request.

    The run of a training rover says so itself. It leaves the plan uplinked and does not stand for its
    package: what a real rover made of it is taken in later, and then says what became of the requests.

    Raises
    ------
    AlreadyExecutedError
        If the run of that package was taken in before.
    """
    document = result["document"]
    training = document.get("training") is True
    package = None if training else document["package_sha256"]
    known = trained(session, plan) if training else _taken_in(session, package)
    if known is not None:
        raise AlreadyExecutedError(f"the run of this package was taken in before, as {known}")
    run = RunRow(
        id=run_id,
        author=actor.name,
        mission_id=plan.mission_id,
        plan_id=plan.id,
        kind=(RunKind.TRAINING if training else RunKind.EXECUTION).value,
        rover=str(document.get("rover", ""))[:80],
        seed=int(document.get("seed") or 0),
        faults=[],
        job_id=None,
        state=JobState.RUNNING.value,
        options_taken=[],
        achieved_request_ids=[],
        crl_sha256=plan.crl_sha256 or "",
        package_sha256=package,
    )
    insert(session, actor, RUN, run)
    products = record_run(session, run, result)
    if not training or plan.state != PlanState.EXECUTED.value:
        _settle_requests(session, plan, document, {p.request_id for p in products})
    if not training:
        update(session, actor, PLAN, plan, {"state": PlanState.EXECUTED.value}, action="execute")
    session.flush()
    return RUN.show_one(session, run)


def trained(session: Session, plan: PlanRow) -> str | None:
    """Return the run of a plan on the training rover, if there is one."""
    rows = RunRow
    query = select(rows.id).where(
        rows.plan_id == plan.id, rows.kind == RunKind.TRAINING.value, rows.elsewhere.is_(False)
    )
    return session.scalars(query).first()


def _taken_in(session: Session, package: str | None) -> str | None:
    return session.scalars(select(RunRow.id).where(RunRow.package_sha256 == package)).first()


def _settle_requests(
    session: Session, plan: PlanRow, document: RunDocument, answered: set[str | None]
) -> None:
    """Write what became of each request: satisfied by a product, failed with its task, or not come to."""
    outcomes = document.get("outcomes") or {}
    tasks = request_tasks(parsed_plan(plan))
    where = " on the training rover" if document.get("training") is True else ""
    rows = ObservationRequestRow
    for request in session.scalars(select(rows).where(rows.mission_id == plan.mission_id)):
        if request.id not in plan.planned_request_ids:
            continue
        ends = [outcomes.get(task) for task in tasks.get(request.id, ())]
        if request.id in answered:
            state, reason = "satisfied", f"a product came back with plan {plan.number}{where}"
        elif any(end == "SUCCEEDED" for end in ends):
            state, reason = "attempted", f"plan {plan.number} carried it out{where} and no product came back"
        elif any(end in {"FAILED", "ABORTED"} for end in ends):
            end = next(end for end in ends if end in {"FAILED", "ABORTED"})
            state, reason = "failed", f"its task ended {end}{where}"
        else:
            state, reason = "open", f"plan {plan.number} did not come to it{where}"
        changes = {"state": state, "state_reason": reason}
        update(session, SYSTEM_ACTOR, OBSERVATION_REQUEST, request, changes, action="execute")


def request_tasks(plan: Plan) -> dict[str, list[str]]:
    """Return the ids of the CRL tasks of each request, from the metadata of the plan."""
    from executive.crl import to_json

    found: dict[str, list[str]] = {}

    def walk(value: Any) -> None:
        if isinstance(value, dict):
            metadata = value.get("metadata")
            if value.get("kind") == "task" and isinstance(metadata, dict) and "request" in metadata:
                found.setdefault(str(metadata["request"]), []).append(str(value.get("id")))
            for item in value.values():
                walk(item)
        elif isinstance(value, list):
            for item in value:
                walk(item)

    walk(to_json(plan))
    return found
