"""Value of sol paths against their bound and against planning sol by sol, on fresh instances of 30 targets.

    python -m studies.sol_path [--instances 20] [--limit 300] [--seed S] [--greedy 2] [--resume]

Instances of `studies.common.sol_paths` over 5 sols. The value is the mean of the policy in 20,000 drawn
futures that took no part in the search. Sol by sol, each sol is planned alone for the most that it can earn,
and the best policy along that order is carried out in the same futures. Seeds are drawn when the command runs
and printed; `--resume` goes on with the seed and the rows of `studies/results/sol_path.json`.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import time
from pathlib import Path
from typing import Any

import numpy as np

from mission.sol_timeline import SolSeries
from planner.problem import ObservationId, Problem
from planner.sols.order_policy import OrderPolicies
from planner.sols.order_search import days_of, needs_of
from planner.sols.path_problem import path_problem
from planner.sols.solve_path import CHECKED, NODES, solve_sols
from studies.common.sol_paths import several_sols, sol_by_sol

RESULTS = Path("studies/results/sol_path.json")


def worth(problem: Problem, series: SolSeries, order: list[ObservationId], seed: int) -> float:
    """Return what the best policy along an order earns in the mean of drawn futures, in utility."""
    path = path_problem(problem, series)
    days, needs = days_of(path), needs_of(path, seed=seed, futures=1)
    policies = OrderPolicies(path, needs, NODES)
    numbers = np.array([path.model.number_of[o] for o in order], np.int64)
    table = policies.best(numbers).table
    told = policies.carry_out(table, days, needs, seed=seed, futures=CHECKED)
    return float(told.utility.sum(axis=1).mean())


def row_of(seed: int, k: int, limit_s: float, greedy_s: float) -> dict[str, Any]:
    """Return what one instance came to."""
    problem, series = several_sols(np.random.default_rng([seed, k]))
    began = time.process_time()
    path = solve_sols(problem, series, time_limit_s=limit_s, seed=k)
    used_s = time.process_time() - began
    order = sol_by_sol(problem, series, limit_s=greedy_s, seed=k)
    greedy = worth(problem, series, order, k + 1)
    return {
        "instance": k,
        "mean": path.mean,
        "standard_error": path.standard_error,
        "upper": path.upper,
        "share": path.mean / path.upper,
        "greedy": greedy,
        "gain": path.mean / greedy - 1.0,
        "all": sum(o.utility * o.p_success for o in problem.observations),
        "runs": path.runs,
        "work_s": path.work_s,
        "processor_s": used_s,
    }


def told(values: list[float]) -> str:
    """Return the mean of values with its standard error, in per cent."""
    error = statistics.stdev(values) / math.sqrt(len(values)) if len(values) > 1 else math.nan
    return f"{statistics.mean(values):.2%} +- {error:.2%}"


def main() -> None:
    """Print a line for each instance and the means, and write `studies/results/sol_path.json`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--instances", type=int, default=20)
    parser.add_argument("--limit", type=float, default=300.0, help="reckoned processor seconds for each")
    parser.add_argument("--greedy", type=float, default=2.0, help="the same for each sol planned alone")
    parser.add_argument("--seed", type=int, default=None, help="fresh from the clock when absent")
    parser.add_argument("--resume", action="store_true", help="go on where the results stopped")
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else time.time_ns() % 1_000_000_000
    rows: list[dict[str, Any]] = []
    if options.resume:
        stopped = json.loads(RESULTS.read_text(encoding="utf-8"))
        seed, rows = int(stopped["seed"]), stopped["instances"]
        if (stopped["limit_s"], stopped["greedy_s"]) != (options.limit, options.greedy):
            parser.error(
                f"the results are of --limit {stopped['limit_s']:g} --greedy {stopped['greedy_s']:g}, "
                f"not of {options.limit:g} and {options.greedy:g}"
            )
    print(f"seed {seed}", flush=True)
    for k in range(len(rows), options.instances):
        rows.append(row_of(seed, k, options.limit, options.greedy))
        print(" ".join(f"{n} {v:.4g}" for n, v in rows[-1].items()), flush=True)
        result = {"seed": seed, "limit_s": options.limit, "greedy_s": options.greedy, "instances": rows}
        RESULTS.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    shares = [float(row["share"]) for row in rows]
    print(f"{len(rows)} instances: {told(shares)} of the bound in the mean, {min(shares):.2%} at least")
    print(f"gain over sol by sol: {told([float(row['gain']) for row in rows])}")


if __name__ == "__main__":
    main()
