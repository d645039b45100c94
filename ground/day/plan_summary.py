"""What the planner says of its plan, the format `plan-summary/1`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planner.problem import Problem
    from planner.solve import PlanResult


def summary_of(problem: Problem, result: PlanResult, crl_sha256: str) -> Mapping[str, object]:
    """Return the planner's summary, `plan-summary/1`; infinite values become null.

    `utility_p05`, `utility_p50` and `utility_p95` are quantiles of what a day with this plan may earn, with
    every success drawn (`planner.outlook`); null where there is no plan.
    """
    check, said = result.check, band_of(problem, result)
    return {
        "format": "plan-summary/1",
        "status": result.status.value,
        "strategy": result.strategy,
        "evaluator": result.evaluator,
        "expected_utility": result.expected_utility,
        "standard_error": 0.0 if check is None else check.standard_error,
        "monte_carlo": 0.0 if check is None else check.mean,
        "overrun_probability": 0.0 if check is None else check.overrun,
        "max_overrun_probability": problem.max_overrun_probability,
        "utility_p05": None if said is None else said[0],
        "utility_p50": None if said is None else said[1],
        "utility_p95": None if said is None else said[2],
        "lower": result.lower,
        "upper": finite(result.upper),
        "optimum_estimate": finite(result.optimum_estimate),
        "branches": result.branches,
        "value_by_branches": [finite(value) for value in result.curve],
        "searched": round(result.searched, 4),
        "work_s": round(result.work_s, 3),
        "wall_s": round(result.wall_s, 3),
        "first_plan_s": round(result.first_plan_s, 3),
        "seed": result.seed,
        "reasons": list(result.reasons),
        "problem_sha256": problem.digest(),
        "crl_sha256": crl_sha256,
    }


def band_of(problem: Problem, result: PlanResult) -> tuple[float, float, float] | None:
    """Return the 5, 50 and 95 % quantiles of what a day with a plan earns; None where there is no plan."""
    from planner.outlook import outlook
    from planner.plan_result import PlanStatus

    if result.status is not PlanStatus.PLANNED:
        return None
    said = outlook(problem, result.tree.plan, seed=result.seed)
    low, middle, high = (said.quantile(p) for p in (0.05, 0.5, 0.95))
    return low, middle, high


def told_band(summary: Mapping[str, object]) -> str:
    """Return what a day may earn by a plan's summary, in words; empty where it does not say so."""
    low, middle, high = (summary.get(f"utility_p{p}") for p in ("05", "50", "95"))
    if low is None or middle is None or high is None:  # no plan, or made before there were any
        return ""
    return f"90 % of days earn {low:.4g} to {high:.4g}, half at least {middle:.4g}"


def finite(value: float | None) -> float | None:
    """Return a number as JSON may have it: None where it is not finite."""
    return value if value is not None and math.isfinite(value) else None
