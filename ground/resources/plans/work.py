"""Compute a contingent plan: network, problem, plan tree, CRL, what the validator says of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from ground.day.plan_summary import finite, summary_of
from ground.day.prepare import Report
from ground.errors import JobFailedError
from ground.jobs.queue import WorkStoppedError
from ground.resources.path_networks.geometry import network_geometry, observation_points
from ground.resources.plans.draft import Drawing
from ground.resources.plans.order import PlanWork
from ground.resources.plans.sol_path_work import FirstSol, plan_first_sol
from planner.changes import changed_problem

if TYPE_CHECKING:
    from executive.crl import Report as Check
    from executive.crl.dictionary import Dictionary

NOT_WORTH = "not worth its time and energy beside the others within this day's budgets"
STOPPED = "The search was stopped; this is the best plan it had found."


def work(order: PlanWork, report: Report, should_stop: Callable[[], bool]) -> Mapping[str, object]:
    """Return plan tree, CRL, summary and everything else a plan's row holds.

    Asked to stop, it returns the best plan so far, with a note that says so, if there is one.

    Raises
    ------
    JobFailedError
        If there is no plan: what must be done cannot be, or the time was too short.
    """
    from executive.crl import canonical_text, digest, readable_text
    from planner.emit_crl import emit
    from planner.errors import PlannerError
    from planner.plan_tree import plan_tree_to_dict, planned_observations
    from planner.problem import problem_to_dict
    from planner.solve import PlanStatus, Progress, solve
    from rover_iface.profile import load_profile

    day = order.site.prepare(order.day, lambda share, what: report(0.3 * share, what))
    search = order.search
    stopped = False

    drawing = Drawing(order.draft, day)

    def follow(progress: Progress) -> None:
        drawing.show(progress)
        text = progress.phase
        if progress.value is not None:
            text += f": {progress.value:.2f}, {progress.branches} branches"
            if progress.upper is not None and math.isfinite(progress.upper):
                text += f", at most {progress.upper:.2f}"
        report(0.3 + 0.65 * progress.fraction, text)

    def stop() -> bool:
        nonlocal stopped
        drawing.catch_up()
        stopped = stopped or should_stop()
        return stopped

    ahead: FirstSol | None = None
    try:
        problem = day.problem if order.what_if is None else changed_problem(day.problem, order.what_if)
        if order.ahead is not None:
            ahead = plan_first_sol(problem, order.ahead, search, follow, stop)
            problem, result = ahead.problem, ahead.result
        else:
            result = solve(
                problem,
                strategy=search.strategy,
                max_branches=search.max_branches,
                time_limit_s=search.time_limit_s,
                iterations=search.iterations,
                seed=search.seed,
                report=follow,
                should_stop=stop,
            )
    except PlannerError as err:
        raise JobFailedError(str(err)) from err
    if stopped and result.status is not PlanStatus.PLANNED:
        raise WorkStoppedError
    if result.status in {PlanStatus.INFEASIBLE, PlanStatus.TIMEOUT}:
        reason = "; ".join(result.reasons) or result.status.value
        raise JobFailedError(f"no plan: {reason}", type=f"plan-{result.status.value}")
    report(0.97, "CRL")
    refs = {"mission": order.site.mission_id, "plan": order.plan_id}
    crl = emit(problem, result.tree, plan_id=order.plan_id, metadata=refs)
    canonical, text = canonical_text(crl), readable_text(crl)
    done = planned_observations(result.tree.plan)
    left_out = {refusal.request_id: refusal.reason for refusal in day.refused}
    for observation in day.problem.observations:
        if observation.id not in done:
            left_out[observation.id] = NOT_WORTH if ahead is None else ahead.later[observation.id]
    check = result.check
    return {
        "status": result.status.value,
        "stopped": STOPPED if stopped else "",
        "problem": problem_to_dict(problem),
        "problem_sha256": problem.digest(),
        "tree": plan_tree_to_dict(result.tree, problem),
        "crl_text": text,
        "crl_sha256": digest(crl),
        "canonical": canonical,
        "findings": findings_of(
            text, load_profile(order.site.rover_profile).language, battery_j=problem.budget.energy_j
        ),
        "planned_request_ids": sorted(done),
        "left_out": left_out,
        "expected_utility": result.expected_utility,
        "standard_error": None if check is None else check.standard_error,
        "lower": result.lower,
        "upper": finite(result.upper),
        "branches": result.branches,
        "summary": {
            **summary_of(problem, result, digest(crl)),
            "stopped": stopped,
            **({} if ahead is None else {"sol_path": ahead.document}),
            **({} if order.what_if is None else {"what_if": order.what_if.as_dict()}),
        },
        "geometry": network_geometry(day),
        "observation_points": observation_points(day),
    }


def findings_of(text: str, language: Dictionary, *, battery_j: float) -> list[Mapping[str, object]]:
    """Return the findings of `report_of` in the form in which a plan's row has them."""
    return [
        {
            "code": f.code,
            "severity": f.severity.value,
            "message": f.message,
            "node": f.node or None,
            "line": f.line or None,
            "column": f.column or None,
        }
        for f in report_of(text, language, battery_j=battery_j).findings
    ]


def report_of(text: str, language: Dictionary, *, battery_j: float) -> Check:
    """Return what the validator says of a text by the rover's dictionary, in its places there.

    `battery_j` is the charge at the start, from which the resource envelope is drawn.
    """
    from executive.crl import check

    return check(
        text,
        commands=language.commands,
        telemetry=language.telemetry,
        levels={"battery-energy": battery_j},
    )
