"""A sol path as a document, `sol-path/1`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from planner.plan_result import PlanResult
from planner.sols.solve_path import SolPath

FORMAT = "sol-path/1"


def path_to_dict(path: SolPath) -> dict[str, Any]:
    """Return the document of a sol path; the first sol's plan stands beside it as its own files."""
    return {
        "format": FORMAT,
        "mean": path.mean,
        "standard_error": path.standard_error,
        "lower": path.lower,
        "upper": path.upper,
        "order": list(path.order),
        "sols": [{**asdict(sol), "observations": list(sol.observations)} for sol in path.outline],
        "plan": None if path.plan is None else _plan(path.plan),
        "stopped": path.stopped,
        "seed": path.seed,
        "runs": path.runs,
        "work_s": path.work_s,
        "wall_s": path.wall_s,
    }


def _plan(plan: PlanResult) -> dict[str, Any]:
    return {
        "status": plan.status.value,
        "expected_utility": plan.expected_utility,
        "upper": plan.upper,
        "branches": plan.branches,
    }
