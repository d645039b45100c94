"""Value of sol paths against their bound, on fresh instances of 30 targets over 5 sols.

    python -m studies.sol_path [--instances 20] [--limit 300] [--seed S]

Instances of `studies.common.sol_paths`. The value is the mean of the policy in 20,000 drawn futures that took
no part in the search. Seeds are drawn when the command runs and printed.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path

import numpy as np

from planner.sols.solve_path import solve_sols
from studies.common.sol_paths import several_sols

RESULTS = Path("studies/results/sol_path.json")


def main() -> None:
    """Print a line for each instance and the mean, and write `studies/results/sol_path.json`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--instances", type=int, default=20)
    parser.add_argument("--limit", type=float, default=300.0, help="reckoned processor seconds for each")
    parser.add_argument("--seed", type=int, default=None, help="fresh from the clock when absent")
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else time.time_ns() % 1_000_000_000
    print(f"seed {seed}", flush=True)
    rows = []
    for k in range(options.instances):
        problem, series = several_sols(np.random.default_rng([seed, k]))
        began = time.process_time()
        path = solve_sols(problem, series, time_limit_s=options.limit, seed=k)
        row = {
            "instance": k,
            "mean": path.mean,
            "standard_error": path.standard_error,
            "upper": path.upper,
            "share": path.mean / path.upper,
            "all": sum(o.utility * o.p_success for o in problem.observations),
            "runs": path.runs,
            "work_s": path.work_s,
            "processor_s": time.process_time() - began,
        }
        rows.append(row)
        print(" ".join(f"{n} {v:.4g}" for n, v in row.items()), flush=True)
        result = {"seed": seed, "limit_s": options.limit, "instances": rows}
        RESULTS.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    shares = [float(row["share"]) for row in rows]
    print(
        f"{len(rows)} instances: {statistics.mean(shares):.2%} of the bound in the mean, "
        f"{min(shares):.2%} at least"
    )


if __name__ == "__main__":
    main()
