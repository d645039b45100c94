"""Hold the flight rules against a plan, and accept single violations with a reason."""

from __future__ import annotations

import logging
import math
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.campaigns.result import RESULTS, CampaignResult
from ground.campaigns.tally import OVER
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
from ground.resources.plans.read_plan import computed_plan
from ground.resources.plans.row import PlanRow
from ground.resources.problems.row import ProblemRow
from ground.resources.sols.row import SolRow
from ground.settings import Settings
from mission.codec import Document

if TYPE_CHECKING:
    from rover_iface.terrain import Terrain

logger = logging.getLogger(__name__)

MARS_HOUR_S = 88_775.244 / 24
"""Seconds of an hour of local mean solar time."""


@dataclass(frozen=True, slots=True)
class Rule:
    """One flight rule of the file."""

    id: str
    check: str
    title: str
    limit: float
    unit: str


@dataclass(frozen=True, slots=True)
class Case:
    """What the rules look at."""

    plan: PlanRow
    sol: SolRow
    problem: Mapping[str, Any]
    terrain: Terrain
    campaign: CampaignResult | None
    """What the largest campaign of the plan says that was flown here and has ended."""
    least_runs: int

    def planned(self) -> Iterator[tuple[Document, Document]]:
        """Yield each planned observation with its target."""
        wanted = set(self.plan.planned_request_ids)
        for target in self.problem["targets"]:
            for observation in target["observations"]:
                if observation["id"] in wanted:
                    yield target, observation


Verdict = tuple[bool, float | None, str]
"""Whether the rule holds, the value found, and what to say about it."""


def _tilt(case: Case, limit: float) -> Verdict:
    worst, where = 0.0, "no observation point in the plan"
    for target, _ in case.planned():
        pose = target["observation_point"]
        slope = float(case.terrain.slope(pose["east_m"], pose["north_m"]))
        if math.isnan(slope) or slope >= worst:
            worst, where = slope, f"steepest at {target['refs'].get('name', target['id'])}"
    return worst <= limit, worst, where


def _energy_floor(case: Case, limit: float) -> Verdict:
    left = case.sol.battery_j - case.problem["budget"]["energy_j"] - case.sol.energy_floor_j
    return left >= limit, left, f"left above the floor of {case.sol.energy_floor_j / 3600.0:.3g} Wh"


def _overrun(case: Case, limit: float) -> Verdict:
    if case.plan.elsewhere:  # whoever wrote the archive wrote the prediction
        return _flown_overrun(case, limit, 1, "made elsewhere; a campaign flown here would tell")
    share = float((case.plan.summary or {}).get("overrun_probability", 0.0))
    return share <= limit, share, "share of the futures that end over a budget"


def _arm(case: Case, limit: float) -> Verdict:
    farthest, where = 0.0, "the arm is not used"
    for target, observation in case.planned():
        if observation["kind"] != "place":
            continue
        pose, point = target["observation_point"], target["point_m"]
        distance = math.hypot(point[0] - pose["east_m"], point[1] - pose["north_m"])
        if distance > farthest:
            farthest, where = distance, f"farthest is {target['refs'].get('name', target['id'])}"
    return farthest <= limit, farthest, where


def _instrument(case: Case, limit: float) -> Verdict:
    known = profile_of(case.plan.rover_profile).instruments
    foreign = sorted({o["instrument"] for _, o in case.planned() if o["instrument"] not in known})
    return len(foreign) <= limit, float(len(foreign)), ", ".join(foreign) or "all are known"


def _time_of_day(case: Case, limit: float) -> Verdict:
    end_h = case.sol.start_lmst_h + case.problem["budget"]["time_s"] / MARS_HOUR_S
    return (
        end_h <= limit,
        end_h,
        f"latest end; the plan begins at {_lmst(case.sol.start_lmst_h)}",
    )


def _lmst(hours: float) -> str:
    """Return a local mean solar time as people write it: `09:30 LMST`."""
    minutes = round(hours * 60.0)
    return f"{minutes // 60:02d}:{minutes % 60:02d} LMST"


def _crl(case: Case, limit: float) -> Verdict:
    errors = [f for f in case.plan.findings if f["severity"] == "error"]
    return (
        len(errors) <= limit,
        float(len(errors)),
        "; ".join(f"{f['code']} {f['message']}" for f in errors[:3]) or "none",
    )


def _campaign(case: Case, limit: float) -> Verdict:
    missing = f"the plan was not flown in a campaign here; {case.least_runs:,} runs are asked for"
    return _flown_overrun(case, limit, case.least_runs, missing)


def _flown_overrun(case: Case, limit: float, least_runs: int, missing: str) -> Verdict:
    """Hold a limit against the share of runs over a budget; `missing` is said where no campaign was flown."""
    flown = case.campaign
    over = None if flown is None else next((f for f in flown.frequencies if f.what == OVER), None)
    if flown is None or over is None:
        return False, None, missing
    share = 1.0 if over.interval.high is None else over.interval.high
    if flown.runs < least_runs:
        return False, share, f"its largest campaign has {flown.runs:,} runs; {least_runs:,} are asked for"
    told = (
        f"{over.runs:,} of {flown.runs:,} runs end over a budget; the value is the upper end of the interval"
    )
    return share <= limit, share, told


CHECKS: Mapping[str, Callable[[Case, float], Verdict]] = {
    "tilt": _tilt,
    "energy_floor": _energy_floor,
    "overrun": _overrun,
    "arm": _arm,
    "instrument": _instrument,
    "time_of_day": _time_of_day,
    "crl": _crl,
    "campaign": _campaign,
}


@lru_cache(maxsize=1)
def flight_rules() -> tuple[Rule, ...]:
    """Return the rules of the file, each with a check of ours."""
    document = tomllib.loads((files("ground") / "flight_rules.toml").read_text(encoding="utf-8"))
    rules = tuple(Rule(**rule) for rule in document["rules"])
    for rule in rules:
        if rule.check not in CHECKS:
            raise ValueError(f"flight rule {rule.id}: there is no check {rule.check!r}")
    return rules


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


def hold_rules(repo: Repository, session: Session, plan: PlanRow) -> list[FlightRuleResult]:
    """Return how each rule stands for a computed plan."""
    assert plan.problem_id is not None
    case = Case(
        plan,
        session.get_one(SolRow, plan.sol_id),
        session.get_one(ProblemRow, plan.problem_id).document,
        mission_terrain(repo, session, plan.mission_id),
        _largest_campaign(session, plan) if repo.settings.approval_runs or plan.elsewhere else None,
        repo.settings.approval_runs,
    )
    waived = {
        w.rule: w.author for w in session.scalars(select(WaiverRow).where(WaiverRow.plan_id == plan.id))
    }
    results = []
    for rule in asked_rules(repo.settings):
        holds, value, detail = CHECKS[rule.check](case, rule.limit)
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
