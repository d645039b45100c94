"""Why-not against brute force over all orders.

    python -m studies.planner_why_not [--questions 300] [--targets 5 6] [--seed S] [--seconds T] [--resume]
    python -m studies.planner_why_not --targets 5 6 --seed S --days 17 42

Random days whose budgets hold a part of what is asked. For each observation that the best plan without
branches leaves out, the plan of `why_not` that attempts it is compared with the best of all orders that hold
it, both valued without sampling. The plan that is told with a relaxation must hold the observation. Nothing
was tuned on these days. With the factor that is told or a hundredth more the best of all orders must make the
observation, and with a hundredth less the best must not: either may be off by `TIE` of the value, within
which values without sampling are exact, as leads of some orders hardly change over a tenth of a budget.

All orders are ranked in drawn futures by a count written from the definition (`all_orders`), which shares no
code with why-not, and the best are valued by the evaluator. Each day has draws of its own; results are
written after each, and a run that was ended goes on with `--resume`. With `--days` these alone are asked
about, and nothing is written.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import time
from dataclasses import asdict, dataclass, field
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

RANKED = {5: 16_384, 6: 8_192}
FEWEST = 1_024
"""Futures in which all orders are ranked, by the number of targets, and where there are more: as many as take
a second or two; differences are off by a third of a per cent in the fewest.
"""
FINAL, BEHIND = 24, 0.015
"""How many of the best are valued again, and the share of the value behind which none is: four times as much
as differences are off by.
"""
ASKED = 1e-3
"""How far behind the best order a forced plan may be, as a share of the value."""
CLOSE, TIE = 1.01, 2e-3
"""How far a factor may be off, and the share of a value that is not told apart: 0.1 % is asked of a lead."""
WANTED_S = 0.3
"""Processor seconds that an answer should take at most."""
FEW, MANY, SURE = 50_000, 2_000_000, 4.0
"""Futures that tell the chance of an observation, and so many where it is within these standard errors of the
least that counts: 0.0004 at 1 % in the former, 0.00007 in the latter.
"""


def orders(problem: Problem) -> dict[tuple[str, ...], float]:
    """Return the values of all orders in drawn futures."""
    names = [str(o.id) for o in problem.observations]
    drawn = AllOrders(problem, RANKED.get(len(names), FEWEST), seed=2).worths()
    return {tuple(names[m] for m in order): worth for order, worth in drawn.items()}


def best_of(problem: Problem, ranked: dict[tuple[str, ...], float], name: str | None) -> float:
    """Return the value of the best order, or of the best that holds an observation; with neither worth
    anything, to do nothing is the best of all.
    """
    fine = Evaluator(Model.of(problem))
    held = sorted((o for o in ranked if name is None or name in o), key=lambda o: -ranked[o])[:FINAL]
    least = ranked[held[0]] - BEHIND * abs(ranked[held[0]])
    best = max(fine.value(visits(problem, *order)).value for order in held if ranked[order] >= least)
    return max(best, 0.0) if name is None else best


def lead(problem: Problem, o: Observation, kind: str, factor: float) -> float:
    """Return by what share of its value the best order with an observation is ahead, with wider limits."""
    wide = widened(problem, o, kind.split(" and "), factor)
    ranked = orders(wide)
    model = Model.of(wide)
    fine = Evaluator(model)
    best = {True: -np.inf, False: 0.0}
    for holds in best:
        left = FINAL
        for order in sorted((r for r in ranked if (o.id in r) is holds), key=lambda r: -ranked[r]):
            if holds and chance(model, visits(wide, *order), o) < LEAST_CHANCE:
                continue
            best[holds] = max(best[holds], fine.value(visits(wide, *order)).value)
            left -= 1
            if not left or ranked[order] < best[holds] - BEHIND * abs(best[holds]):
                break
    scale = max(abs(best[True]), abs(best[False]), 0.1 * o.utility)
    return (best[True] - best[False]) / scale


def chance(model: Model, plan: Plan, o: Observation) -> float:
    """Return the share of futures in which a plan makes an observation; in few where these tell whether it is
    more than the least that counts.
    """
    m = model.number_of[o.id]
    without = model.utility.copy()
    without[m] = 0.0
    both = model, dataclasses.replace(model, utility=without)
    total = 0.0
    for seed in range(MANY // FEW):
        earned = [simulate(one, plan, FEW, seed=seed).utility for one in both]
        total += float((earned[0] - earned[1]).mean() / (model.utility[m] * model.p_success[m]))
        told = total / (seed + 1)
        error = np.sqrt(LEAST_CHANCE / (FEW * (seed + 1)))
        if abs(told - LEAST_CHANCE) > SURE * error:
            break
    return told


def load_kernels() -> None:
    """Ask about a day of its own, so that no answer that is timed loads compiled code."""
    problem = day(np.random.default_rng(0), least=6, most=6)
    for o in problem.observations:
        why_not(problem, (), str(o.id))


@dataclass
class Found:
    """What was found so far: of each question how far the forced plan is behind the best order, as a share,
    the processor seconds and the answer; and of relaxations how many were told, how many without a plan, too
    early and too late.
    """

    seed: int
    targets: list[int]
    days: int = 0
    short: list[float] = field(default_factory=list)
    used: list[float] = field(default_factory=list)
    answers: list[str] = field(default_factory=list)
    told: int = 0
    unverified: int = 0
    early: int = 0
    late: int = 0
    missed: list[str] = field(default_factory=list)

    def ask(self, number: int) -> None:
        """Ask about each observation of a day that its best order leaves out."""
        problem = drawn(self.seed, number, self.targets)
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
            self.used.append(round(took, 4))
            self.answers.append(f"day {number}, {o.id}: {found.reason}")
            best = best_of(problem, ranked, str(o.id))
            scale = max(best_of(problem, ranked, None), abs(best))
            self.short.append((best - fine.value(found.forced).value) / scale)
            if self.short[-1] > ASKED:
                self.missed.append(f"day {number}, {o.id} forced: {self.short[-1]:.3%} short")
            for relaxation in found.relaxations:
                self.told += 1
                self.unverified += o.id not in planned_observations(relaxation.plan)
                self._judge(f"day {number}", problem, o, relaxation.what, relaxation.factor)

    def _judge(self, name: str, problem: Problem, o: Observation, kind: str, factor: float) -> None:
        """Count a relaxation that comes too early or too late."""
        over = lead(problem, o, kind, factor * CLOSE)
        if over < -TIE:  # something else may come in just above
            over = lead(problem, o, kind, factor)
        under = lead(problem, o, kind, factor / CLOSE) if factor > CLOSE else -np.inf
        self.early += over < -TIE
        self.late += under > TIE
        if over < -TIE or under > TIE:
            self.missed.append(f"{name}, {o.id} {kind} {factor}: {under:+.4f} {over:+.4f}")

    def __str__(self) -> str:
        within, soon = sum(value <= ASKED for value in self.short), sum(s <= WANTED_S for s in self.used)
        targets, dearest = " to ".join(map(str, self.targets)), int(np.argmax(self.used))
        return "\n  ".join(
            [
                f"{len(self.short)} questions at {targets} targets: forced plan within 0.1 % of the best "
                f"order on {within}, worst {max(self.short):.3%}",
                f"{self.told} relaxations told, {self.unverified} without a plan, {self.early} too early and "
                f"{self.late} too late by more than 1 %",
                f"processor {np.median(self.used):.2f} s in the median, at most {WANTED_S} s on {soon} of "
                f"{len(self.used)}; the dearest {max(self.used):.2f} s, {self.answers[dearest]}",
                *self.missed,
            ]
        )


def drawn(seed: int, number: int, targets: list[int]) -> Problem:
    """Return a day whose time budget holds a part of what is asked."""
    rng = np.random.default_rng([seed, number])
    problem = day(rng, least=min(targets), most=max(targets))
    budget = dataclasses.replace(problem.budget, time_s=float(rng.uniform(0.4, 0.8)) * problem.budget.time_s)
    return dataclasses.replace(problem, budget=budget)


def main() -> None:
    """Print what was found and, after every day, write the results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--questions", type=int, default=300)
    parser.add_argument("--targets", type=int, nargs="+", default=[5, 6], help="the least and the most")
    parser.add_argument("--seed", type=int, default=None, help="fresh from the clock when absent")
    parser.add_argument("--seconds", type=float, default=1e9, help="ends after so many by the clock")
    parser.add_argument("--days", type=int, nargs="+", default=[], help="these alone, by number")
    parser.add_argument("--resume", action="store_true", help="go on where the results stopped")
    parser.add_argument("--results", type=Path, default=Path("studies/results/planner_why_not.json"))
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else time.time_ns() % 1_000_000_000
    found = Found(seed, [min(options.targets), max(options.targets)])
    if options.resume:
        found = Found(**json.loads(options.results.read_text(encoding="utf-8")))
        if found.targets != [min(options.targets), max(options.targets)]:
            parser.error(f"the results are of --targets {found.targets}, not of {options.targets}")
    print(f"seed {found.seed}, from day {found.days} on", flush=True)
    load_kernels()
    for number in options.days:
        found.ask(number)
    began = time.monotonic()
    if options.days:
        print(found if found.short else "no questions there", *found.answers, sep="\n  ")
        return
    while len(found.short) < options.questions and time.monotonic() - began < options.seconds:
        found.ask(found.days)
        found.days += 1
        options.results.write_text(json.dumps(asdict(found), indent=1) + "\n", encoding="utf-8")
        print(f"day {found.days}: {len(found.short)} questions, {len(found.missed)} missed", flush=True)
    print(found if found.short else "no questions yet")


if __name__ == "__main__":
    main()
