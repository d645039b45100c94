"""Remove what nobody needs any more: finished jobs, superseded plans and dry runs, files of no record.

Nothing goes that an approval, a statement, a package, a campaign or a product names.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from sqlalchemy import Select, delete, func, or_, select, union

from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.records.actor import SYSTEM_ACTOR
from ground.records.edit import remove
from ground.records.kind import Kind
from ground.resources.approvals.row import ApprovalRow
from ground.resources.backups.check_files import sweep_files
from ground.resources.campaigns.row import CampaignRow
from ground.resources.packages.row import PackageRow, StatementRow
from ground.resources.plans.kind import PLAN
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.resources.products.row import ProductRow
from ground.resources.runs.kind import RUN
from ground.resources.runs.row import RunRow
from ground.resources.runs.value import RunKind

REASON = "pruned"
OVER = ("succeeded", "failed", "cancelled")
UNSIGNED = tuple(state.value for state in (PlanState.DRAFT, PlanState.COMPUTED, PlanState.VERIFIED))
BATCH = 100
"""Rows that go in one transaction, so that other writers wait for none of them long."""


@dataclass(frozen=True, slots=True)
class Pruned:
    """What goes, or went: ids of jobs, runs and plans, and names of files and folders."""

    jobs: list[str]
    runs: list[str]
    plans: list[str]
    files: list[str]


def prune(repo: Repository, older_than: timedelta, *, dry: bool = False) -> Pruned:
    """Remove what is over for longer than told; with `dry` nothing goes, and `files` stays empty.

    Files go an hour after the last record that named them.
    """
    before = datetime.now(UTC) - older_than
    with repo.database.read() as session:
        jobs = list(session.scalars(_jobs(before)))
        runs = list(session.scalars(_runs(before)))
        plans = list(session.scalars(_plans(before)))
    if dry:
        return Pruned(jobs, runs, plans, [])
    for some in _batches(jobs):
        with repo.database.write() as session:
            session.execute(delete(JobRow).where(JobRow.id.in_(some), JobRow.id.in_(_jobs(before))))
    gone_runs = _remove(repo, RUN, runs, lambda: _runs(before))
    gone_plans = _remove(repo, PLAN, plans, lambda: _plans(before, runs_gone=True))
    return Pruned(jobs, gone_runs, gone_plans, sweep_files(repo))


def _remove(
    repo: Repository, kind: Kind[Any], ids: Sequence[str], still: Callable[[], Select[Any]]
) -> list[str]:
    """Remove rows, with an event each, if they are still to go when their turn comes; return their ids."""
    table: Any = kind.row
    gone = []
    for some in _batches(ids):
        with repo.database.write() as session:
            for row in session.scalars(select(table).where(table.id.in_(some), table.id.in_(still()))).all():
                remove(session, SYSTEM_ACTOR, kind, row, reason=REASON)
                gone.append(row.id)
    return gone


def _batches(ids: Sequence[str]) -> list[Sequence[str]]:
    return [ids[at : at + BATCH] for at in range(0, len(ids), BATCH)]


def _jobs(before: datetime) -> Select[str]:
    return select(JobRow.id).where(JobRow.state.in_(OVER), JobRow.finished_utc < before).order_by(JobRow.id)


def _bound() -> Select[str]:
    """Return the plans that somebody signed, stated something about, or flew many times."""
    rows = (ApprovalRow, StatementRow, PackageRow, CampaignRow)
    named = union(*(select(row.plan_id.label("plan_id")) for row in rows)).subquery()
    return select(named.c.plan_id)


def _dry(before: datetime) -> Select[str]:
    """Return dry runs that were over before a moment and brought nothing that a product names."""
    return select(RunRow.id).where(
        RunRow.kind == RunKind.DRY_RUN.value,
        RunRow.state.in_(OVER),
        RunRow.modified_utc < before,
        RunRow.package_sha256.is_(None),
        RunRow.id.not_in(select(ProductRow.run_id)),
        RunRow.plan_id.not_in(_bound()),
    )


def _runs(before: datetime) -> Select[str]:
    """Return dry runs that may go: all of a superseded plan, and of others all but the last."""
    last = select(func.max(RunRow.id)).group_by(RunRow.plan_id)
    superseded = RunRow.plan_id.in_(_plans(before))
    return _dry(before).where(or_(RunRow.id.not_in(last), superseded)).order_by(RunRow.id)


def _plans(before: datetime, *, runs_gone: bool = False) -> Select[str]:
    """Return plans that may go: never approved, not the newest of their sol, of which nothing is kept.

    None has a run but dry ones that go first, or, with `runs_gone`, none at all.
    """
    newest = select(func.max(PlanRow.id)).group_by(PlanRow.sol_id)  # ids sort by the time they were made
    kept = select(RunRow.plan_id)
    if not runs_gone:
        kept = kept.where(RunRow.id.not_in(_dry(before)))
    parents = select(PlanRow.parent_id).where(PlanRow.parent_id.is_not(None))
    return (
        select(PlanRow.id)
        .where(
            PlanRow.state.in_(UNSIGNED),
            PlanRow.modified_utc < before,
            PlanRow.id.not_in(newest),
            PlanRow.id.not_in(kept),
            PlanRow.id.not_in(parents),
            PlanRow.id.not_in(_bound()),
            PlanRow.job_id.not_in(select(JobRow.id).where(JobRow.state.not_in(OVER))),
        )
        .order_by(PlanRow.id)
    )
