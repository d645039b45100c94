"""Linear programs within a limit that does not depend on the machine."""

from __future__ import annotations

from typing import Any

from planner.evaluate.model import Floats
from planner.tally import Step, affordable, spend

LEAST_PIVOTS = 50
"""Iterations that every program is given: fewer answer nothing. By hand."""


def solved(cost: Floats, matrix: Any, limits: Floats, bounds: Any, limit_s: float) -> Any:
    """Return the solver's answer to min cost x, matrix x <= limits; its `status` is 0 if it is an answer.

    `limit_s` are seconds of a processor as `planner.tally` reckons them; the solver is held to the
    iterations that they pay for.

    `cost` [columns], `matrix` [rows, columns] dense or sparse, `limits` [rows].
    """
    from scipy.optimize import linprog  # 0.2 s that a first plan does not need

    rows = matrix.shape[0] + 1
    pivots = max(LEAST_PIVOTS, affordable(Step.PIVOT, limit_s) // rows)
    answer = linprog(
        cost, A_ub=matrix, b_ub=limits, bounds=bounds, method="highs", options={"maxiter": min(pivots, 10**9)}
    )
    spend(Step.PIVOT, rows * max(1, int(answer.nit)))
    return answer
