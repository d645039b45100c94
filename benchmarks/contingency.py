"""The planner on the public contingency instances: percent of the optimum by strategy and branches.

Values are those of the sampling-free evaluator (within 0.1 % of 2,000,000 futures of the reference one).

    .venv/bin/python benchmarks/contingency.py [--pico] [NAME ...]
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from planner.problem import load_problem
from planner.solve import solve

FOLDER = Path(__file__).resolve().parents[1].parent / "shared" / "contingency"


def main() -> None:
    """Print one row per instance, in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--pico", action="store_true", help="with the strategy pico2005 and 12 branches")
    arguments = parser.parse_args()
    results = json.loads((FOLDER / "results.json").read_text(encoding="utf-8"))
    print("| instance | pico2005 | k = 0 | 1 | 2 | 3 | 6 | upper bound | first plan s | final s | CPU s |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for name in arguments.names or list(results):
        problem = load_problem(FOLDER / "instances" / f"{name}.json")
        optimum = results[name]["dp_mid"]
        old = (
            ""
            if not arguments.pico
            else _percent(solve(problem, strategy="pico2005", max_branches=12), optimum)
        )
        began = time.process_time()
        result = solve(problem, max_branches=6)
        cpu = time.process_time() - began
        curve = [f"{100.0 * result.curve[k] / optimum:.2f}" for k in (0, 1, 2, 3, 6)]
        print(
            f"| {name} | {old} | {' | '.join(curve)} | {100.0 * result.upper / optimum:.2f} | "
            f"{result.first_plan_s:.2f} | {result.wall_s:.1f} | {cpu:.1f} |",
            flush=True,
        )


def _percent(result: object, optimum: float) -> str:
    return f"{100.0 * getattr(result, 'expected_utility', 0.0) / optimum:.1f}"


if __name__ == "__main__":
    main()
