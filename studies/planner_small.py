"""Bounds and plans of small problems against the best policy, found by trying every choice in every state.

    python -m studies.planner_small [--problems 3000] [--seed S] [--seconds 1200] [--spread 0.2] [--resume]

Problems of `tests.planner.reference.problems`: ways back, missing legs and hubs, two windows on one rock,
precedence, must-do, fading value, lost tracks, penalties; all amounts constant, as the reference asks
(`tests/planner/reference/optimum.py`, written from the problem's definition), drives that fail, and hidden
kinds of sols (there the best policy remembers what its progress has told of the kind). Checked for each: no
bound is below the optimum; the certified lower bound of the plan is not above it; with up to 3 branches the
plan of a quick search (coarse grid) is worth no less than the best order without branches, by more than 0.1 %
and 4 standard errors of their difference in common futures that took no part in any choice. On some problems
an observation is demanded, and on some the chance of an overrun is limited: only orders that keep to that are
looked at. With `--spread` amounts have deviations of that share of their means, and no bound is looked at. A
run that was ended goes on with `--resume`.
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

from planner.constraints.overrun import OverrunChance
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

DEMANDED, LIMITED = 0.15, 0.25
"""Shares of the problems: below the former an observation is demanded, from there to the latter the chance of
an overrun is limited to one in `ALLOWED`."""
ALLOWED = (0.02, 0.1, 0.3)

SLACK = 1e-6
"""Relative: the solver's tolerance."""


def best_orders(problem: Problem) -> list[Plan]:
    """Return the best orders of at most four observations, by their means over common futures.

    They hold what is demanded, and keep to the chance of an overrun as far as so many futures tell.
    """
    model = Model.of(problem)
    names = [str(o.id) for o in problem.observations]
    must = {str(o.id) for o in problem.observations if o.must_do}
    allowed = problem.max_overrun_probability
    means: dict[Plan, float] = {}
    for count in range(1, min(len(names), 4) + 1):
        for order in itertools.permutations(names, count):
            if must <= {*order}:
                met = simulate(model, plan := visits(problem, *order), RANKED, seed=1)
                if allowed is None or met.overrun.mean() <= allowed:
                    means[plan] = float(met.utility.mean())
    return sorted(means, key=lambda plan: -means[plan])[:FINAL]


def worse_than_an_order(problem: Problem, found: Plan, seed: int) -> str:
    """Return what a plan earns less than one of the best orders; empty where that may be chance."""
    model, chance = Model.of(problem), OverrunChance.of(problem)
    earned = simulate(model, found, CHECKED, seed=seed).utility
    for plan in best_orders(problem):
        met = simulate(model, plan, CHECKED, seed=seed)
        if chance is not None and not chance.kept(float(met.overrun.mean()), CHECKED):
            continue
        order = met.utility
        more = order - earned
        error = float(more.std()) / len(more) ** 0.5
        if float(more.mean()) > 4.0 * error + 0.001 * max(1.0, float(order.mean())):
            return f"plan {earned.mean():.4f}, best order {order.mean():.4f}"
    return ""


def judged(family: str, k: int, spread: float, rng: np.random.Generator) -> tuple[list[str], float | None]:
    """Return what problem `k` violates, and the share of the optimum that its plan earns.

    The share is None where an observation is demanded, overruns are limited, amounts have spread or nothing
    can be earned.
    """
    number, turn = int(rng.integers(1 << 30)), k // len(ALL_FAMILIES)
    problem = generated(family, number, spread=spread)
    asked, how = _asked(problem, rng.random())
    best = math.inf if spread else optimum(problem)
    bad = [] if spread else [f"{family} {number}: {why}" for why in _too_low(Model.of(problem), best, turn)]
    result = solve(asked, max_branches=3, time_limit_s=1.0, quick=True)
    slack = SLACK * max(1.0, best)
    if result.lower > best + slack:
        bad.append(f"{family} {number}: lower bound {result.lower:.4f} is above {best:.4f}")
    if result.status is PlanStatus.PLANNED and result.upper < result.lower - SLACK * max(1.0, result.lower):
        bad.append(f"{family} {number}: {result.upper:.4f} is below the plan's {result.lower:.4f}")
    if worse := worse_than_an_order(asked, result.tree.plan, number):
        bad.append(f"{family} {number}{how}: {worse}")
    earned = 0.0 if result.check is None else result.check.mean
    return bad, earned / best if best > 0.0 and not how and not spread else None


def _asked(problem: Problem, part: float) -> tuple[Problem, str]:
    """Return the problem with a demand or a limit by chance, and which."""
    if part < DEMANDED:
        return (with_must(problem), " (demanded)") if problem.targets[0].observations else (problem, "")
    if part >= LIMITED:
        return problem, ""
    allowed = ALLOWED[int((part - DEMANDED) / (LIMITED - DEMANDED) * len(ALLOWED))]
    return dataclasses.replace(problem, max_overrun_probability=allowed), f" (overruns {allowed:g})"


def _too_low(model: Model, best: float, turn: int) -> list[str]:
    """Return which bounds lie below what the best policy earns."""
    passed_over = len(model.by_kind) > 1 and turn % HIDDEN_BY_PLACES > 0
    return [
        f"bound {name} {value:.4f} is below {best:.4f}"
        for name, value in (
            ("table", upper_bound(model, limit_s=0.1).value),
            ("above", _told_the_kind(model, partial(_by_table_above, ABOVE_NODES[turn % len(ABOVE_NODES)]))),
            ("starts", _told_the_kind(model, lambda known: relaxed_bound(known).value)),
            ("drives", _told_the_kind(model, partial(flow_bound, limit_s=1.0 / len(model.by_kind)))),
            ("places", math.inf if passed_over else _told_the_kind(model, _by_places)),
        )
        if value < best - SLACK * max(1.0, best)
    ]


def main() -> None:
    """Print what is violated and, after every problem, write `studies/results/planner_small.json`."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=None, help="fresh from the clock when absent")
    parser.add_argument("--seconds", type=float, default=1e9, help="ends after so many by the clock")
    parser.add_argument("--family", choices=ALL_FAMILIES, help="one family instead of all in turn")
    parser.add_argument("--spread", type=float, default=0.0, help="deviations as a share of the means")
    parser.add_argument("--resume", action="store_true", help="go on where the results stopped")
    options = parser.parse_args()
    families = (options.family,) if options.family else ALL_FAMILIES
    told: dict[str, Any] = {
        "seed": options.seed if options.seed is not None else time.time_ns() % 1_000_000_000
    }
    told |= {"family": options.family, "spread": options.spread, "problems": 0, "bad": [], "shares": []}
    if options.resume:
        told = json.loads(RESULTS.read_text(encoding="utf-8"))
        if (told["family"], told["spread"]) != (options.family, options.spread):
            parser.error(f"the results are of --family {told['family']} --spread {told['spread']:g}")
    print(f"seed {told['seed']}, from problem {told['problems']} on", flush=True)
    began = time.monotonic()
    for k in range(told["problems"], options.problems):
        if time.monotonic() - began > options.seconds:
            break
        rng = np.random.default_rng([told["seed"], k])
        bad, share = judged(families[k % len(families)], k, options.spread, rng)
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
        f"({len(shares)} without demands, limits and spread)"
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


def with_must(problem: Problem) -> Problem:
    """Return the problem with its first observation demanded."""
    first, *others = problem.targets
    demanded = dataclasses.replace(first.observations[0], must_do=True)
    first = dataclasses.replace(first, observations=(demanded, *first.observations[1:]))
    return dataclasses.replace(problem, targets=(first, *others))


if __name__ == "__main__":
    main()
