"""Why-not against brute force over all orders.

    python -m studies.planner_why_not [--questions 300] [--targets 5] [--seed S]

Random days whose budgets hold a part of what is asked. For each observation that the best plan without
branches leaves out, the plan of `why_not` that attempts it is compared with the best of all orders that hold
it, both valued without sampling. The plan that is told with a relaxation must hold the observation. Nothing
was tuned on these days. With the factor that is told or a hundredth more the best of all orders must make the
observation, and with a hundredth less the best must not: either may be off by `TIE` of the value, within
which values without sampling are exact, as leads of some orders hardly change over a tenth of a budget.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import json
import time
from pathlib import Path

import numpy as np

from planner.contingency.why_not.limits import widened
from planner.contingency.why_not.orders_by_budget import LEAST_CHANCE
from planner.evaluate.model import Model
from planner.evaluate.monte_carlo import simulate
from planner.evaluate.propagate import Evaluator
from planner.explain import why_not
from planner.plan_tree import Plan, planned_observations
from planner.problem import Observation, Problem
from studies.common.all_orders import AllOrders
from studies.common.planner_days import day
from tests.planner.examples import visits

SEARCH_GRIDS = ((33, 21), (49, 29))
"""Nodes on which all orders are ranked; the best `FINAL` are valued again on the evaluator's own."""
FINAL = 4
ON_GRIDS = 5
"""Observations up to which grids rank all orders; 2,000 orders and more are ranked in drawn futures, by plain
numpy (`all_orders`), which shares no code with why-not.
"""
RANKED, FINAL_RANKED = 512, 24
"""Those futures, and how many orders are valued again then: differences are off by 0.5 % in them."""
CLOSE, TIE = 1.01, 2e-3
"""How far a factor may be off, and the share of a value that is not told apart: 0.1 % is asked of a lead."""
WANTED_S = 0.3
"""Processor seconds that an answer should take at most."""
FEW = 50_000
"""Futures that tell the chance of an observation: its standard error is 0.0004 at 1 %."""


def orders(problem: Problem) -> dict[tuple[str, ...], float]:
    """Return the values of all orders, those that are near the best as the evaluator gives them."""
    model = Model.of(problem)
    names = [str(o.id) for o in problem.observations]
    every = itertools.chain.from_iterable(
        itertools.permutations(range(model.m), count) for count in range(1, model.m + 1)
    )
    if model.m <= ON_GRIDS:
        quick = Evaluator(model, *SEARCH_GRIDS)
        return {
            named: quick.value(visits(problem, *named)).value
            for order in every
            if (named := tuple(names[m] for m in order))
        }
    drawn = AllOrders(problem, RANKED, seed=2).worths()
    return {tuple(names[m] for m in order): worth for order, worth in drawn.items()}


def final(problem: Problem) -> int:
    """Return how many of the best orders are valued again."""
    return FINAL if len(problem.observations) <= ON_GRIDS else FINAL_RANKED


def best_of(problem: Problem, ranked: dict[tuple[str, ...], float], name: str | None) -> float:
    """Return the value of the best order, or of the best that holds an observation; with neither worth
    anything, to do nothing is the best of all.
    """
    fine = Evaluator(Model.of(problem))
    held = sorted((o for o in ranked if name is None or name in o), key=lambda o: -ranked[o])[
        : final(problem)
    ]
    best = max(fine.value(visits(problem, *order)).value for order in held)
    return max(best, 0.0) if name is None else best


def lead(problem: Problem, o: Observation, kind: str, factor: float) -> float:
    """Return by what share of its value the best order with an observation is ahead, with wider limits."""
    wide = widened(problem, o, kind.split(" and "), factor)
    ranked = orders(wide)
    model = Model.of(wide)
    fine = Evaluator(model)
    best = {True: -np.inf, False: 0.0}
    for holds in best:
        left = final(problem)
        for order in sorted((r for r in ranked if (o.id in r) is holds), key=lambda r: -ranked[r]):
            if holds and chance(model, visits(wide, *order), o) < LEAST_CHANCE:
                continue
            best[holds] = max(best[holds], fine.value(visits(wide, *order)).value)
            left -= 1
            if not left or ranked[order] < best[holds] - 0.05 * abs(best[holds]):
                break
    scale = max(abs(best[True]), abs(best[False]), 0.1 * o.utility)
    return (best[True] - best[False]) / scale


def chance(model: Model, plan: Plan, o: Observation) -> float:
    """Return the share of futures in which a plan makes an observation."""
    m = model.number_of[o.id]
    without = model.utility.copy()
    without[m] = 0.0
    earned = [
        simulate(one, plan, FEW, seed=0) for one in (model, dataclasses.replace(model, utility=without))
    ]
    worth = model.utility[m] * model.p_success[m]
    return float((earned[0].utility - earned[1].utility).mean() / worth)


def load_kernels() -> None:
    """Ask about a day of its own, so that no answer that is timed loads compiled code."""
    problem = day(np.random.default_rng(0), least=6, most=6)
    for o in problem.observations:
        why_not(problem, (), str(o.id))


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
    load_kernels()
    rng, began = np.random.default_rng(seed), time.monotonic()
    short: list[float] = []
    used: list[float] = []
    texts: list[str] = []
    told, unverified, late, early = 0, 0, 0, 0
    missed: list[str] = []
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
            took = time.process_time() - start
            if not found.forced:
                continue
            used.append(took)
            texts.append(f"{o.id}: {found.reason}")
            best = best_of(problem, ranked, str(o.id))
            scale = max(best_of(problem, ranked, None), abs(best))
            short.append((best - fine.value(found.forced).value) / scale)
            for relaxation in found.relaxations:
                told += 1
                unverified += o.id not in planned_observations(relaxation.plan)
                over = lead(problem, o, relaxation.what, relaxation.factor * CLOSE)
                if over < -TIE:  # something else may come in just above
                    over = lead(problem, o, relaxation.what, relaxation.factor)
                under = lead(problem, o, relaxation.what, max(1.0, relaxation.factor / CLOSE))
                early += over < -TIE
                late += under > TIE and relaxation.factor > CLOSE
                if over < -TIE or (under > TIE and relaxation.factor > CLOSE):
                    missed.append(f"{o.id} {relaxation.what} {relaxation.factor}: {under:+.4f} {over:+.4f}")
    worst = max(short, default=0.0)
    within, soon = sum(value <= 0.001 for value in short), sum(took <= WANTED_S for took in used)
    print(
        f"{len(short)} questions at {options.targets} targets: forced plan within 0.1 % of the best order on "
        f"{within}, worst {worst:.3%}; {told} relaxations told, {unverified} without a plan; processor "
        f"{np.median(used):.2f} s in the median, at most {WANTED_S} s on {soon} of {len(used)}; "
        f"the dearest {max(used):.2f} s, {texts[int(np.argmax(used))]}"
    )
    print(
        f"of the relaxations {early} come too early and {late} too late by more than 1 %", *missed, sep="\n  "
    )
    out = Path("studies/results/planner_why_not.json")
    out.write_text(
        json.dumps({"seed": seed, "short": short, "used": used}, indent=1) + "\n", encoding="utf-8"
    )


if __name__ == "__main__":
    main()
