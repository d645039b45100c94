"""A plan that is a text and not the answer of a search: what its row holds. No planner predicted it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sqlalchemy.orm import Session

from ground.day.rovers import profile_of
from ground.errors import InvalidInputError
from ground.records.actor import Actor
from ground.records.edit import insert, new_row, next_number
from ground.resources.plans.bodies import PlanEdit, PlanMergeCreate
from ground.resources.plans.kind import PLAN
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import Plan, PlanState, Written
from ground.resources.plans.work import findings_of
from ground.resources.problems.row import ProblemRow, came_with_an_archive
from ground.resources.sols.row import SolRow, usable_energy_j
from mission.codec import Document

if TYPE_CHECKING:
    from executive.crl import Plan as CrlPlan

NOTES_MOST, REASON_MOST = 20_000, 1000
"""Characters of a plan's notes and of a reason in the history, as forms allow."""


@dataclass(frozen=True, slots=True)
class Setting:
    """What a text is checked in: the problem of the plan it began with, and the charge at the start."""

    problem: Document
    battery_j: float


def setting_of(session: Session, parent: PlanRow) -> Setting:
    """Return the setting of a plan; one whose problem came with an archive has the charge of its sol."""
    row = session.get_one(ProblemRow, parent.problem_id)
    if not came_with_an_archive(row):
        return Setting(row.document, float(row.document["budget"]["energy_j"]))
    sol = session.get_one(SolRow, parent.sol_id)
    return Setting(row.document, usable_energy_j(sol.battery_j, sol.energy_floor_j, sol.energy_budget_j))


def readied(plan: CrlPlan, refs: Mapping[str, str]) -> CrlPlan:
    """Return a plan under ids of its own (`refs`), without paths into a plan tree: it has none.

    Raises
    ------
    InvalidInputError
        If an id stands twice in it.
    """
    from ground.versions.difference import PLAN_TREE_PATH
    from ground.versions.parts import HEADER, parts_of, plan_of

    try:
        parts = parts_of(plan)
    except ValueError as err:
        raise InvalidInputError(f"the plan cannot be taken apart: {err}") from err
    for name, part in parts.items():
        held = part.fields.get("metadata")
        if name == HEADER:
            part.fields["metadata"] = {**(held or {}), **refs}
        elif held and PLAN_TREE_PATH in held:
            part.fields["metadata"] = {k: v for k, v in held.items() if k != PLAN_TREE_PATH}
    return plan_of(parts)


def written_columns(plan: CrlPlan, parent: PlanRow, setting: Setting, how: Written) -> Mapping[str, object]:
    """Return what follows from the text, and what stays as it is in the plan it began with.

    `how` says in the place of a search strategy how the text came about.
    """
    from executive.crl import digest, readable_text
    from ground.checks.used_observations import used_observations

    text = readable_text(plan)
    profile = profile_of(parent.rover_profile)
    observations = {
        str(observation["id"])
        for target in setting.problem.get("targets", ())
        for observation in target.get("observations", (target,))
    }
    planned = used_observations(plan, setting.problem, profile).ids & observations
    kept = ("sol_id", "problem_id", "network_id", "problem_sha256", "terrain_sha256", "dictionary")
    left_out = {name: why for name, why in parent.left_out.items() if name not in planned}
    left_out |= dict.fromkeys(observations - planned - left_out.keys(), f"not in the {how} plan")
    return {name: getattr(parent, name) for name in kept} | {
        "parent_id": parent.id,
        "state": PlanState.COMPUTED.value,
        "status": how.value,
        "strategy": how.value,
        "max_branches": parent.max_branches,
        "time_limit_s": 0.0,
        "seed": parent.seed,
        "job_id": "",
        "rover_profile": parent.rover_profile,
        "crl_text": text,
        "crl_sha256": digest(plan),
        "findings": findings_of(text, profile.language, battery_j=setting.battery_j),
        "request_ids": list(parent.request_ids),
        "planned_request_ids": sorted(planned),
        "left_out": left_out,
    }


def keep_written(
    session: Session,
    actor: Actor,
    given: PlanEdit | PlanMergeCreate,
    columns: Mapping[str, object],
    *,
    plan_id: str,
    mission_id: str,
    told: str,
    inputs_sha256: str,
) -> Plan:
    """Keep a written plan under an id and return it; `told` says in notes and history how it came about."""
    number = next_number(session, PlanRow, mission_id)
    row = new_row(
        PLAN,
        actor,
        mission_id,
        given,
        id=plan_id,
        number=number,
        name=given.name or f"{str(columns['strategy']).capitalize()} plan {number}",
        notes=" ".join(filter(None, (given.notes, told)))[:NOTES_MOST],
        inputs_sha256=inputs_sha256,
        **columns,
    )
    insert(session, actor, PLAN, row, reason=told[:REASON_MOST])
    shown: Plan = PLAN.show_one(session, row)
    return shown
