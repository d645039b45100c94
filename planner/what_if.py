"""What if: a planning problem with a few things changed, and what the plan and a new plan are worth then.

Both plans meet the same futures (common random numbers), so a difference is not noise. The new plan is
searched for among the observations that the present plan holds and those of good routes on mean values, from
the present plan on: an answer in well under a second of processor time, and a lower bound of what the full
planner finds.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from planner.contingency.reduction import live_sets_of, mean_route_of, only
from planner.evaluate.model import Floats, Ints, Model
from planner.evaluate.monte_carlo import simulate
from planner.evaluate.program import Program, compile_plan
from planner.plan_edits import fitted
from planner.plan_tree import Observe, Plan, Visit, count_branches, planned_observations, walk
from planner.problem import ObservationId, Problem
from planner.solve import PlanStatus, solve
from planner.threads import one_blas_thread

FUTURES = 20_000
"""A standard error of 1/141 of the standard deviation of a difference."""

BUDGET_FUTURES = 8_192
"""The first of them, for what more of a budget is worth: it is told in two digits."""

STEP = 0.05
"""Share by which a budget is widened to see what more of it is worth."""
SEARCH_S = 0.2
"""Processor seconds for the new plan, as `planner.tally` reckons them. By hand: over 11 budgets of the demo
mission 0.2 s find 99.9 % of what 0.35 s find, 0.15 s find 98.6 %."""
MAX_LIVE_SETS = 300
"""Largest table of the optimal policy that is filled for an answer at once."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came out. `present` is the plan today; `kept` the same plan in the changed day, without what was
    taken away; `found` the best plan there. `change` is found less present, `replanning` found less kept,
    each with its standard error. `reach` is the chance of each request to be begun under the found plan.
    """

    present: float
    kept: float
    found: float
    change: float
    change_error: float
    replanning: float
    replanning_error: float
    overrun: float
    branches: int
    plan: Plan
    held: frozenset[str]
    reach: Mapping[str, float]
    per_hour: float
    per_100_kj: float
    feasible: bool
    reasons: tuple[str, ...]
    compute_s: float


def candidates(problem: Problem, plan: Plan) -> tuple[str, ...]:
    """Return the observations worth a thought: the plan's, then those of good routes on mean values."""
    found: dict[str, None] = {str(o): None for o in sorted(planned_observations(plan))}
    for share in (1.0, 0.75, 1.3):
        found.update({str(o): None for o in mean_route_of(problem, share)})
    return tuple(found)


def _part(problem: Problem, wanted: Iterable[str], needed: Collection[str]) -> Problem:
    """Return as much of the problem as a small table holds: `needed` first, then `wanted` in their order."""
    before: dict[str, list[str]] = {}
    for first, second in problem.precedence:
        before.setdefault(str(second), []).append(str(first))

    def with_earlier(name: str) -> set[str]:
        found, queue = {name}, [name]
        while queue:
            for earlier in before.get(queue.pop(), ()):
                if earlier not in found:
                    found.add(earlier)
                    queue.append(earlier)
        return found

    worthless = {str(o.id) for o in problem.observations if o.utility <= 0.0}
    names: set[str] = set()
    for name in needed:
        names |= with_earlier(name)
    for name in wanted:
        more = names | with_earlier(name)
        if name in names or more & worthless:
            continue
        count = live_sets_of(only(problem, {ObservationId(n) for n in more}))
        if count is not None and count <= MAX_LIVE_SETS:
            names = more
    return only(problem, {ObservationId(n) for n in names})


def worth_today(problem: Problem, plan: Plan, *, seed: int) -> Floats:
    """Return what the plan earns in each of `FUTURES` futures of its own day, as `what_if` meets them."""
    return simulate(Model.of(problem), plan, FUTURES, seed=seed + 1).utility


def what_if(
    problem: Problem,
    plan: Plan,
    changed: Problem,
    *,
    known: Iterable[str],
    max_branches: int,
    seed: int,
    search_s: float = SEARCH_S,
    iterations: int | None = None,
    today: Floats | None = None,
) -> Outcome:
    """Return what the plan and a new plan are worth in the changed day.

    `known` are the observations of `candidates`; `today` [futures] is what `worth_today` says, for who
    asks often. With
    `iterations` the answer does not depend on the machine.
    """
    began = time.monotonic()
    worthless = {str(o.id) for o in changed.observations if o.utility <= 0.0}
    must = [str(o.id) for o in changed.observations if o.must_do]
    wanted = dict.fromkeys((*known, *(str(o) for o in mean_route_of(changed, 1.0)), *must))
    part = _part(changed, wanted, must)
    kept = fitted(_without(changed, worthless), plan)
    result = solve(
        part,
        max_branches=max_branches,
        time_limit_s=search_s,
        iterations=iterations,
        seed=seed,
        warm=(fitted(part, plan),),
        quick=True,
        plan_only=True,
    )
    feasible = result.status in {PlanStatus.PLANNED, PlanStatus.EMPTY}
    with one_blas_thread():
        model, earned = Model.of(changed), today
        if earned is None:
            earned = worth_today(problem, plan, seed=seed)
        program = compile_plan(model, kept)
        two = three = simulate(model, program, FUTURES, seed=seed + 1, count_visits=True)
        best: Plan = result.tree.plan if feasible else ()
        if best != kept:
            other = compile_plan(model, best)
            found = simulate(model, other, FUTURES, seed=seed + 1, count_visits=True)
            lacking = {*must} - {str(o) for o in planned_observations(kept)}
            if found.utility.mean() >= two.utility.mean() or lacking or not feasible:
                program, three = other, found
            else:
                best = kept
        reach = begun(program, best, three.row_visits, FUTURES)
        per_hour, per_100_kj = _worth_of_budgets(changed, program, three.utility, seed + 1)
    change, replanning = three.utility - earned, three.utility - two.utility
    root = math.sqrt(FUTURES)
    return Outcome(
        present=float(earned.mean()),
        kept=float(two.utility.mean()),
        found=float(three.utility.mean()),
        change=float(change.mean()),
        change_error=float(change.std()) / root,
        replanning=float(replanning.mean()),
        replanning_error=float(replanning.std()) / root,
        overrun=float(three.overrun.mean()),
        branches=count_branches(best),
        plan=best,
        held=frozenset(str(o) for o in planned_observations(best)),
        reach=reach,
        per_hour=per_hour,
        per_100_kj=per_100_kj,
        feasible=feasible,
        reasons=result.reasons if not feasible or result.status is PlanStatus.EMPTY else (),
        compute_s=time.monotonic() - began,
    )


def _worth_of_budgets(problem: Problem, program: Program, earned: Floats, seed: int) -> tuple[float, float]:
    """Return what a plan would win with more time (an hour) and energy (100 kJ), by a twentieth of each more.

    The plan stays as it is and the futures are the same, so this is a lower bound of what more is worth.
    """
    budget = problem.budget
    hours, lots = STEP * budget.time_s / 3600.0, STEP * budget.usable_energy_j / 1e5
    longer = dataclasses.replace(budget, time_s=budget.time_s * (1.0 + STEP))
    fuller = dataclasses.replace(budget, energy_j=budget.energy_j + STEP * budget.usable_energy_j)
    found = []
    for wider, units in ((longer, hours), (fuller, lots)):
        if units <= 0.0:
            found.append(0.0)
            continue
        model = Model.of(dataclasses.replace(problem, budget=wider))
        more = simulate(model, program, BUDGET_FUTURES, seed=seed).utility
        found.append(float((more - earned[:BUDGET_FUTURES]).mean()) / units)
    return found[0], found[1]


def _without(problem: Problem, names: Collection[str]) -> Problem:
    """Return the problem without some observations, and without targets that have none left."""
    return only(problem, {o.id for o in problem.observations if str(o.id) not in names})


def begun(program: Program, plan: Plan, visits: Ints, futures: int) -> dict[str, float]:
    """Return the chance that each observation of a plan is begun, from how often futures came by.

    `visits` [rows] counts, for each row of `program`, the passages of all `futures` together.
    """
    chance: dict[str, float] = {}
    for path, step in walk(plan):
        if isinstance(step, Observe | Visit) and path in program.step_row:
            name = str(step.observation)
            share = float(visits[program.step_row[path]]) / futures
            chance[name] = round(min(1.0, chance.get(name, 0.0) + share), 6)
    return chance
