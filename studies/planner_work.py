"""How far the work that planning counts is from the processor seconds that it takes.

    python -m studies.planner_work [--days 20] [--surveys 6] [--seed S]

Days of 4 to 9 targets of all kinds, planned within limits of 2 to 20 s, and surveys of 40 to 400 sites
within 1 or 3 s. The costs of a step (`planner.tally.SECONDS`) were set on other seeds; nothing is tuned here.
A limit is kept where the seconds reckoned are those that the processor counts; each day is planned twice, and
must be the same plan. Processor seconds rise by a quarter or so where neighbours share the processor's cache.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from pathlib import Path

import numpy as np

from planner.orienteering import Experiment, RoutingProblem
from planner.orienteering import solve as solve_routing
from planner.orienteering.engines import warm_up
from planner.plan_tree import plan_tree_to_dict
from planner.solve import solve
from planner.tally import tallied
from studies.common.planner_days import day

LIMITS = (2.0, 5.0, 20.0)


def survey(rng: np.random.Generator) -> RoutingProblem:
    """Return a survey of 40 to 400 sites in a square, with half the length that a tour of all would take."""
    count = int(rng.integers(40, 400))
    xy = rng.uniform(0.0, 1000.0, (count + 1, 2))
    roads = np.ceil(np.linalg.norm(xy[:, None] - xy[None], axis=2)).astype(np.int64)
    prizes = tuple(Experiment(k, k, int(rng.integers(1, 100))) for k in range(1, count))
    return RoutingProblem(roads, 0 * roads, prizes, int(356.0 * np.sqrt(count)), end_site=count)


def main() -> None:
    """Print a line for each order and write `studies/results/planner_work.json`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--days", type=int, default=20)
    parser.add_argument("--surveys", type=int, default=6)
    parser.add_argument("--seed", type=int, default=None, help="fresh from the clock when absent")
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else time.time_ns() % 1_000_000_000
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    warm_up()
    solve(day(np.random.default_rng(0)), iterations=5)
    rows, same = [], 0
    for _ in range(options.days):
        problem, limit = day(rng, least=4), float(rng.choice(LIMITS))
        plans = []
        for _ in range(2):
            began = time.process_time()
            result = solve(problem, time_limit_s=limit)
            used = time.process_time() - began
            plans.append((plan_tree_to_dict(result.tree, problem), result.upper))
        same += plans[0] == plans[1]
        rows.append((f"{len(problem.targets)} targets", limit, used, result.work_s, result.searched))
        _print(rows[-1])
    for _ in range(options.surveys):
        sites, limit = survey(rng), float(rng.choice([1.0, 3.0]))
        began = time.process_time()
        with tallied() as tally:
            solve_routing(sites, time_limit_s=limit, seed=1)
        rows.append(
            (f"{len(sites.experiments)} sites", limit, time.process_time() - began, tally.seconds, 1.0)
        )
        _print(rows[-1])
    ratios = [used / reckoned for _, _, used, reckoned, _ in rows]
    within = sum(0.8 <= ratio <= 1.2 for ratio in ratios)
    most = max(used / limit for _, limit, used, _, _ in rows)
    print(
        "processor seconds over seconds reckoned: "
        f"median {statistics.median(ratios):.2f}, {min(ratios):.2f} to {max(ratios):.2f}, "
        f"within 20 % on {within} of {len(rows)}; most of a limit used {most:.2f}; "
        f"the same plan twice on {same} of {options.days}"
    )
    out = Path("studies/results/planner_work.json")
    out.write_text(json.dumps({"seed": seed, "rows": rows, "same": same}, indent=1) + "\n", encoding="utf-8")


def _print(row: tuple[str, float, float, float, float]) -> None:
    what, limit, used, reckoned, searched = row
    print(
        f"{what:12} limit {limit:4.0f} s  processor {used:6.2f} s  reckoned {reckoned:6.2f} s  "
        f"ratio {used / reckoned:.2f}  searched {searched:.2f}",
        flush=True,
    )


if __name__ == "__main__":
    main()
