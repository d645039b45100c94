"""Check the flight rules against a plan, and accept single violations with a reason."""

from __future__ import annotations

import logging
import math

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.campaigns.result import RESULTS, CampaignResult
from ground.checks.flight_rules import CHECKS, Facts, Rule, UndecidedError, flight_rules
from ground.checks.used_observations import UsedObservations, used_observations
from ground.day.rovers import profile_of
from ground.errors import InvalidInputError, StateError
from ground.gdr.history import Change, record
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.jobs.value import JobState
from ground.records.actor import Action, Actor
from ground.records.get_resource import find_row
from ground.resources.approvals.row import WaiverRow
from ground.resources.approvals.value import FlightRuleResult
from ground.resources.campaigns.row import CampaignRow
from ground.resources.missions.terrain import mission_terrain
from ground.resources.plans.kind import PLAN
from ground.resources.plans.read_plan import computed_plan, parsed_plan
from ground.resources.plans.row import PlanRow
from ground.resources.problems.row import ProblemRow, came_with_an_archive
from ground.resources.sols.row import SolRow
from ground.settings import Settings
from planner.problem_document import ProblemDocument

logger = logging.getLogger(__name__)


def asked_rules(settings: Settings) -> tuple[Rule, ...]:
    """Return the rules that an approval asks for: that of a campaign only where a number of runs is set."""
    return tuple(rule for rule in flight_rules() if rule.check != "campaign" or settings.approval_runs)


def _largest_campaign(session: Session, plan: PlanRow) -> CampaignResult | None:
    """Return what the campaign with most runs says, as flown here: a stop rule may end one of many early."""
    query = select(CampaignRow.result).where(
        CampaignRow.plan_id == plan.id,
        CampaignRow.crl_sha256 == plan.crl_sha256,
        CampaignRow.state == JobState.SUCCEEDED.value,
        CampaignRow.elsewhere.is_(False),
    )
    found = []
    for document in session.scalars(query.order_by(CampaignRow.id.desc())):
        try:
            found.append(RESULTS.from_document(document))
        except InvalidInputError:
            logger.warning("a campaign's result cannot be read", extra={"plan_id": plan.id})
    return max(found, key=lambda result: result.runs, default=None)


def _used(plan: PlanRow, problem: ProblemDocument) -> UsedObservations:
    """Return what the text observes; the list beside it may have come in with an archive."""
    return used_observations(parsed_plan(plan), problem, profile_of(plan.rover_profile))


def _problem(session: Session, plan: PlanRow) -> ProblemDocument | None:
    """Return the problem of a plan; None where whoever wrote an archive wrote it."""
    row = session.get_one(ProblemRow, plan.problem_id)
    return None if plan.elsewhere or came_with_an_archive(row) else row.document


def _predicted_overrun(plan: PlanRow) -> float | None:
    """Return the chance of an overrun that the planner predicted; a merged plan has none."""
    if plan.tree is None:
        return None
    return float((plan.summary or {}).get("overrun_probability", 0.0))


def hold_rules(repo: Repository, session: Session, plan: PlanRow) -> list[FlightRuleResult]:
    """Return how each rule stands for a computed plan; one that is undecided does not hold."""
    problem = _problem(session, plan)
    used = UsedObservations(frozenset(), ()) if problem is None else _used(plan, problem)
    predicted = None if problem is None else _predicted_overrun(plan)
    sol, terrain = session.get_one(SolRow, plan.sol_id), mission_terrain(repo, session, plan.mission_id)
    asked = repo.settings.approval_runs
    facts = Facts(
        problem=problem,
        planned=used.ids,
        open_uses=used.open,
        errors=tuple(f"{f['code']} {f['message']}" for f in plan.findings if f["severity"] == "error"),
        instruments=frozenset(profile_of(plan.rover_profile).instruments),
        slope=lambda east_m, north_m: float(terrain.slope(east_m, north_m)),
        battery_j=sol.battery_j,
        energy_floor_j=sol.energy_floor_j,
        start_lmst_h=sol.start_lmst_h,
        overrun=predicted,
        campaign=_largest_campaign(session, plan) if asked or predicted is None else None,
        least_runs=asked,
    )
    waived = {
        w.rule: w.author for w in session.scalars(select(WaiverRow).where(WaiverRow.plan_id == plan.id))
    }
    results = []
    for rule in asked_rules(repo.settings):
        try:
            holds, value, detail = CHECKS[rule.check](facts, rule.limit)
        except UndecidedError as err:
            holds, value, detail = False, None, str(err)
        value = value if value is not None and math.isfinite(value) else None
        results.append(
            FlightRuleResult(
                rule.id, rule.title, holds, value, rule.limit, rule.unit, detail, waived.get(rule.id)
            )
        )
    return results


def check_flight_rules(repo: Repository, actor: Actor, plan_id: str) -> list[FlightRuleResult]:
    """Return how each flight rule stands for a plan."""
    with repo.database.read() as session:
        return hold_rules(repo, session, computed_plan(session, actor, plan_id))


def waive_rule(
    repo: Repository, actor: Actor, plan_id: str, rule: str, reason: str
) -> list[FlightRuleResult]:
    """Return how the rules stand after accepting a violation.

    Raises
    ------
    InvalidInputError
        If there is no such rule.
    StateError
        If the rule holds anyway, was waived before, or the actor made the plan.
    """
    with repo.database.write() as session:
        actor.require(Action.APPROVE, find_row(session, PLAN, plan_id).mission_id)
        plan = computed_plan(session, actor, plan_id)
        results = {r.rule: r for r in hold_rules(repo, session, plan)}
        if rule not in results:
            raise InvalidInputError(
                f"there is no flight rule {rule}; there are {', '.join(results)}", pointer="/rule"
            )
        if results[rule].holds:
            raise StateError(f"{rule} holds; there is nothing to waive")
        if results[rule].waived_by is not None:
            raise StateError(f"{rule} was waived by {results[rule].waived_by}")
        if plan.author == actor.name:
            raise StateError(f"{actor.name} made plan {plan.number} and cannot waive a rule for it")
        row = WaiverRow(
            id=new_id("wvr"),
            author=actor.name,
            mission_id=plan.mission_id,
            plan_id=plan.id,
            rule=rule,
            reason=reason,
        )
        session.add(row)
        session.flush()
        after = {"plan_id": plan.id, "rule": rule, "reason": reason}
        record(session, plan.mission_id, Change(actor.name, "waive", "plan", plan.id, None, after, reason))
        return hold_rules(repo, session, plan)
