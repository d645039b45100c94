"""The Monte Carlo kernel: rollouts a second on one core, and its value beside that of the grid.

Plans with at most four branches are made for each public instance, or those of `--names`, carried out in many
futures by one thread, and timed in processor seconds (the best of five rounds of 200,000). Steps are the
drives and observations that a rollout meets in the mean, each with two log-normal draws.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from benchmarks.common.clock import spent
from benchmarks.common.figure import Figure, command
from benchmarks.common.instances import INSTANCES, chosen
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.evaluate.program import Op, compile_plan
from planner.evaluate.propagate import Evaluator
from planner.plan_tree import Branch, walk
from planner.problem import load_problem
from planner.solve import solve

ROUND = 200_000
ITERATIONS = 400
MOVES = (Op.NAVIGATE, Op.OBSERVE)
LEAST_RATE, MOST_ERRORS = 2.0, 3.0
"""Million rollouts a second and core, asked for on trees of 20 actions; standard errors off the grid."""
QUICK = {"names": ("dev-reserve-4",), "futures": 200_000}
BUDGET_S = 600.0


def figures(names: tuple[str, ...] = (), futures: int = 2_000_000, branches: int = 4) -> Iterator[Figure]:
    """Yield the rate of rollouts of each instance, and how far both values are apart."""
    for name in chosen(names):
        problem = load_problem(INSTANCES / f"{name}.json")
        model = Model.of(problem)
        plan = solve(problem, max_branches=branches, iterations=ITERATIONS).tree.plan
        program = compile_plan(model, plan)
        visits = simulate(model, program, ROUND, seed=1, threads=1, count_visits=True).row_visits
        steps = sum(int(visits[row]) for row in range(len(program)) if program.op[row] in MOVES) / ROUND
        fastest_s = min(spent(partial(simulate, model, program, ROUND, seed=3, threads=1)) for _ in range(5))
        check = simulate(model, program, futures, seed=2, threads=1).estimate()
        errors = abs(check.mean - Evaluator(model).value(plan).value) / check.standard_error
        actions = sum(1 for _, step in walk(plan) if not isinstance(step, Branch))
        rate = ROUND / fastest_s / 1e6
        what = f"{name}, {actions} actions, {steps:.1f} steps"
        yield Figure(f"{what}: rollouts", rate, "million/s", LEAST_RATE, least=True)
        yield Figure(f"{what}: apart from the grid", errors, "standard errors", MOST_ERRORS)


if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
