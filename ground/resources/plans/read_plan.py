"""Read what the planner made."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING

from sqlalchemy.orm import Session

from ground.errors import DamagedDataError, StateError
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import find_row, read_row
from ground.resources.plans.draft import draft_of
from ground.resources.plans.kind import PLAN
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import Finding, Written

if TYPE_CHECKING:
    from executive.crl.nodes import Plan
    from planner.plan_tree_document import TreeDocument


def computed_plan(session: Session, actor: Actor, plan_id: str) -> PlanRow:
    """Return the row of a computed plan.

    Raises
    ------
    StateError
        If it is not computed.
    """
    row: PlanRow = find_row(session, PLAN, plan_id)
    actor.require(Action.READ, row.mission_id)
    if row.crl_text is None:
        raise StateError(f"plan {row.number} is not computed ({row.status or 'its job is not done'})")
    return row


def tree_of(row: PlanRow) -> TreeDocument:
    """Return the plan tree of a computed plan.

    Raises
    ------
    StateError
        If no planner made it: it was merged, or edited by hand.
    """
    if row.tree is None:
        how = "edited by hand" if row.strategy == Written.EDITED else "merged from others"
        raise StateError(f"plan {row.number} was {how}; it has no plan tree and no prediction")
    return row.tree


def parsed_plan(row: PlanRow) -> Plan:
    """Return what the text of a computed plan says.

    Raises
    ------
    DamagedDataError
        If it is not CRL: it was when it was stored.
    """
    from executive.crl import CrlError, parse

    try:
        return parse(row.crl_text or "")
    except (CrlError, RecursionError) as err:
        raise DamagedDataError(f"the text of plan {row.number} is not CRL any more") from err


def read_tree(repo: Repository, actor: Actor, plan_id: str) -> Mapping[str, object]:
    """Return the plan tree."""
    with repo.database.read() as session:
        return tree_of(computed_plan(session, actor, plan_id))


def read_draft(repo: Repository, actor: Actor, plan_id: str) -> Mapping[str, object] | None:
    """Return the best plan so far of a search that goes on, `plan-draft/1`; None without one."""
    row: PlanRow = read_row(repo, actor, PLAN, plan_id)
    if row.crl_text is not None:
        return None
    try:
        found: Mapping[str, object] = json.loads(draft_of(repo, plan_id).read_text("utf-8"))
    except (FileNotFoundError, ValueError):
        return None
    return found


def read_summary(repo: Repository, actor: Actor, plan_id: str) -> Mapping[str, object]:
    """Return the planner's summary."""
    with repo.database.read() as session:
        return computed_plan(session, actor, plan_id).summary or {}


def read_crl(repo: Repository, actor: Actor, plan_id: str, *, canonical: bool = False) -> str:
    """Return the CRL, readable or canonical."""
    with repo.database.read() as session:
        row = computed_plan(session, actor, plan_id)
        if not canonical:
            return row.crl_text or ""
        parsed = parsed_plan(row)
    from executive.crl import canonical_text

    return canonical_text(parsed)


def read_findings(repo: Repository, actor: Actor, plan_id: str) -> list[Finding]:
    """Return what the validator found."""
    with repo.database.read() as session:
        return [Finding(**f) for f in computed_plan(session, actor, plan_id).findings]
