"""Whether a larger budget ever gives a plan that is worth less.

    python -m studies.planner_budgets [--problems 200] [--seed S] [--seconds 1200] [--resume]

Random days of 3 to 5 targets with windows, tracks and penalties are planned at five budgets of time and
energy over a factor of 100. *Certified* is the lower end of the plan's 99 % interval over 200,000 futures
that took no part in the search, *predicted* the value that is told, mostly without sampling. A certified fall
counts where it is larger than what two such intervals may differ by, a predicted one above 0.05 %. The upper
bound takes no part in either, so it is a short one. Nothing was tuned on these days. A run that was ended
goes on with `--resume`.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from planner.options import PlannerOptions
from planner.plan_result import PlanResult
from planner.problem import Problem
from planner.solve import solve
from studies.common.planner_days import day

RESULTS = Path("studies/results/planner_budgets.json")

FACTORS = (1.0, 3.0, 10.0, 30.0, 100.0)

PREDICTED_FALL = 5e-4
"""Share of the value by which the predicted one may fall."""

OPTIONS = PlannerOptions(bound_s=0.06)
"""The bound comes after the plan and changes nothing in it."""


def widened(problem: Problem, factor: float) -> Problem:
    """Return the problem with so many times the time and energy."""
    budget = problem.budget
    wider = dataclasses.replace(budget, time_s=factor * budget.time_s, energy_j=factor * budget.energy_j)
    return dataclasses.replace(problem, budget=wider)


def found_at(problem: Problem, factor: float) -> PlanResult:
    """Return the answer for so many times the budgets."""
    return solve(widened(problem, factor), max_branches=3, time_limit_s=3.0, options=OPTIONS)


def falls(found: list[PlanResult]) -> tuple[float, float, bool]:
    """Return the largest falls of the certified and the predicted value, as shares, and whether the former is
    more than chance.
    """
    certified, predicted, fell = 0.0, 0.0, False
    for less, more in pairwise(found):
        top = max(more.expected_utility, 1e-9)
        one, other = (0.0 if r.check is None else r.check.standard_error for r in (less, more))
        certified = max(certified, (less.lower - more.lower) / top)
        predicted = max(predicted, (less.expected_utility - more.expected_utility) / top)
        fell = fell or less.lower - more.lower > 3.0 * math.hypot(one, other)
    return certified, predicted, fell


def apart(found: list[PlanResult]) -> float:
    """Return by how much predicted and sampled value differ at most, as a share."""
    return max(
        (
            abs(r.expected_utility - r.check.mean) / max(r.check.mean, 1e-9)
            for r in found
            if r.check is not None
        ),
        default=0.0,
    )


def main() -> None:
    """Print each fall and, after every day, write `studies/results/planner_budgets.json`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", type=int, default=200)
    parser.add_argument("--seed", type=int, default=None, help="fresh from the clock when absent")
    parser.add_argument("--seconds", type=float, default=1e9, help="ends after so many by the clock")
    parser.add_argument("--resume", action="store_true", help="go on where the results stopped")
    options = parser.parse_args()
    told: dict[str, Any] = {
        "seed": options.seed if options.seed is not None else time.time_ns() % 1_000_000_000,
        "rows": [],
    }
    if options.resume:
        told = json.loads(RESULTS.read_text(encoding="utf-8"))
    print(f"seed {told['seed']}, from day {len(told['rows'])} on", flush=True)
    began = time.monotonic()
    for k in range(len(told["rows"]), options.problems):
        if time.monotonic() - began > options.seconds:
            break
        problem = day(np.random.default_rng([told["seed"], k]), most=5)
        found = [found_at(problem, factor) for factor in FACTORS]
        certified, predicted, fell = falls(found)
        if fell or predicted > PREDICTED_FALL:
            values = " ".join(f"{r.expected_utility:.4f} ({r.lower:.4f})" for r in found)
            print(f"day {k}: predicted (certified) {values}", flush=True)
        told["rows"].append([certified, predicted, float(fell), apart(found)])
        RESULTS.write_text(json.dumps(told) + "\n", encoding="utf-8")
    rows = np.array(told["rows"]).reshape(-1, 4)
    worst = rows.max(axis=0, initial=0.0)
    print(
        f"{len(rows)} days at {len(FACTORS)} budgets: the certified bound falls on {int(rows[:, 2].sum())}, "
        f"by {worst[0]:.3%} at most; the predicted value by more than {PREDICTED_FALL:.2%} on "
        f"{np.count_nonzero(rows[:, 1] > PREDICTED_FALL)}, by {worst[1]:.3%} at most; predicted and sampled "
        f"differ by {worst[3]:.2%} at most"
    )


if __name__ == "__main__":
    main()
