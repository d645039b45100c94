"""Whether a larger budget ever gives a plan that is worth less.

    python -m studies.planner_budgets [--problems 200] [--seed S]

Random days of 3 to 5 targets with windows, tracks and penalties are planned at five budgets of time and
energy over a factor of 100. *Certified* is the lower end of the plan's 99 % interval over 200,000 futures
that took no part in the search, *predicted* the value without sampling. A fall counts where it is larger than
what two such intervals may differ by. Nothing was tuned on these days.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import time
from itertools import pairwise
from pathlib import Path

import numpy as np

from planner.solve import solve
from studies.common.planner_days import day

FACTORS = (1.0, 3.0, 10.0, 30.0, 100.0)


def main() -> None:
    """Print the worst falls and write `studies/results/planner_budgets.json`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", type=int, default=200)
    parser.add_argument("--seed", type=int, default=None, help="fresh from the clock when absent")
    parser.add_argument("--seconds", type=float, default=1e9, help="ends after so many by the clock")
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else time.time_ns() % 1_000_000_000
    print(f"seed {seed}")
    rng, began = np.random.default_rng(seed), time.monotonic()
    certified, predicted, off, rows = 0.0, 0.0, 0.0, []
    falls = 0
    for _ in range(options.problems):
        if time.monotonic() - began > options.seconds:
            break
        problem = day(rng, most=5)
        found = []
        for factor in FACTORS:
            budget = problem.budget
            wider = dataclasses.replace(
                budget, time_s=factor * budget.time_s, energy_j=factor * budget.energy_j
            )
            found.append(solve(dataclasses.replace(problem, budget=wider), max_branches=3, time_limit_s=3.0))
        fell = False
        for less, more in pairwise(found):
            top = max(more.expected_utility, 1e-9)
            errors = [0.0 if r.check is None else r.check.standard_error for r in (less, more)]
            certified = max(certified, (less.lower - more.lower) / top)
            predicted = max(predicted, (less.expected_utility - more.expected_utility) / top)
            fell = fell or less.lower - more.lower > 3.0 * float(np.hypot(*errors))
        off = max(
            off,
            *(
                abs(r.expected_utility - r.check.mean) / max(r.check.mean, 1e-9)
                for r in found
                if r.check is not None
            ),
        )
        falls += fell
        rows.append([[r.lower, r.expected_utility, r.upper] for r in found])
    print(
        f"{len(rows)} days at {len(FACTORS)} budgets: the certified bound falls on {falls}, "
        f"by {certified:.2%} at most; the predicted value by {predicted:.2%} at most; "
        f"predicted and sampled differ by {off:.2%} at most"
    )
    out = Path("studies/results/planner_budgets.json")
    out.write_text(json.dumps({"seed": seed, "rows": rows}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
