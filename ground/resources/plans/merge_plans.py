"""Join two edits of a plan: the merged text is a new plan, checked like any other and predicted by nobody."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sqlalchemy.orm import Session

from ground.day.rovers import profile_of
from ground.errors import InvalidInputError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, new_row, next_number
from ground.records.get_resource import require_mission, row_in_mission
from ground.records.show import value_of
from ground.resources.plans.bodies import PlanMergeCreate, PlanSide
from ground.resources.plans.kind import PLAN
from ground.resources.plans.read_plan import computed_plan
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanConflict, PlanMerge, PlanState
from ground.resources.plans.work import findings_of
from ground.resources.problems.row import ProblemRow, came_with_an_archive
from ground.resources.sols.row import SolRow, usable_energy_j
from mission.codec import Document

if TYPE_CHECKING:
    from executive.crl import Plan as CrlPlan
    from ground.versions.merge import Merged

STRATEGY = "merged"
"""What a merged plan has in the place of a search strategy."""


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
        problem_row = session.get_one(ProblemRow, parent.problem_id)
        problem, battery_j = problem_row.document, float(problem_row.document["budget"]["energy_j"])
        if came_with_an_archive(problem_row):
            sol = session.get_one(SolRow, parent.sol_id)
            battery_j = usable_energy_j(sol.battery_j, sol.energy_floor_j, sol.energy_budget_j)
    plan_id = new_id(PLAN.prefix)
    found = _merged(given, (base, ours, theirs), {"mission": mission_id, "plan": plan_id})
    conflicts = [value_of(PlanConflict, c, kind=str(c.kind), choosable=c.choosable) for c in found.conflicts]
    if found.plan is None or given.preview:
        return PlanMerge(None, conflicts, found.plan is not None)
    columns = _columns(found.plan, parent, problem, battery_j)
    taken = "".join(f"; {_said(given, c)} taken at {c.id or 'the header'} {c.field}" for c in conflicts)
    told = f"Merged from {ours.words} and {theirs.words}, edits of {base.words}{taken}."
    with repo.database.write() as session:
        number = next_number(session, PlanRow, mission_id)
        row = new_row(
            PLAN,
            actor,
            mission_id,
            given,
            id=plan_id,
            number=number,
            name=given.name or f"Merged plan {number}",
            notes=" ".join(filter(None, (given.notes, told)))[:20_000],
            inputs_sha256=_inputs(parent, ours, theirs),
            **columns,
        )
        insert(session, actor, PLAN, row, reason=told[:1000])
        return PlanMerge(PLAN.show_one(session, row), conflicts, True)


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
        _readied(_parsed(side, name), refs)
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


def _readied(plan: CrlPlan, refs: dict[str, str]) -> CrlPlan:
    """Return a plan under the ids of the merged one, without paths into a plan tree: it has none."""
    from ground.versions.difference import PLAN_TREE_PATH
    from ground.versions.parts import HEADER, parts_of, plan_of

    try:
        parts = parts_of(plan)
    except ValueError as err:
        raise InvalidInputError(f"the plans cannot be merged: {err}") from err
    for name, part in parts.items():
        held = part.fields.get("metadata")
        if name == HEADER:
            part.fields["metadata"] = {**(held or {}), **refs}
        elif held and PLAN_TREE_PATH in held:
            part.fields["metadata"] = {k: v for k, v in held.items() if k != PLAN_TREE_PATH}
    return plan_of(parts)


def _columns(plan: CrlPlan, parent: PlanRow, problem: Document, battery_j: float) -> dict[str, object]:
    """Return what follows from the merged text, and what stays as it is in the plan it began with."""
    from executive.crl import digest, readable_text
    from ground.checks.used_observations import used_observations

    text = readable_text(plan)
    profile = profile_of(parent.rover_profile)
    observations = {
        str(observation["id"])
        for target in problem.get("targets", ())
        for observation in target.get("observations", (target,))
    }
    planned = used_observations(plan, problem, profile).ids & observations
    kept = ("sol_id", "problem_id", "network_id", "problem_sha256", "terrain_sha256", "dictionary")
    left_out = {name: why for name, why in parent.left_out.items() if name not in planned}
    left_out |= dict.fromkeys(observations - planned - left_out.keys(), "not in the merged plan")
    return {name: getattr(parent, name) for name in kept} | {
        "parent_id": parent.id,
        "state": PlanState.COMPUTED.value,
        "status": STRATEGY,
        "strategy": STRATEGY,
        "max_branches": parent.max_branches,
        "time_limit_s": 0.0,
        "seed": parent.seed,
        "job_id": "",
        "rover_profile": parent.rover_profile,
        "crl_text": text,
        "crl_sha256": digest(plan),
        "findings": findings_of(text, profile.language, battery_j=battery_j),
        "request_ids": list(parent.request_ids),
        "planned_request_ids": sorted(planned),
        "left_out": left_out,
    }


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
