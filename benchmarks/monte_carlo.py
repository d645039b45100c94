"""The Monte Carlo kernel: rollouts a second on one core, and its value beside that of the grid.

Plans with at most four branches are made for each public instance, carried out in 2,000,000 futures by one
thread, and timed in processor seconds (the best of five rounds of 200,000). `steps` are the drives and
observations that a rollout meets in the mean, each with two log-normal draws.

    .venv/bin/python -m benchmarks.monte_carlo [--futures 2000000] [--branches 4] [NAME ...]
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.evaluate.program import Op, Program, compile_plan
from planner.evaluate.propagate import Evaluator
from planner.plan_tree import Branch, walk
from planner.problem import load_problem
from planner.solve import solve

FOLDER = Path(__file__).resolve().parents[1].parent / "shared" / "contingency"
ROUND = 200_000
ITERATIONS = 400
MOVES = (Op.NAVIGATE, Op.OBSERVE)


def main() -> None:
    """Print one row per instance, in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--futures", type=int, default=2_000_000)
    parser.add_argument("--branches", type=int, default=4)
    arguments = parser.parse_args()
    names = arguments.names or list(json.loads((FOLDER / "results.json").read_text(encoding="utf-8")))
    print("| instance | actions | branches | steps | million rollouts/s | Monte Carlo | grid | apart, s.e. |")
    print("|---|---|---|---|---|---|---|---|")
    for name in names:
        problem = load_problem(FOLDER / "instances" / f"{name}.json")
        model = Model.of(problem)
        result = solve(problem, max_branches=arguments.branches, iterations=ITERATIONS)
        plan = result.tree.plan
        program = compile_plan(model, plan)
        visits = simulate(model, program, ROUND, seed=1, threads=1, count_visits=True).row_visits
        moves = sum(int(visits[row]) for row in range(len(program)) if program.op[row] in MOVES)
        fastest = min(_seconds(model, program) for _ in range(5))
        check = simulate(model, program, arguments.futures, seed=2, threads=1).estimate()
        grid = Evaluator(model).value(plan).value
        actions = sum(1 for _, step in walk(plan) if not isinstance(step, Branch))
        print(
            f"| {name} | {actions} | {result.branches} | {moves / ROUND:.1f} | {ROUND / fastest / 1e6:.2f} | "
            f"{check.mean:.4f} ± {check.standard_error:.4f} | {grid:.4f} | "
            f"{(check.mean - grid) / check.standard_error:+.1f} |",
            flush=True,
        )


def _seconds(model: Model, program: Program) -> float:
    began = time.process_time()
    simulate(model, program, ROUND, seed=3, threads=1)
    return time.process_time() - began


if __name__ == "__main__":
    main()
