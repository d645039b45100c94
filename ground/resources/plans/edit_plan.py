"""Write a plan by hand: check a text as an edit of a plan, and keep it as a new plan."""

from __future__ import annotations

from ground.day.rovers import profile_of
from ground.errors import InvalidInputError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import find_row
from ground.resources.plans.bodies import PlanEdit
from ground.resources.plans.kind import PLAN
from ground.resources.plans.read_plan import computed_plan
from ground.resources.plans.value import CrlFinding, Plan, Written
from ground.resources.plans.work import report_of
from ground.resources.plans.written_plan import keep_written, readied, setting_of, written_columns


def check_crl(repo: Repository, actor: Actor, plan_id: str, crl: str) -> list[CrlFinding]:
    """Return what the validator has against a text, by the rover and the charge of a plan. Nothing is kept.

    Raises
    ------
    StateError
        If the plan is not computed.
    """
    with repo.database.read() as session:
        parent = computed_plan(session, actor, plan_id)
        setting = setting_of(session, parent)
    report = report_of(crl, profile_of(parent.rover_profile).language, battery_j=setting.battery_j)
    return [
        CrlFinding(
            f.code,
            f.severity.value,
            f.message,
            f.node or None,
            f.line or None,
            f.column or None,
            f.length,
            f.hint,
        )
        for f in report.findings
    ]


def edit_plan(repo: Repository, actor: Actor, plan_id: str, given: PlanEdit) -> Plan:
    """Return a new plan with a text that a person wrote, beginning with a plan of the mission.

    It keeps the sol and the problem of that plan. It has no plan tree and no prediction: the overrun rule
    asks for a campaign that was flown here. It is stale as that plan is. Comments of the text are not kept.

    Raises
    ------
    InvalidInputError
        If the validator finds an error in the text.
    StateError
        If the plan is not computed.
    """
    with repo.database.read() as session:
        mission_id = find_row(session, PLAN, plan_id).mission_id
        actor.require(Action.PLAN, mission_id)
        parent = computed_plan(session, actor, plan_id)
        setting = setting_of(session, parent)
    report = report_of(given.crl, profile_of(parent.rover_profile).language, battery_j=setting.battery_j)
    if report.plan is None or report.errors:
        first = report.errors[0]
        raise InvalidInputError(f"{first.message} (line {first.line})", pointer="/crl")
    new = new_id(PLAN.prefix)
    plan = readied(report.plan, {"mission": mission_id, "plan": new})
    told = f"Edited by hand, beginning with plan {parent.number}."
    columns = written_columns(plan, parent, setting, Written.EDITED)
    with repo.database.write() as session:
        about = {"plan_id": new, "mission_id": mission_id, "told": told}
        return keep_written(session, actor, given, columns, inputs_sha256=parent.inputs_sha256, **about)
