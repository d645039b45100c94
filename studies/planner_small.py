"""Bounds and plans of small problems against the best policy, found by trying every choice in every state.

    python -m studies.planner_small [--problems 3000] [--seed S] [--seconds 1200] [--resume]

Problems of `tests.planner.reference.problems`: ways back, missing legs and hubs, two windows on one rock,
precedence, must-do, fading value, lost tracks, penalties; all amounts constant, as the reference asks
(`tests/planner/reference/optimum.py`, written from the problem's definition), drives that fail, and hidden
kinds of sols (there the best policy remembers what its progress has told of the kind). Checked for each: no
bound is below the optimum; the certified lower bound of the plan is not above it; with up to 3 branches the
plan of a quick search (coarse grid) is worth no less than the best order without branches, by more than 0.1 %
and 4 standard errors of their difference in common futures that took no part in any choice. A run that was
ended goes on with `--resume`.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import json
import math
import statistics
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from planner.contingency.bounds import MARGIN, relaxed_bound, upper_bound
from planner.contingency.by_place.bound import ng_bound
from planner.contingency.flow_bound import flow_bound
from planner.contingency.policy import Moves, Policy
from planner.evaluate.majorant import Majorant
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.plan_tree import Plan
from planner.problem import Problem
from planner.solve import PlanStatus, solve
from planner.tally import tallied
from tests.planner.examples import visits
from tests.planner.reference.optimum import optimum
from tests.planner.reference.problems import ALL_FAMILIES, generated

RESULTS = Path("studies/results/planner_small.json")

RANKED, CHECKED = 4_000, 200_000
"""Futures in which all orders are carried out, and in which the best `FINAL` of them are compared."""
FINAL = 3
ABOVE_NODES = ((9, 8), (17, 19), (33, 38))
"""Grids of functions above the value, in turn: coarse ones add most."""

BY_PLACES_S = 1.5
"""Limit of the bound with a memory of each place, s."""

HIDDEN_BY_PLACES = 10
"""Where the kind of sol is hidden, that bound is made for one problem of so many: it takes 2 s a kind."""

SLACK = 1e-6
"""Relative: the solver's tolerance."""


def best_orders(problem: Problem) -> list[Plan]:
    """Return the best orders of at most four observations, by their means over common futures."""
    model = Model.of(problem)
    names = [str(o.id) for o in problem.observations]
    plans = [
        visits(problem, *order)
        for count in range(1, min(len(names), 4) + 1)
        for order in itertools.permutations(names, count)
    ]
    means = {plan: float(simulate(model, plan, RANKED, seed=1).utility.mean()) for plan in plans}
    return sorted(plans, key=lambda plan: -means[plan])[:FINAL]


def worse_than_an_order(problem: Problem, found: Plan, seed: int) -> str:
    """Return what a plan earns less than one of the best orders; empty where that may be chance."""
    model = Model.of(problem)
    earned = simulate(model, found, CHECKED, seed=seed).utility
    for plan in best_orders(problem):
        order = simulate(model, plan, CHECKED, seed=seed).utility
        more = order - earned
        error = float(more.std()) / len(more) ** 0.5
        if float(more.mean()) > 4.0 * error + 0.001 * max(1.0, float(order.mean())):
            return f"plan {earned.mean():.4f}, best order {order.mean():.4f}"
    return ""


def judged(family: str, k: int, rng: np.random.Generator) -> tuple[list[str], float | None]:
    """Return what problem `k` violates, and the share of the optimum that its plan earns.

    The share is None where an observation is demanded or nothing can be earned.
    """
    number = int(rng.integers(1 << 30))
    problem, must = generated(family, number), rng.random() < 0.15
    must = must and bool(problem.targets[0].observations)
    model = Model.of(problem)
    best = optimum(problem)
    slack = SLACK * max(1.0, best)
    turn = k // len(ALL_FAMILIES)
    passed_over = len(model.by_kind) > 1 and turn % HIDDEN_BY_PLACES > 0
    bad = [
        f"{family} {number}: bound {name} {value:.4f} is below {best:.4f}"
        for name, value in (
            ("table", upper_bound(model, limit_s=0.1).value),
            ("above", _told_the_kind(model, partial(_by_table_above, ABOVE_NODES[turn % len(ABOVE_NODES)]))),
            ("starts", _told_the_kind(model, lambda known: relaxed_bound(known).value)),
            ("drives", _told_the_kind(model, partial(flow_bound, limit_s=1.0 / len(model.by_kind)))),
            ("places", math.inf if passed_over else _told_the_kind(model, _by_places)),
        )
        if value < best - slack
    ]
    asked = _with_must(problem) if must else problem
    result = solve(asked, max_branches=3, time_limit_s=1.0, quick=True)
    if result.lower > best + slack:
        bad.append(f"{family} {number}: lower bound {result.lower:.4f} is above {best:.4f}")
    if result.status is PlanStatus.PLANNED and result.upper < result.lower - slack:
        bad.append(f"{family} {number}: {result.upper:.4f} is below the plan's {result.lower:.4f}")
    if must:
        return bad, None
    if worse := worse_than_an_order(problem, result.tree.plan, number):
        bad.append(f"{family} {number}: {worse}")
    earned = 0.0 if result.check is None else result.check.mean
    return bad, earned / best if best > 0.0 else None


def main() -> None:
    """Print what is violated and, after every problem, write `studies/results/planner_small.json`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=None, help="fresh from the clock when absent")
    parser.add_argument("--seconds", type=float, default=1e9, help="ends after so many by the clock")
    parser.add_argument("--family", choices=ALL_FAMILIES, help="one family instead of all in turn")
    parser.add_argument("--resume", action="store_true", help="go on where the results stopped")
    options = parser.parse_args()
    families = (options.family,) if options.family else ALL_FAMILIES
    told: dict[str, Any] = {
        "seed": options.seed if options.seed is not None else time.time_ns() % 1_000_000_000
    }
    told |= {"family": options.family, "problems": 0, "bad": [], "shares": []}
    if options.resume:
        told = json.loads(RESULTS.read_text(encoding="utf-8"))
        if told["family"] != options.family:
            parser.error(f"the results are of --family {told['family']}, not of {options.family}")
    print(f"seed {told['seed']}, from problem {told['problems']} on", flush=True)
    began = time.monotonic()
    for k in range(told["problems"], options.problems):
        if time.monotonic() - began > options.seconds:
            break
        bad, share = judged(families[k % len(families)], k, np.random.default_rng([told["seed"], k]))
        for line in bad:
            print(line, flush=True)
        told["bad"] += bad
        told["shares"] += [] if share is None else [round(share, 6)]
        told["problems"] = k + 1
        RESULTS.write_text(json.dumps(told) + "\n", encoding="utf-8")
    shares = told["shares"] or [math.nan]
    print(
        f"{told['problems']} problems, {len(told['bad'])} violations; plans earn "
        f"{statistics.mean(shares):.2%} of the optimum in the mean, {min(shares):.2%} at least "
        f"({len(shares)} without must-do)"
    )


def _told_the_kind(model: Model, bound: Callable[[Model], float]) -> float:
    """Return the mean of a bound over the kinds of sols, each known: the bound itself where there is one."""
    return sum(chance * bound(known) for chance, known in model.by_kind)


def _by_table_above(nodes: tuple[int, int], model: Model) -> float:
    policy = Policy(Majorant(model, *nodes), moves=Moves.ALL)
    # Ways back at next to no cost may not settle on few nodes; such a table bounds nothing, nor is it asked.
    return policy.best() * (1.0 + MARGIN) if policy.complete else math.inf


def _by_places(model: Model) -> float:
    with tallied():
        return ng_bound(model, limit_s=BY_PLACES_S)


def _with_must(problem: Problem) -> Problem:
    """Return the problem with its first observation demanded."""
    first, *others = problem.targets
    demanded = dataclasses.replace(first.observations[0], must_do=True)
    first = dataclasses.replace(first, observations=(demanded, *first.observations[1:]))
    return dataclasses.replace(problem, targets=(first, *others))


if __name__ == "__main__":
    main()
