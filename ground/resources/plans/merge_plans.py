"""Join two edits of a plan: the merged text is a new plan, checked like any other and predicted by nobody."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sqlalchemy.orm import Session

from ground.errors import InvalidInputError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import require_mission, row_in_mission
from ground.records.show import value_of
from ground.resources.plans.bodies import PlanMergeCreate, PlanSide
from ground.resources.plans.kind import PLAN
from ground.resources.plans.read_plan import computed_plan
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanConflict, PlanMerge, Written
from ground.resources.plans.written_plan import keep_written, readied, setting_of, written_columns

if TYPE_CHECKING:
    from executive.crl import Plan as CrlPlan
    from ground.versions.merge import Merged


@dataclass(frozen=True, slots=True)
class _Side:
    """One of the three: what people call it, its row where it is a stored plan, and its text."""

    words: str
    row: PlanRow | None
    text: str


def merge_plans(repo: Repository, actor: Actor, mission_id: str, given: PlanMergeCreate) -> PlanMerge:
    """Return the merged plan, which is kept, or the conflicts that leave none.

    The plan keeps the sol and the problem of `base`. It has no plan tree and no prediction: the overrun rule
    asks for a campaign that was flown here. It counts as stale unless it was made of plans for the mission as
    it is.

    Raises
    ------
    InvalidInputError
        If a side is not a plan of the mission, is not valid CRL or is of another sol, or a choice names no
        conflict.
    StateError
        If a plan is not computed.
    """
    actor.require(Action.PLAN, mission_id)
    with repo.database.read() as session:
        require_mission(session, mission_id)
        parent = _row(session, actor, mission_id, "base", given.base.plan_id)
        base = _Side(f"plan {parent.number}", parent, parent.crl_text or "")
        ours = _side(session, actor, mission_id, "ours", given.ours)
        theirs = _side(session, actor, mission_id, "theirs", given.theirs)
        for name, side in (("ours", ours), ("theirs", theirs)):
            if side.row is not None and side.row.sol_id != parent.sol_id:
                raise InvalidInputError(
                    f"{side.words} is of another sol than {base.words}", pointer=f"/{name}/plan_id"
                )
        setting = setting_of(session, parent)
    plan_id = new_id(PLAN.prefix)
    found = _merged(given, (base, ours, theirs), {"mission": mission_id, "plan": plan_id})
    conflicts = [value_of(PlanConflict, c, kind=str(c.kind), choosable=c.choosable) for c in found.conflicts]
    if found.plan is None or given.preview:
        return PlanMerge(None, conflicts, found.plan is not None)
    columns = written_columns(found.plan, parent, setting, Written.MERGED)
    taken = "".join(f"; {_said(given, c)} taken at {c.id or 'the header'} {c.field}" for c in conflicts)
    told = f"Merged from {ours.words} and {theirs.words}, edits of {base.words}{taken}."
    with repo.database.write() as session:
        about = {"plan_id": plan_id, "mission_id": mission_id, "told": told}
        inputs = _inputs(parent, ours, theirs)
        kept = keep_written(session, actor, given, columns, inputs_sha256=inputs, **about)
        return PlanMerge(kept, conflicts, True)


def _side(session: Session, actor: Actor, mission_id: str, name: str, given: PlanSide) -> _Side:
    if given.crl is not None:
        return _Side(f"a text given as {name}", None, given.crl)
    row = _row(session, actor, mission_id, name, given.plan_id or "")
    return _Side(f"plan {row.number}", row, row.crl_text or "")


def _row(session: Session, actor: Actor, mission_id: str, name: str, plan_id: str) -> PlanRow:
    row_in_mission(session, PLAN, plan_id, mission_id, f"/{name}/plan_id")
    return computed_plan(session, actor, plan_id)


def _merged(given: PlanMergeCreate, sides: tuple[_Side, ...], refs: dict[str, str]) -> Merged:
    from ground.versions.merge import Take, merge

    base, ours, theirs = (
        readied(_parsed(side, name), refs)
        for name, side in zip(("base", "ours", "theirs"), sides, strict=True)
    )
    choices = {(c.kind, c.id, c.field): Take(c.take) for c in given.choices}
    try:
        return merge(base, ours, theirs, None if given.take is None else Take(given.take), choices)
    except InvalidInputError as err:
        raise InvalidInputError(err.message, pointer="/choices" if choices else None) from err


def _parsed(side: _Side, name: str) -> CrlPlan:
    from executive.crl.validate import check

    report = check(side.text)
    if report.plan is None or (side.row is None and report.errors):
        first = report.errors[0]
        raise InvalidInputError(f"{side.words}: {first.message} (line {first.line})", pointer=f"/{name}/crl")
    return report.plan


def _said(given: PlanMergeCreate, conflict: PlanConflict) -> str:
    key = (conflict.kind, conflict.id, conflict.field)
    chosen = (c.take for c in given.choices if (c.kind, c.id, c.field) == key)
    return next(chosen, given.take or "")


def _inputs(parent: PlanRow, *sides: _Side) -> str:
    """Return the state of the mission that a merged plan is of; if its plans differ in it, none ever."""
    made_of = {parent.inputs_sha256, *(s.row.inputs_sha256 for s in sides if s.row is not None)}
    if len(made_of) == 1:
        return parent.inputs_sha256
    return hashlib.sha256(" ".join(sorted(made_of)).encode()).hexdigest()
