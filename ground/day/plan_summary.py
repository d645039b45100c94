"""What the planner says of its plan, the format `plan-summary/1`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planner.problem import Problem
    from planner.solve import PlanResult


def summary_of(problem: Problem, result: PlanResult, crl_sha256: str) -> Mapping[str, object]:
    """Return the planner's summary, `plan-summary/1`; infinite values become null."""
    check = result.check
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


def finite(value: float | None) -> float | None:
    """Return a number as JSON may have it: None where it is not finite."""
    return value if value is not None and math.isfinite(value) else None
