"""Report a plan on one page for the uplink meeting, before it is run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sqlalchemy import select

from ground.day.plan_summary import told_band
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.reports.page import failure_table, histogram, map_picture, number, page, safe, table, tree_drawing
from ground.reports.plan_drawing import target_names
from ground.resources.approvals.check_flight_rules import hold_rules
from ground.resources.approvals.kind import APPROVAL
from ground.resources.approvals.row import ApprovalRow, WaiverRow
from ground.resources.approvals.value import Approval, FlightRuleResult
from ground.resources.comments.kind import COMMENT
from ground.resources.comments.row import CommentRow
from ground.resources.comments.value import Comment
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import mission_terrain
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.observation_requests.value import ObservationRequest
from ground.resources.plans import plan_futures
from ground.resources.plans.read_plan import computed_plan
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.resources.problems.inputs_digest import inputs_digest
from ground.resources.problems.row import ProblemRow
from ground.resources.sols.row import SolRow

if TYPE_CHECKING:
    from planner.evaluate.monte_carlo import Futures
    from planner.plan_tree_document import TreeDocument
    from planner.problem import Budget
    from planner.problem_document import ProblemDocument

UNLIKELY, LIKELY = 5.0, 95.0
"""Percentiles between which nine futures of ten lie."""


@dataclass(frozen=True, slots=True)
class _Case:
    """A plan and all that was found about it."""

    plan: PlanRow
    sol: SolRow
    stale: bool
    problem: ProblemDocument
    requests: Mapping[str, ObservationRequest]
    rules: Sequence[FlightRuleResult]
    waivers: Sequence[WaiverRow]
    approvals: Sequence[Approval]
    comments: Sequence[Comment]
    budget: Budget


def report_plan(repo: Repository, actor: Actor, plan_id: str) -> str:
    """Return the report of a computed plan as one HTML document that loads nothing.

    What stands against its uplink, map, plan tree, odds and budgets over many futures, each request with its
    chance or why it is left out, top failure modes, flight rules with waivers, findings of the validator,
    approvals, comments and the CRL that is approved.

    Raises
    ------
    StateError
        If the plan is not computed.
    """
    with repo.database.read() as session:
        plan = computed_plan(session, actor, plan_id)
        problem, tree = plan_futures.stored(session, plan)
        document = session.get_one(ProblemRow, plan.problem_id).document
        mission = session.get_one(MissionRow, plan.mission_id)
        terrain = mission_terrain(repo, session, mission.id)
        r, k, a, w, c = ObservationRequestRow, KeepOutRow, ApprovalRow, WaiverRow, CommentRow
        rows = session.scalars(select(r).where(r.mission_id == mission.id).order_by(r.id))
        about = select(c).where(c.mission_id == mission.id, c.subject_kind == "plan", c.subject_id == plan.id)
        approvals = session.scalars(select(a).where(a.plan_id == plan.id).order_by(a.id))
        keep_outs = list(session.scalars(select(k.polygon_m).where(k.mission_id == mission.id)))
        case = _Case(
            plan=plan,
            sol=session.get_one(SolRow, plan.sol_id),
            stale=inputs_digest(session, mission.id) != plan.inputs_sha256,
            problem=document,
            requests={x.id: x for x in OBSERVATION_REQUEST.show(session, list(rows))},
            rules=hold_rules(repo, session, plan),
            waivers=list(session.scalars(select(w).where(w.plan_id == plan.id).order_by(w.rule))),
            approvals=APPROVAL.show(session, list(approvals)),
            comments=COMMENT.show(session, list(session.scalars(about.order_by(c.id)))),
            budget=problem.budget,
        )
    flown, begun = plan_futures.fly(problem, tree.plan, plan.seed)
    drawn: TreeDocument = plan.tree or {"plan": ()}
    parts = [
        _verdict(_against(case)),
        table((), _figures(case)),
        "<h2>Map</h2>",
        map_picture(terrain, document, drawn, "map of the plan", keep_outs=keep_outs),
        "<h2>Plan</h2>",
        tree_drawing(drawn, document),
        "<h2>Odds</h2>",
        _odds(flown),
        "<h2>Budgets</h2>",
        table(
            ("", "expected", "95 % need at most", "budget", "left at 95 %"),
            _budgets(case, flown, begun),
            numbers=range(1, 5),
        ),
        _passes(case.sol),
        "<h2>Requests</h2>",
        table(
            ("target", "instrument", "value", "chance to be begun", "remarks"),
            _requests(case, begun),
            numbers=(2, 3),
        ),
        "<h2>Top failure modes</h2>",
        failure_table(drawn, document),
        "<h2>Flight rules</h2>",
        table(("rule", "", "stands", "value", "limit", "what was found"), _rules(case), numbers=(3, 4)),
        "<h2>What the validator found in the CRL</h2>",
        table(("", "code", "line", "finding"), _findings(plan), numbers=(2,)) or "<p>Nothing.</p>",
        "<h2>Approvals</h2>",
        table(("by", "at", "stands", "note", "CRL SHA-256"), _approvals(case)) or "<p>None yet.</p>",
        "<h2>Comments</h2>" if case.comments else "",
        table(("by", "at", ""), [(x.author, _when(x.created_utc), x.text) for x in case.comments]),
        f"<h2>CRL</h2><details><summary>The text that is approved</summary><pre>{safe(plan.crl_text)}</pre>"
        "</details>",
    ]
    name = f" ({plan.name})" if plan.name else ""
    return page(f"{mission.name}, sol {case.sol.number}: plan {plan.number}{name}", parts)


def _against(case: _Case) -> list[str]:
    """Return what stands between the plan and its uplink."""
    plan = case.plan
    found = []
    if case.stale:
        found.append("the mission was edited since the plan was computed; plan anew")
    errors = sum(finding["severity"] == "error" for finding in plan.findings)
    if errors:
        found.append(f"the validator found {errors} errors in the CRL")
    found += [
        f"{rule.rule} does not hold: {rule.detail}"
        for rule in case.rules
        if not rule.holds and rule.waived_by is None
    ]
    if plan.state in {PlanState.DRAFT, PlanState.COMPUTED}:
        found.append(f"the plan is {plan.state}; it has to be verified")
    elif plan.state == PlanState.VERIFIED:
        found.append(f"nobody but its author ({plan.author}) has approved it yet")
    return found


def _verdict(against: Sequence[str]) -> str:
    if not against:
        return '<p class="go">Nothing stands against the uplink of this plan.</p>'
    lines = "".join(f"<li>{safe(line)}</li>" for line in against)
    return f'<div class="stop">Before this plan can go up:<ul>{lines}</ul></div>'


def _figures(case: _Case) -> list[tuple[str, str]]:
    plan, sol = case.plan, case.sol
    error = "" if plan.standard_error is None else f" ± {plan.standard_error:.2f}"
    start = f"{_clock(sol.start_lmst_h)} local mean solar time"
    return [
        ("state", plan.state + (f", approved by {plan.approved_by}" if plan.approved_by else "")),
        ("made by", f"{plan.author}, {_when(plan.created_utc)}"),
        ("expected utility", f"{number(plan.expected_utility)}{error}, at most {number(plan.upper)}"),
        ("utility of a day", told_band(plan.summary or {}) or "-"),
        ("branches", number(plan.branches).removesuffix(".0")),
        ("strategy", f"{plan.strategy}, seed {plan.seed}"),
        ("plan begins", start + (f", {_when(sol.start_utc)}" if sol.start_utc else "")),
        ("uplink deadline", _when(sol.uplink_deadline_utc) if sol.uplink_deadline_utc else "none set"),
        ("rover", f"{plan.rover_profile}, dictionary {plan.dictionary}"),
        ("CRL SHA-256", plan.crl_sha256 or "-"),
        ("terrain SHA-256", plan.terrain_sha256),
        ("notes", plan.notes or "-"),
    ]


def _clock(hours: float) -> str:
    minutes = round(60 * hours)
    return f"{minutes // 60:02d}:{minutes % 60:02d}"


def _when(at: Any) -> str:
    return f"{at:%Y-%m-%d %H:%M} UTC"


def _odds(flown: Futures) -> str:
    import numpy as np

    utility = flown.utility
    low, middle, high = (float(x) for x in np.percentile(utility, (UNLIKELY, 50.0, LIKELY)))
    worst = float(np.sort(utility)[: max(1, len(utility) // 20)].mean())
    bars = plan_futures.histogram(utility)
    overrun = f"{float(np.mean(flown.overrun)):.2%} of the futures end over a budget"
    share = float(np.mean(utility < 0.5 * float(utility.mean())))
    rows = [
        ("mean utility", f"{float(utility.mean()):.2f}"),
        ("nine futures of ten", f"{low:.1f} to {high:.1f}, median {middle:.1f}"),
        ("mean of the worst twentieth", f"{worst:.1f}"),
        ("less than half the mean", f"{share:.1%} of the futures"),
        ("overrun", overrun),
    ]
    said = f"utility over {len(utility):,} futures; the line is the mean"
    return histogram(bars.edges, bars.share, said, mark=float(utility.mean())) + table((), rows)


def _budgets(case: _Case, flown: Futures, begun: Mapping[str, float]) -> list[tuple[str, ...]]:
    """Return need and budget of time, energy and data."""
    import numpy as np

    def row(name: str, used: Any, limit: float, scale: float, unit: str) -> tuple[str, ...]:
        mean, most = float(np.mean(used)), float(np.percentile(used, LIKELY))
        return (name, *(f"{x / scale:.1f} {unit}" for x in (mean, most, limit, limit - most)))

    rows = [
        row("time", flown.time_s, case.budget.time_s, 60.0, "min"),
        row("energy", flown.energy_j, case.budget.usable_energy_j, 3600.0, "Wh"),
    ]
    volume = {
        o["id"]: float(o.get("data_mbit") or 0.0) for t in case.problem["targets"] for o in t["observations"]
    }
    expected = sum(volume.get(name, 0.0) * chance for name, chance in begun.items())
    limit = case.budget.data_mbit
    shown = "no limit" if limit is None else f"{limit:.1f} Mbit"
    rows.append(("data", f"{expected:.1f} Mbit", "-", shown, "-"))
    return rows


def _passes(sol: SolRow) -> str:
    rows = [
        (p["name"], f"{p['start_s'] / 60:.0f} min", f"{p['end_s'] / 60:.0f} min", f"{p['data_mbit']:g} Mbit")
        for p in sol.passes
    ]
    shown = table(("communication pass", "begins", "ends", "volume"), rows, numbers=(1, 2, 3))
    return f"<p>Times count from the start of the plan.</p>{shown}" if rows else ""


def _requests(case: _Case, begun: Mapping[str, float]) -> list[tuple[str, ...]]:
    """Return each request that was asked of the plan: its chance, or why it is left out."""
    names = target_names(case.problem)
    rows: list[tuple[str, ...]] = []
    seen = set()
    for target in case.problem["targets"]:
        for o in target["observations"]:
            seen.add(o["id"])
            inside = o["id"] in begun
            chance = f"{begun[o['id']]:.1%}" if inside else "-"
            asked = case.requests.get(o["id"])
            remarks = ["must be done" if o.get("must_do") else "", "" if asked is None else asked.rationale]
            if not inside:
                remarks = [case.plan.left_out.get(o["id"], "left out")]
            what = o.get("instrument") or o.get("kind", "")
            rows.append(
                (names[target["id"]], what, f"{o['utility']:g}", chance, "; ".join(filter(None, remarks)))
            )
    for request_id, reason in case.plan.left_out.items():
        request = case.requests.get(request_id)
        if request_id in seen:
            continue
        if request is None:
            rows.append((request_id, "", "", "-", reason))
        else:
            rows.append((request.target_name, request.instrument, f"{request.value:g}", "-", reason))
    return sorted(rows, key=lambda row: row[3] == "-")


def _rules(case: _Case) -> list[tuple[str, ...]]:
    why = {waiver.rule: waiver.reason for waiver in case.waivers}
    rows: list[tuple[str, ...]] = []
    for rule in case.rules:
        stands = "holds" if rule.holds else "BROKEN"
        detail = rule.detail
        if not rule.holds and rule.waived_by is not None:
            stands = f"waived by {rule.waived_by}"
            detail = f"{detail}; waived: {why.get(rule.rule, '')}"
        value, limit = (_measured(x, rule.unit) for x in (rule.value, rule.limit))
        rows.append((rule.rule, rule.title, stands, value, limit, detail))
    return rows


def _measured(value: float | None, unit: str) -> str:
    if value is None:
        return "-"
    return f"{value:,.0f} {unit}" if abs(value) >= 1000.0 else f"{value:.4g} {unit}"


def _findings(plan: PlanRow) -> list[tuple[str, ...]]:
    return [
        (f["severity"], f["code"], "-" if f["line"] is None else str(f["line"]), f["message"])
        for f in plan.findings
    ]


def _approvals(case: _Case) -> list[tuple[str, ...]]:
    return [
        (a.approver, _when(a.created_utc), "void" if a.void else "stands", a.note, a.crl_sha256[:12])
        for a in case.approvals
    ]
