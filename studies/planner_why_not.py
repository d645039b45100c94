"""Why-not against brute force over all orders.

    python -m studies.planner_why_not [--questions 300] [--targets 5] [--seed S]

Random days whose budgets hold a part of what is asked. For each observation that the best plan without
branches leaves out, the plan of `why_not` that attempts it is compared with the best of all orders that hold
it, both valued without sampling. The plan that is told with a relaxation must hold the observation. Nothing
was tuned on these days.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import json
import time
from pathlib import Path

import numpy as np

from planner.evaluate.model import Model
from planner.evaluate.propagate import Evaluator
from planner.explain import why_not
from planner.plan_tree import planned_observations
from planner.problem import Problem
from studies.common.planner_days import day
from tests.planner.examples import visits

SEARCH_GRIDS = ((33, 21), (49, 29))
"""Nodes on which all orders are ranked; the best `FINAL` are valued again on the evaluator's own."""
FINAL = 4


def orders(problem: Problem) -> dict[tuple[str, ...], float]:
    """Return the values of all orders, those that are near the best as the evaluator gives them."""
    model = Model.of(problem)
    names = [str(o.id) for o in problem.observations]
    quick = Evaluator(model, *SEARCH_GRIDS)
    return {
        order: quick.value(visits(problem, *order)).value
        for count in range(1, len(names) + 1)
        for order in itertools.permutations(names, count)
    }


def best_of(problem: Problem, ranked: dict[tuple[str, ...], float], name: str | None) -> float:
    """Return the value of the best order, or of the best that holds an observation; with neither worth
    anything, to do nothing is the best of all.
    """
    fine = Evaluator(Model.of(problem))
    held = sorted((o for o in ranked if name is None or name in o), key=lambda o: -ranked[o])[:FINAL]
    best = max(fine.value(visits(problem, *order)).value for order in held)
    return max(best, 0.0) if name is None else best


def main() -> None:
    """Print what was found and write `studies/results/planner_why_not.json`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--questions", type=int, default=300)
    parser.add_argument("--targets", type=int, default=5)
    parser.add_argument("--seed", type=int, default=None, help="fresh from the clock when absent")
    parser.add_argument("--seconds", type=float, default=1e9, help="ends after so many by the clock")
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else time.time_ns() % 1_000_000_000
    print(f"seed {seed}")
    rng, began = np.random.default_rng(seed), time.monotonic()
    short: list[float] = []
    used: list[float] = []
    told, unverified = 0, 0
    while len(short) < options.questions and time.monotonic() - began < options.seconds:
        problem = day(rng, least=options.targets, most=options.targets)
        share = float(rng.uniform(0.4, 0.8))
        budget = dataclasses.replace(problem.budget, time_s=share * problem.budget.time_s)
        problem = dataclasses.replace(problem, budget=budget)
        ranked = orders(problem)
        plan = visits(problem, *max(ranked, key=lambda order: ranked[order]))
        fine, left = Evaluator(Model.of(problem)), planned_observations(plan)
        for o in problem.observations:
            if o.id in left:
                continue
            start = time.process_time()
            found = why_not(problem, plan, str(o.id))
            used.append(time.process_time() - start)
            if not found.forced:
                continue
            best = best_of(problem, ranked, str(o.id))
            scale = max(best_of(problem, ranked, None), 1e-9)
            short.append((best - fine.value(found.forced).value) / scale)
            for relaxation in found.relaxations:
                told += 1
                unverified += o.id not in planned_observations(relaxation.plan)
    worst = max(short, default=0.0)
    within = sum(value <= 0.001 for value in short)
    print(
        f"{len(short)} questions at {options.targets} targets: forced plan within 0.1 % of the best order on "
        f"{within}, worst {worst:.3%}; {told} relaxations told, {unverified} without a plan; processor "
        f"{np.median(used):.2f} s in the median, {max(used):.2f} at most"
    )
    out = Path("studies/results/planner_why_not.json")
    out.write_text(
        json.dumps({"seed": seed, "short": short, "used": used}, indent=1) + "\n", encoding="utf-8"
    )


if __name__ == "__main__":
    main()
