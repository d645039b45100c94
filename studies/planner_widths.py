"""How far plans of 10 to 30 targets are proven from the best policy.

    python -m studies.planner_widths [--targets 10 15 30] [--problems 3] [--seed S] [--limit 60]

The problems are those of `benchmarks.planner_speed` (two observations a target above 12), which reads the
generator of the reference instances beside the repository. *Apart* is (upper - lower) / upper: no policy
earns more than `upper`, and `lower` is what the plan earned over futures that took no part in the search,
less their 99 % error. A plan of up to `--branches` is made, and with fewer its lower end is taken to be less
by what its curve of values tells.
"""

from __future__ import annotations

import argparse
import random
import time

from benchmarks.planner_speed import document
from planner.problem import load_problem
from planner.solve import solve

FEW = (12, 6)
"""Branches with which widths are told besides."""
MOST = 24
"""Branches of a plan: days of ten targets earn up to 1 % more with twice twelve."""
TARGETS = (10, 15, 30)


def main() -> None:
    """Print a row for each problem."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--targets", type=int, nargs="+", default=TARGETS)
    parser.add_argument("--problems", type=int, default=3, help="of each size")
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10**7))
    parser.add_argument("--limit", type=float, default=60.0, help="seconds, as they are reckoned")
    parser.add_argument("--branches", type=int, default=MOST, help="at most")
    options = parser.parse_args()
    print(f"seed {options.seed}")
    few = " | ".join(f"with {most}" for most in FEW)
    print(f"| targets, seed | lower | upper | apart | {few} | branches | reckoned s | CPU s |")
    print("|---" * (7 + len(FEW)) + "|", flush=True)
    draw = random.Random(options.seed)
    for targets in options.targets:
        for _ in range(options.problems):
            seed = draw.randrange(10**7)
            problem = load_problem(document(targets, seed))
            began = time.process_time()
            found = solve(problem, max_branches=options.branches, time_limit_s=options.limit)
            spent = time.process_time() - began
            curve = found.curve
            lost = [curve[-1] - curve[min(most, len(curve) - 1)] for most in FEW]
            widths = " | ".join(f"{1.0 - (found.lower - less) / found.upper:.2%}" for less in (0.0, *lost))
            print(
                f"| {targets}, {seed} | {found.lower:.2f} | {found.upper:.2f} | {widths} | "
                f"{found.branches} | {found.work_s:.1f} | {spent:.0f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
